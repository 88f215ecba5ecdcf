//! What a recording holds.

use super::{Lines, extremes, title};
use crate::experiment::short;
use crate::results::finite;
use crate::results::inspection::{CameraInspection, Clouds, Images, Markers, RecordingInspection, SequenceInspection};
use palpate_io::recording::{Recording, SeenFrom, Sequence};

/// As a document and in words.
pub(super) fn recording(r: &Recording) -> (RecordingInspection, Lines) {
    let mut content = RecordingInspection { title: title(&r.title), ..RecordingInspection::default() };
    let mut lines: Lines = content.title.iter().map(|t| ("title", t.clone())).collect();
    let stated = |noise: Option<f64>| noise.map_or("not stated".to_string(), |s| format!("{:.2} mm", s * 1e3));
    for c in &r.cameras {
        let (noise, at) = (stated(c.noise_sigma), c.position());
        lines.push(("camera", format!("{} {} × {} pixels, noise {noise}, at {at:.3}", c.name, c.width, c.height)));
        content.cameras.push(CameraInspection {
            name: c.name.clone(),
            width: c.width,
            height: c.height,
            noise: c.noise_sigma,
            systematic: c.noise_systematic,
            position: at.to_array(),
        });
    }
    let readings: Vec<usize> = r.frames.iter().map(|f| f.readings().count()).collect();
    if let (Some(first), Some(last)) = (r.frames.first(), r.frames.last()) {
        let (count, [low, high], from, to) = (r.frames.len(), extremes(&readings), first.time, last.time);
        lines.push(("images", format!("{count} from {from:.4} s to {to:.4} s, {low} to {high} readings of the object each")));
        let readings = readings.iter().sum();
        content.frames = Some(Images { count, from, to, readings, readings_per_image: [low, high] });
    }
    content.clouds = clouds(r);
    if let Some(c) = &content.clouds {
        let [low, high] = c.points_per_cloud;
        let blind = if c.without_sight == 0 { String::new() } else { format!(", {} without lines of sight", c.without_sight) };
        let (from, to, noise) = (short(c.from), short(c.to), stated(c.noise));
        lines.push(("clouds", format!("{} from {from} s to {to} s, {low} to {high} points each, noise {noise}{blind}", c.count)));
    }
    if let Some(m) = &r.markers {
        let (from, to) = (m.samples.first().map_or(f64::NAN, |s| s.time), m.samples.last().map_or(f64::NAN, |s| s.time));
        lines.push((
            "markers",
            format!(
                "{} markers, {} readings from {} s to {} s, noise {}, {} with a rest place",
                m.names.len(),
                m.samples.len(),
                short(from),
                short(to),
                stated(m.noise_sigma),
                m.rest.len()
            ),
        ));
        content.markers = Some(Markers {
            names: m.names.clone(),
            readings: m.samples.len(),
            from: finite(from),
            to: finite(to),
            noise: m.noise_sigma,
            rest_places: m.rest.len(),
        });
    }
    let mut of_array = |label: &'static str, s: &Sequence, things: &str| {
        let found = sequence(s);
        let text = format!(
            "{} {things}, {} of {} readings seen in {} frames from {} s to {} s, noise {}",
            found.count,
            found.readings,
            found.readings + found.unseen,
            found.frames,
            short(found.from),
            short(found.to),
            stated(s.noise_sigma)
        );
        lines.push((label, text));
        found
    };
    content.points = r.points.as_ref().map(|p| of_array("tracked points", &p.track, "points"));
    content.displacements = r.displacements.as_ref().map(|d| of_array("displacements", &d.track, "nodes"));
    (content, lines)
}

/// What the point clouds hold.
fn clouds(r: &Recording) -> Option<Clouds> {
    let points: Vec<usize> = r.clouds.iter().map(|c| c.points.len()).collect();
    let (first, last) = (r.clouds.first()?, r.clouds.last()?);
    Some(Clouds {
        count: points.len(),
        without_sight: r.clouds.iter().filter(|c| c.from == SeenFrom::Unknown).count(),
        from: first.time,
        to: last.time,
        points: points.iter().sum(),
        points_per_cloud: extremes(&points),
        noise: first.noise_sigma,
    })
}

/// What an array holds.
fn sequence(s: &Sequence) -> SequenceInspection {
    let (count, readings) = (s.count(), s.readings());
    SequenceInspection {
        count,
        frames: s.times.len(),
        readings,
        unseen: s.vectors.len() - readings,
        from: s.times.first().copied().unwrap_or_default(),
        to: s.times.last().copied().unwrap_or_default(),
        noise: s.noise_sigma,
    }
}
