//! How far a measurement lies from a simulation, and how far noise alone would put it.
//!
//! - `rms` is the root mean square *distance*: of every matched depth point to the simulated surface, and of every other
//!   reading to the simulated place (3-vector); points that met nothing are counted apart.
//! - `noise` is what would remain with the right model, `sqrt(measurement² + grid²)`, mean squares over the same points:
//!   - a depth reading's error runs along the camera's axis (a scanner's along its ray), so its distance to a surface seen at an angle is shortened by the cosine
//!     between axis and normal: `(σ² + systematic²) · mean cos²`, the mean taken from the simulated surface in the cameras;
//!   - a coordinate's σ counts three times, and the systematic error (a length) once: `3 σ² + systematic²`;
//!   - grid: root mean square of the band's interpolated distance at points of the true rest surface, where it should be 0.

use crate::embed::Embedding;
use crate::engine::{Backend, between};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::render::{DepthImage, rasterise};
use crate::scatter::{Excess, Scatter};
use crate::viewers::viewer;
use glam::DVec3;
use palpate_engine::{FrameResiduals, Misfit, Snapshot, Stop};
use palpate_model::cutcells::band_lookup::BandLookup;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{Observation, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use std::collections::BTreeMap;

/// Frames that the mean incidence angle is taken from; it varies slowly.
const INCIDENCE_FRAMES: usize = 12;

/// Residuals of a whole recording.
#[derive(Clone, Debug, PartialEq)]
pub struct ResidualSummary {
    /// Root mean square distance [m] over `points`; NaN without any.
    pub rms: f64,
    /// What measurement noise would leave, and the shape's rounding by the cells of the grid [m]; not what cells and time step change
    /// in the motion.
    pub noise: f64,
    /// Readings that met something.
    pub points: usize,
    /// Readings that met nothing: depth points without a cell around the body.
    pub unmatched: usize,
    /// Cost J of the simulation.
    pub cost: f64,
    /// How much more means of neighbouring residuals scatter than those of independent ones would.
    pub(crate) excess: Excess,
    /// Frame by frame, ordered by time.
    pub frames: Vec<FrameResidual>,
}

/// Residuals of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameResidual {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Root mean square distance [m]; NaN without matched points.
    pub rms: f64,
    /// Mean signed distance of matched depth points [m], positive outside the model; NaN without any.
    pub bias: f64,
    /// Readings that met something.
    pub points: usize,
    /// Readings that met nothing.
    pub unmatched: usize,
}

impl FrameResidual {
    /// Of the readings of a frame at this time [s].
    pub(crate) fn new(time: f64, r: &FrameResiduals) -> FrameResidual {
        let squares: f64 = ReadingKind::ALL.iter().map(|kind| of_kind(r, *kind).map(Misfit::length_squared).sum::<f64>()).sum();
        let points = r.readings.iter().filter(|r| r.misfit.is_some()).count();
        let distances: Vec<f64> = r.distances().flatten().collect();
        FrameResidual {
            time,
            rms: (squares / points as f64).sqrt(),
            bias: distances.iter().sum::<f64>() / distances.len() as f64,
            points,
            unmatched: r.readings.len() - points,
        }
    }
}

/// Residuals of a kind that met something.
fn of_kind(r: &FrameResiduals, kind: ReadingKind) -> impl Iterator<Item = Misfit> {
    r.readings.iter().filter(move |r| r.sensor.kind() == kind).filter_map(|r| r.misfit)
}

/// Mean square distance that errors of a kind's readings alone would leave [m²], with the mean shortening of depth readings.
fn mean_square(observation: &Observation, kind: ReadingKind, shortened: f64) -> f64 {
    let (noise, systematic) = (observation.noise(kind).powi(2), observation.systematic(kind).powi(2));
    match kind {
        ReadingKind::Depth => (noise + systematic) * shortened,
        _ => 3.0 * noise + systematic,
    }
}

impl ResidualSummary {
    /// Of a simulation with parameters θ `[P]`; an error where it was stopped.
    pub(crate) fn new(experiment: &Experiment, backend: Backend, theta: &[f64], stop: &Stop) -> Result<ResidualSummary, Error> {
        let plan = experiment.plan();
        let observation = &plan.observation;
        let with_points: Vec<usize> =
            (0..observation.frames.len()).filter(|f| !observation.frames[*f].points.is_empty()).collect();
        let wanted = spread(&with_points, INCIDENCE_FRAMES);
        let (surface, triangles) = experiment.surface(0.5 * plan.body.length);
        let mut frames = BTreeMap::new();
        let (mut cos2, mut seen) = (0.0, 0usize);
        let mut scatter = Scatter::default();
        let cost = visit_frames(plan, backend, theta, stop, |frame, displacement, r| {
            scatter.add(plan, r);
            frames.insert(frame, FrameResidual::new(observation.frames[frame].time, r));
            if wanted.contains(&frame) {
                let (sum, n) = incidence(experiment, frame, &surface.deform(&displacement()), &triangles);
                cos2 += sum;
                seen += n;
            }
        })?;
        let frames: Vec<FrameResidual> = frames.into_values().collect();
        let points = frames.iter().map(|f| f.points).sum::<usize>();
        let unmatched = frames.iter().map(|f| f.unmatched).sum();
        let squares: f64 = frames.iter().filter(|f| f.points > 0).map(|f| f.rms * f.rms * f.points as f64).sum();
        let shortened = if seen > 0 { cos2 / seen as f64 } else { 1.0 };
        let grid2 = grid_error(plan, &surface).powi(2);
        // Depth points that met something, and all other readings.
        let others = |kind: &ReadingKind| if *kind == ReadingKind::Depth { 0 } else { observation.readings(*kind) };
        let depths = points - ReadingKind::ALL.iter().map(others).sum::<usize>();
        let expected = |kind: &ReadingKind| match (kind, others(kind)) {
            (ReadingKind::Depth, _) if depths > 0 => depths as f64 * (mean_square(observation, *kind, shortened) + grid2),
            (_, 0) => 0.0,
            (_, n) => n as f64 * mean_square(observation, *kind, shortened),
        };
        Ok(ResidualSummary {
            rms: (squares / points as f64).sqrt(),
            noise: (ReadingKind::ALL.iter().map(expected).sum::<f64>() / points as f64).sqrt(),
            points,
            unmatched,
            cost,
            excess: scatter.excess(),
            frames,
        })
    }
}

/// Up to `count` of some numbers, evenly spread, first and last among them.
pub(crate) fn spread(numbers: &[usize], count: usize) -> Vec<usize> {
    if numbers.len() <= count {
        return numbers.to_vec();
    }
    if count <= 1 {
        return numbers.first().copied().into_iter().take(count).collect();
    }
    (0..count).map(|k| numbers[k * (numbers.len() - 1) / (count - 1)]).collect()
}

/// Simulates and hands every frame to `visit`: its number, the displacement at its time (computed when asked for) and its
/// residuals. Returns the cost; an error where it was stopped.
pub(crate) fn visit_frames(
    plan: &Plan,
    backend: Backend,
    theta: &[f64],
    stop: &Stop,
    mut visit: impl FnMut(usize, &dyn Fn() -> Vec<DVec3>, &FrameResiduals),
) -> Result<f64, Error> {
    let start = theta[plan.layout.index(ParamKey::TimeStart)] + Sensors::new(&plan.layout, theta).ahead();
    let mut last: Option<Snapshot> = None;
    let evaluation = backend.visit_until(plan, theta, stop.clone(), |_, state, residuals| {
        for r in &residuals {
            let time = plan.observation.frames[r.frame].time - start;
            let displacement = || last.as_ref().map_or_else(|| state.displacement.clone(), |a| between(a, &state, time));
            visit(r.frame, &displacement, r);
        }
        last = Some(state);
        std::ops::ControlFlow::Continue(())
    })?;
    Ok(evaluation.cost)
}

/// Sum and number of cos² between the direction of a reading's error and the surface's normal, over the observed points of a frame that fall on the
/// simulated surface. Errors run along a camera's axis, or along a scanner's ray; those of points without a line of sight are not shortened.
fn incidence(experiment: &Experiment, frame: usize, vertices: &[DVec3], triangles: &[[u32; 3]]) -> (f64, usize) {
    let o = &experiment.plan().observation;
    let points = &o.frames[frame].points;
    let bounds = vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let (mut sum, mut n) = (0.0, 0);
    for (number, seen_from) in o.cameras.iter().enumerate() {
        let mine: Vec<DVec3> = points.iter().filter(|p| p.camera as usize == number).map(|p| p.position).collect();
        if mine.is_empty() {
            continue;
        }
        let Some(camera) = viewer(experiment, number, bounds) else {
            sum += mine.len() as f64;
            n += mine.len();
            continue;
        };
        let image = rasterise(&camera, vertices, triangles);
        for p in mine {
            let q = camera.project(p);
            let (u, v) = (q.x.round(), q.y.round());
            if !(0.0..camera.width as f64).contains(&u) || !(0.0..camera.height as f64).contains(&v) {
                continue;
            }
            let t = image.triangle[v as usize * camera.width + u as usize];
            if t == DepthImage::NONE {
                continue;
            }
            let [a, b, c] = triangles[t as usize].map(|k| vertices[k as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            sum += normal.dot(DVec3::from_array(seen_from.sees(p).axis)).powi(2);
            n += 1;
        }
    }
    (sum, n)
}

/// Root mean square of the interpolated signed distance at the rest surface [m].
fn grid_error(plan: &Plan, surface: &Embedding) -> f64 {
    let lookup = BandLookup::of(&plan.body.band);
    let (mut sum, mut n) = (0.0, 0usize);
    for (distance, _) in surface.rest.iter().filter_map(|p| lookup.distance(&plan.body.band, *p)) {
        sum += distance.powi(2);
        n += 1;
    }
    if n == 0 { 0.0 } else { (sum / n as f64).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_engine::ReadingResidual;
    use palpate_model::observation::Sensor;

    #[test]
    fn a_spread_has_both_ends() {
        let all: Vec<usize> = (10..30).collect();
        assert_eq!(spread(&all, 3), [10, 19, 29]);
        assert_eq!((spread(&all[..2], 3), spread(&all, 1), spread(&all, 0)), (vec![10, 11], vec![10], vec![]));
    }

    #[test]
    fn a_frame_counts_distances_of_points_and_markers() {
        let reading = |sensor, item, misfit| ReadingResidual { sensor, item, place: DVec3::ZERO, misfit };
        let depth = |item, distance: Option<f64>| reading(Sensor::Camera(0), item, distance.map(Misfit::Distance));
        let marker = reading(Sensor::Marker(0), 0, Some(Misfit::Offset(DVec3::new(0.0, 0.002, 0.001))));
        let readings = vec![depth(0, Some(0.003)), depth(1, None), depth(2, Some(-0.001)), marker];
        let r = FrameResiduals { frame: 0, readings };
        let f = FrameResidual::new(0.5, &r);
        assert_eq!((f.points, f.unmatched), (3, 1));
        assert!((f.rms - (15e-6f64 / 3.0).sqrt()).abs() < 1e-15 && (f.bias - 0.001).abs() < 1e-15);
    }
}
