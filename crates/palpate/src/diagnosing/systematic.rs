//! The recordings' systematic errors as fields: what a marker that sits a standard deviation aside, or a camera whose zero point is off by
//! one, would change. The measuring effects `marker-offset` and `depth-bias` say it, so that their formulas exist once.

use super::hypothesis::{lab_error, prepare};
use super::limits::Limits;
use super::simulate::linearise;
use crate::experiment::Experiment;
use palpate_diagnose::{Change, Field, LabError, Reading};
use palpate_engine::Source;
use palpate_model::effects::{Effect, find};
use palpate_model::observation::{Camera, ReadingKind, Sensor};

/// A measuring effect with its choice (a marker, say) made.
fn effect(kind: &str, choice: Option<usize>) -> Option<Change> {
    let mut effect = Effect::absent(find(kind)?);
    if let (Some(first), Some(choice)) = (effect.values.first_mut(), choice) {
        *first = Some(choice as f64);
    }
    Some(Change::Effect(effect))
}

/// One field for every marker and axis, for every camera, and for every axis of tracked points and of clouds without lines of sight, of every recording that states `noise_systematic`.
pub(super) fn systematic(
    base: &[Experiment],
    changes: &[Change],
    values: &[f64],
    limits: &Limits,
) -> Result<Vec<Field>, LabError> {
    let sizes = |kind: ReadingKind| base.iter().map(|e| e.plan.observation.systematic(kind)).collect::<Vec<_>>();
    let [depth, marker, track] = [ReadingKind::Depth, ReadingKind::Marker, ReadingKind::Track].map(sizes);
    let mut all = changes.to_vec();
    // The number of the first column of what was added, and what it is.
    let mut markers = 0;
    if marker.iter().any(|s| *s > 0.0) {
        markers = base.iter().map(|e| e.plan.observation.marker_count()).max().unwrap_or(0);
        all.extend((0..markers).filter_map(|m| effect("marker-offset", Some(m))));
    }
    let cameras = depth.iter().any(|s| *s > 0.0);
    if cameras {
        all.extend(effect("depth-bias", None));
    }
    if all.len() == changes.len() && track.iter().all(|s| *s == 0.0) {
        return Ok(Vec::new());
    }
    let ready = prepare(base, &all).map_err(lab_error)?;
    let from = values.len();
    let mut at: Vec<f64> = values.to_vec();
    at.resize(ready.free.len(), 0.0);
    let readings = linearise(&ready, &at, from, limits)?;
    // What an error changes of every reading that is its sensor's.
    let field = |name: &'static str, mine: &dyn Fn(usize, &Source) -> bool, change: &dyn Fn(usize) -> f64| {
        let rows = readings.rows.iter().enumerate();
        let of = |(i, r): (usize, &Reading)| r.row.value.map(|_| if mine(r.scene, &r.row.source) { change(i) } else { 0.0 });
        Field::systematic(name, rows.map(of).collect())
    };
    let rows = &readings;
    let along = |column: usize, size: f64| move |i: usize| size * rows.sensitivity[i * rows.columns + column];
    let mut out = Vec::new();
    for (scene, e) in base.iter().enumerate() {
        // A marker's error is a length, shared by three axes.
        for column in (0..3 * markers).filter(|_| marker[scene] > 0.0) {
            let size = marker[scene] / 3f64.sqrt();
            let mine = |s: usize, source: &Source| s == scene && matches!(source.sensor, Sensor::Marker(_));
            out.push(field("place of a marker", &mine, &along(column, size)));
        }
        for camera in (0..e.plan.observation.cameras.len()).filter(|_| cameras && depth[scene] > 0.0) {
            let sensor = e.plan.observation.cameras[camera].sensor(camera as u32);
            let mine = |s: usize, source: &Source| s == scene && source.sensor == sensor;
            out.push(field("zero point of a camera", &mine, &along(3 * markers, depth[scene])));
        }
        // So do points of a cloud without lines of sight, whose zero point has no direction.
        let blind = |s: usize, source: &Source| {
            let camera = match source.sensor {
                Sensor::Cloud(c) => e.plan.observation.cameras.get(c as usize),
                _ => None,
            };
            s == scene && camera == Some(&Camera::Unknown)
        };
        for axis in (0..3).filter(|_| depth[scene] > 0.0) {
            let change = |i: usize| rows.rows[i].row.by_place[axis] * depth[scene] / 3f64.sqrt();
            out.push(field("origin of a cloud", &blind, &change));
        }
        // All tracked points share one error, a length along three axes.
        for axis in 0..3u8 {
            let mine = |s: usize, source: &Source| s == scene && source.sensor == Sensor::Tracks && source.axis == axis;
            out.push(field("origin of tracked points", &mine, &|_| track[scene] / 3f64.sqrt()));
        }
    }
    out.retain(|f| f.change.iter().flatten().any(|c| *c != 0.0));
    Ok(out)
}
