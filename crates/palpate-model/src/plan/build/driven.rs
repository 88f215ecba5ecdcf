//! Where driven points sit on a body, when the states of a quasi-static sequence are, and what holds its body.

use super::{PlanError, error};
use crate::effects::driven::{Drive, DrivenSites, Points};
use crate::effects::{Effect, attachment, handle};
use crate::observation::Observation;
use crate::scene::Scene;
use crate::space::body::Body;
use crate::space::stencil::{StencilBuf, Stencils};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// How far driven points may lie from the body where nothing else is stated, in cells.
const REACH: f64 = 2.0;
/// Part of the points' extent that the farthest must lie off the line through two of them, so that no turn about it is free.
const OFF_LINE: f64 = 1e-3;
/// Times closer than this part of their size are one state: files round them.
const SAME: f64 = 1e-9;

/// The sites of every effect that a series drives.
pub(super) fn sites(scene: &Scene, body: &Body) -> Result<Vec<Option<Arc<DrivenSites>>>, PlanError> {
    let mut all = Vec::new();
    for (i, effect) in scene.effects.iter().enumerate() {
        let Some(drive) = &effect.drive else {
            all.push(None);
            continue;
        };
        let table = effect.law().table();
        let row = scene.effects[..i].iter().filter(|e| e.law().table() == table).count();
        all.push(Some(Arc::new(driven(drive, body).map_err(|(key, message)| error(format!("{table}.{row}.{key}"), message))?)));
    }
    Ok(all)
}

fn driven(drive: &Drive, body: &Body) -> Result<DrivenSites, (&'static str, String)> {
    let (mut stencils, mut rest) = (Stencils::default(), Vec::new());
    match &drive.points {
        Points::Nodes(nodes) => {
            let count = body.nodes.len();
            for (k, n) in nodes.iter().enumerate() {
                let place = body.nodes.get(*n as usize).ok_or_else(|| {
                    let text = format!(
                        "{n} (number {k}) is no node: the body has {count}, numbered from 0; give `places`, which no grid changes"
                    );
                    ("index", text)
                })?;
                stencils.push(&[*n], &[1.0]);
                rest.push(*place);
            }
        }
        Points::Places(places, tolerance) => {
            let carrier = body.carrier();
            let allowed = tolerance.unwrap_or(REACH * body.length);
            let found: Vec<(StencilBuf, f64)> = places.par_iter().map(|p| carrier.carry(*p)).collect();
            let far: Vec<usize> = (0..found.len()).filter(|k| found[*k].1 > allowed || found[*k].1.is_nan()).collect();
            if let Some(first) = far.first() {
                let worst = far.iter().copied().fold(*first, |a, b| if found[b].1 > found[a].1 { b } else { a });
                let key = if drive.tracked.is_empty() { "places" } else { "points" };
                let text = format!(
                    "{} of {} points lie more than {allowed:.4} m from the body at rest, point {worst} at {} m by {:.4} m",
                    far.len(),
                    found.len(),
                    places[worst],
                    found[worst].1
                );
                return Err((key, text));
            }
            for (s, _) in &found {
                stencils.push(&s.nodes, &s.value);
            }
            rest = places.clone();
        }
    }
    Ok(DrivenSites { stencils, rest, series: drive.series.clone() })
}

/// Times of the states of a quasi-static sequence on the recording's clock [s], rising; empty for a motion.
///
/// Those of a uniform clock where the scene states one, and of the frames that it is compared with; with neither those of the series
/// that drive it and of what moves beside it, and else the start alone.
pub(super) fn times(scene: &Scene, observation: &Observation) -> Vec<f64> {
    let time = &scene.time;
    if !time.scheme.still {
        return Vec::new();
    }
    let mut all: Vec<f64> = observation.frames.iter().map(|f| f.time).collect();
    if time.steps > 0 {
        all.extend((0..=time.steps).map(|k| time.start + k as f64 * time.step));
    }
    if all.is_empty() {
        let series = scene.effects.iter().filter_map(|e| e.drive.as_ref()).map(|d| &d.series);
        all = series.filter(|s| s.times.len() > 1).flat_map(|s| s.times.iter().copied()).collect();
        all.extend(scene.effects.iter().filter_map(|e| e.moving.as_ref()).flat_map(|m| m.motion.times.iter().copied()));
    }
    if all.is_empty() {
        all.push(time.start);
    }
    all.sort_by(f64::total_cmp);
    all.dedup_by(|later, first| *later - *first <= SAME * (1.0 + first.abs()));
    all
}

/// A body in equilibrium without inertia has to be held: a turn or a shift that costs nothing leaves its place open.
pub(super) fn check_held(scene: &Scene) -> Result<(), PlanError> {
    if !scene.clamps.is_empty() {
        return Ok(());
    }
    let pulls = |e: &&Effect| e.values.first().copied().flatten().is_some_and(|k| k != 0.0);
    let of = |kind: &'static str| scene.effects.iter().filter(pulls).filter(move |e| e.law().kind == kind);
    // Its region resists turns as well.
    if of(handle::KIND).next().is_some() || of("tether").next().is_some() {
        return Ok(());
    }
    let places: Vec<DVec3> = of(attachment::KIND)
        .filter_map(|e| e.drive.as_ref())
        .flat_map(|d| match &d.points {
            Points::Places(places, _) => places.clone(),
            Points::Nodes(_) => Vec::new(),
        })
        .collect();
    if places.is_empty() {
        let text = "= \"quasi-static\" needs something that holds the body: a [[clamp]] or an [[attach]]; without either its place is open";
        return Err(error("time.mode", text.into()));
    }
    if !spans(&places) {
        let text = format!(
            "of the {} attached points none lies off the line through the others, about which the body can turn freely; attach three \
             points that are not on a line, or add a [[clamp]]",
            places.len()
        );
        return Err(error("attach.0.points", text));
    }
    Ok(())
}

/// True where points do not lie on a line.
fn spans(places: &[DVec3]) -> bool {
    let farthest =
        |from: DVec3| places.iter().copied().fold(from, |a, b| if b.distance(from) > a.distance(from) { b } else { a });
    let a = places[0];
    let b = farthest(a);
    let Some(along) = (b - a).try_normalize() else { return false };
    let off = |p: &DVec3| (*p - a).reject_from(along).length();
    places.iter().map(off).fold(0.0, f64::max) > OFF_LINE * a.distance(b)
}
