//! The recordings' systematic errors as fields: what a marker that sits a standard deviation aside, or a camera whose zero point is off by
//! one, would change. The measuring effects `marker-offset` and `depth-bias` say it, so that their formulas exist once.

use super::hypothesis::{lab_error, prepare};
use super::lab::linearise;
use crate::experiment::Experiment;
use palpate_diagnose::{Change, Field, LabError};
use palpate_engine::Source;
use palpate_model::effects::{Effect, find};

/// A measuring effect with its choice (a marker, say) made.
fn effect(kind: &str, choice: Option<usize>) -> Option<Change> {
    let mut effect = Effect::absent(find(kind)?);
    if let (Some(first), Some(choice)) = (effect.values.first_mut(), choice) {
        *first = Some(choice as f64);
    }
    Some(Change::Effect(effect))
}

/// One field for every marker and axis, and for every camera, of every recording that states `noise_systematic`.
pub(super) fn systematic(base: &[Experiment], changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
    let sizes = |size: fn(&Experiment) -> f64| base.iter().map(size).collect::<Vec<_>>();
    let marker = sizes(|e| e.plan.observation.marker_systematic);
    let depth = sizes(|e| e.plan.observation.depth_systematic);
    let mut all = changes.to_vec();
    // The number of the first column of what was added, and what it is.
    let mut markers = 0;
    if marker.iter().any(|s| *s > 0.0) {
        markers = base.iter().map(|e| e.plan.observation.markers.len()).max().unwrap_or(0);
        all.extend((0..markers).filter_map(|m| effect("marker-offset", Some(m))));
    }
    let cameras = depth.iter().any(|s| *s > 0.0);
    if cameras {
        all.extend(effect("depth-bias", None));
    }
    if all.len() == changes.len() {
        return Ok(Vec::new());
    }
    let ready = prepare(base, &all).map_err(lab_error)?;
    let from = values.len();
    let mut at: Vec<f64> = values.to_vec();
    at.resize(ready.free.len(), 0.0);
    let readings = linearise(&ready, &at, from)?;
    let field = |name: &'static str, column: usize, size: f64, mine: &dyn Fn(usize, &Source) -> bool| Field {
        name,
        change: (readings.rows.iter().enumerate())
            .map(|(i, r)| {
                let d = size * readings.sensitivity[i * readings.columns + column];
                r.row.value?;
                Some(if mine(r.scene, &r.row.source) { d } else { 0.0 })
            })
            .collect(),
        rough: 0.0,
    };
    let mut out = Vec::new();
    for (scene, e) in base.iter().enumerate() {
        // A marker's error is a length, shared by three axes.
        for column in (0..3 * markers).filter(|_| marker[scene] > 0.0) {
            let size = marker[scene] / 3f64.sqrt();
            out.push(field("place of a marker", column, size, &|s, source| {
                s == scene && matches!(source, Source::Marker { .. })
            }));
        }
        for camera in (0..e.plan.observation.cameras.len()).filter(|_| cameras && depth[scene] > 0.0) {
            let mine = |s: usize, source: &Source| {
                s == scene && matches!(source, Source::Point { camera: c, .. } if *c as usize == camera)
            };
            out.push(field("zero point of a camera", 3 * markers, depth[scene], &mine));
        }
    }
    out.retain(|f| f.change.iter().flatten().any(|c| *c != 0.0));
    Ok(out)
}
