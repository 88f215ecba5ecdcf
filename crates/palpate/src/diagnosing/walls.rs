//! Planes that the measured body does not cross and the simulated one does: where something flat that the scene does not know would stand.

use super::hypothesis::{Prepared, lab_error, prepare};
use super::lab::linearise;
use crate::embed::Embedding;
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::residuals::visit_frames;
use glam::DVec3;
use palpate_diagnose::{LabError, Readings, Wall};
use palpate_engine::Source;

/// Directions that are looked into, evenly over the sphere.
const DIRECTIONS: usize = 200;
/// Places on the body's surface that are followed.
const PLACES: usize = 400;
/// So many of them, counted over all frames, may lie beyond a wall: readings are noisy.
const BEYOND: usize = 5;
/// Standard deviations of a reading by which the simulated body must go through.
const DEPTH: f64 = 3.0;
/// Planes that are returned at most, and the cosine between normals above which the deeper one stands for both.
const MOST: usize = 8;
const ALIKE: f64 = 0.9;

/// Walls around the recordings of all experiments, the one that the simulation crosses deepest first: with the values of the baseline, and with
/// those that its fit started from, for a body that something keeps up may have been made stiff enough to stay where it was seen.
pub(super) fn walls(base: &[Experiment]) -> Result<Vec<Wall>, LabError> {
    let ready = prepare(base, &[]).map_err(lab_error)?;
    let starts: Vec<f64> = ready.numbers().iter().map(|n| n.start).collect();
    let mut found = Vec::new();
    for values in [ready.own_values(), starts] {
        // A start that cannot be simulated shows nothing.
        found.extend(crossed(&ready, &values).unwrap_or_default());
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<Wall> = Vec::new();
    for (_, wall) in found {
        if out.len() < MOST && out.iter().all(|w| w.normal.dot(wall.normal) < ALIKE) {
            out.push(wall);
        }
    }
    Ok(out)
}

/// Walls that the simulation with these values crosses, and how deep [m].
fn crossed(ready: &Prepared, values: &[f64]) -> Result<Vec<(f64, Wall)>, LabError> {
    let readings = linearise(ready, values, ready.free.len())?;
    let shifts = shifts(ready, &readings);
    let noise = readings.rows.iter().map(|r| r.row.noise).fold(0.0, f64::max);
    let center = ready.experiments[0].plan.body.center;
    // Where the measured body is, and where the simulated one.
    let (mut measured, mut simulated) = (Vec::new(), Vec::new());
    for (scene, e) in ready.experiments.iter().enumerate() {
        let patches = &e.plan.body.patches;
        let places = patches.iter().step_by(patches.len().div_ceil(PLACES).max(1)).map(|p| p.point).collect();
        let surface = Embedding::new(&e.plan.body, places);
        visit_frames(&e.plan, Backend::Cpu, &ready.theta(scene, values), |frame, displacement, _| {
            for (rest, x) in surface.rest.iter().zip(surface.deform(&displacement())) {
                // What was measured nearest to a place says how it moved, also on the side that nobody sees.
                let near = |a: &&(DVec3, DVec3), b: &&(DVec3, DVec3)| {
                    a.0.distance_squared(*rest).total_cmp(&b.0.distance_squared(*rest))
                };
                if let Some((_, by)) = shifts[scene][frame].iter().min_by(near) {
                    simulated.push(x - center);
                    measured.push(x + by - center);
                }
            }
        })
        .map_err(lab_error)?;
    }
    if measured.len() <= BEYOND {
        return Ok(Vec::new());
    }
    let lowest = |points: &[DVec3], normal: DVec3| {
        let mut along: Vec<f64> = points.iter().map(|p| normal.dot(*p)).collect();
        *along.select_nth_unstable_by(BEYOND, f64::total_cmp).1
    };
    let wall = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
        let (s, c) = (i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt())).sin_cos();
        let normal = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
        let at = lowest(&measured, normal);
        (at - lowest(&simulated, normal), Wall { normal, distance: -at })
    };
    Ok((0..DIRECTIONS).map(wall).filter(|(depth, _)| *depth > DEPTH * noise).collect())
}

/// By scene and frame: rest place of every reading, and how far [m] the measured body is from the simulated one there.
fn shifts(ready: &Prepared, readings: &Readings) -> Vec<Vec<Vec<(DVec3, DVec3)>>> {
    let frames = |e: &Experiment| vec![Vec::new(); e.plan.observation.frames.len()];
    let mut out: Vec<Vec<Vec<(DVec3, DVec3)>>> = ready.experiments.iter().map(frames).collect();
    for (i, r) in readings.rows.iter().enumerate() {
        let value = |i: usize| readings.rows.get(i).and_then(|r| r.row.value);
        let Some(residual) = value(i) else { continue };
        let by = match r.row.source {
            Source::Point { .. } => residual * r.row.by_place / r.row.by_place.length_squared().max(f64::MIN_POSITIVE),
            // Its three coordinates follow each other.
            Source::Marker { axis: 0, .. } => -DVec3::from_array(std::array::from_fn(|a| value(i + a).unwrap_or(0.0))),
            Source::Marker { .. } | Source::Node { .. } => continue,
        };
        out[r.scene][r.row.frame].push((r.row.rest, by));
    }
    out
}
