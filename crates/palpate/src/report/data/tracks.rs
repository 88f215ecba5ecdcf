//! Markers, tracked points and nodes over time.

use super::motion::{Motion, Plot};
use crate::experiment::Experiment;
use crate::report::quantity::millimetres;
use crate::residuals::spread;
use crate::results::report::{Chart, Role, Series, Style, Topic};
use palpate_model::observation::{ReadingKind, Sensor};
use std::collections::BTreeSet;

/// Most markers that are shown over time, and most tracked points or nodes.
const MOST: (usize, usize) = (24, 8);
/// Most charts that are shown at once.
const MAIN: usize = 3;
/// Most frames of a curve.
pub const MOST_FRAMES: usize = 2000;

/// What is followed: markers, or some of the points and nodes, in rising order.
pub fn followed(e: &Experiment) -> Vec<(Sensor, u32)> {
    let observation = &e.plan().observation;
    let mut all = BTreeSet::new();
    for f in &observation.frames {
        all.extend(f.markers.iter().map(|m| (observation.sensor_of(m.site), m.site)));
        all.extend(f.displacements.iter().map(|d| (Sensor::Nodes, d.node)));
    }
    let all: Vec<(Sensor, u32)> = all.into_iter().collect();
    let of = |kind: ReadingKind, most: usize| {
        let mine: Vec<usize> = (0..all.len()).filter(|k| all[*k].0.kind() == kind).collect();
        spread(&mine, most)
    };
    let mut some: Vec<usize> = of(ReadingKind::Marker, MOST.0);
    some.extend(of(ReadingKind::Track, MOST.1));
    some.extend(of(ReadingKind::Displacement, MOST.1));
    some.sort_unstable();
    some.into_iter().map(|k| all[k]).collect()
}

/// Charts of everything followed: the displacement from its place at rest, coordinate by coordinate. Those that move most are main ones.
pub fn tracks(e: &Experiment, plot: &Plot, motions: [Option<&Motion>; 2], names: [&str; 2]) -> Vec<Chart> {
    let observation = &e.plan().observation;
    let nodes = &e.plan().body.nodes;
    let (Some(found), true) = (motions[1].or(motions[0]), observation.frames.len() > 1) else { return Vec::new() };
    let all: Vec<usize> = (0..observation.frames.len()).collect();
    let frames = spread(&all, MOST_FRAMES);
    let time = |f: &usize| observation.frames[*f].time;
    let mut out: Vec<(f64, Chart)> = Vec::new();
    for (k, (sensor, item)) in plot.followed.iter().enumerate() {
        let rest = match sensor {
            Sensor::Nodes => nodes[*item as usize],
            _ => {
                let site = &observation.markers[*item as usize];
                site.carry(|i| nodes[i]).0 + site.stalk
            }
        };
        let name = match sensor {
            Sensor::Marker(_) => observation.name(*sensor),
            Sensor::Nodes => format!("node {item}"),
            // Sites of points stand behind those of markers.
            _ => format!("point {}", *item as usize + 1 - observation.marker_count()),
        };
        for (axis, coordinate) in ["x", "y", "z"].into_iter().enumerate() {
            let curve = |m: &Motion, simulated: bool| -> Vec<(f64, f64)> {
                let place = |f: &usize| m.tracks[k].get(f).map(|p| if simulated { p.1 } else { p.0 } - rest);
                frames.iter().map(|f| (time(f), place(f).map_or(f64::NAN, |p| p[axis] * 1e3))).collect()
            };
            let measured = curve(found, false);
            let seen = measured.iter().map(|p| p.1).filter(|y| y.is_finite());
            let (lo, hi) = seen.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), y| (a.min(y), b.max(y)));
            if lo > hi {
                continue;
            }
            let mut series = Vec::new();
            for (m, (role, style)) in [(Role::Before, Style::Dashed), (Role::After, Style::Line)].into_iter().enumerate() {
                series.extend(motions[m].map(|motion| Series::new(names[m], role, style, curve(motion, true))));
            }
            // Dots lie over what is simulated: of thousands they would hide it.
            let style = if frames.len() > 400 { Style::Line } else { Style::Dots };
            series.insert(
                if style == Style::Line { 0 } else { series.len() },
                Series::new("measured", Role::Measured, style, measured.clone()),
            );
            let apart = |m: &Motion| {
                let squares: Vec<f64> = m.tracks[k].values().map(|p| (p.1 - p.0)[axis].powi(2)).collect();
                (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
            };
            let told: Vec<String> =
                (0..2).filter_map(|m| Some(format!("{} {}", names[m], millimetres(apart(motions[m]?))))).collect();
            out.push((
                hi - lo,
                Chart {
                    key: format!("track-{k}-{coordinate}"),
                    topic: Topic::Track,
                    subject: name.clone(),
                    title: format!("{name}, {coordinate}: measured against simulated"),
                    words: format!(
                        "Displacement of {name} along {coordinate} over time, which was measured from {lo:.2} to {hi:.2} mm. Root mean square distance: {}.",
                        told.join(", ")
                    ),
                    x: "time [s]".into(),
                    y: format!("{coordinate} from rest [mm]"),
                    series,
                    ..Chart::default()
                },
            ));
        }
    }
    let mut order: Vec<usize> = (0..out.len()).collect();
    order.sort_by(|a, b| out[*b].0.total_cmp(&out[*a].0).then(a.cmp(b)));
    // Of each thing the coordinate that moves most comes first; then others of the same.
    let mut told = BTreeSet::new();
    for k in order.iter().copied().filter(|k| told.insert(out[*k].1.subject.clone())).take(MAIN).collect::<Vec<_>>() {
        out[k].1.main = true;
    }
    out.into_iter().map(|o| o.1).collect()
}
