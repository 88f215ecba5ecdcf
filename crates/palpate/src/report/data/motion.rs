//! One motion, simulated once, and all that a report shows of it.

use super::body::Body;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::residuals::{FrameResidual, spread, visit_frames};
use crate::results::report::{Floats, ShownMotion};
use glam::DVec3;
use palpate_engine::{FrameResiduals, Misfit, Stop};
use palpate_model::observation::{ReadingKind, Sensor};
use std::collections::BTreeMap;

/// Most depth points of a frame that is shown.
const MOST_POINTS: usize = 2000;
/// Most other readings of a frame that is shown.
const MOST_OTHERS: usize = 600;
/// Most residuals of a kind that are counted in a histogram.
const MOST_SAMPLES: usize = 200_000;
/// Most places of a profile.
const MOST_PLACES: usize = 4000;

/// What of a scene is shown, the same of both motions.
pub struct Plot {
    /// The surface.
    pub body: Body,
    /// Numbers of the frames that are shown in space.
    pub shown: Vec<usize>,
    /// What is followed over time: sensors and items.
    pub followed: Vec<(Sensor, u32)>,
    /// Every so many residuals of a kind are counted.
    every: [usize; 4],
}

impl Plot {
    /// What of a scene is shown in so many single-precision numbers, and at most so many frames.
    pub fn new(e: &Experiment, share: usize, most: usize) -> Plot {
        let observation = &e.plan().observation;
        let body = Body::new(e);
        let largest = |limit: usize, count: &dyn Fn(&palpate_model::observation::Frame) -> usize| {
            observation.frames.iter().map(count).max().unwrap_or(0).min(limit)
        };
        let points = largest(MOST_POINTS, &|f| f.points.len());
        let others = largest(MOST_OTHERS, &|f| f.markers.len() + f.displacements.len());
        // Vertices with their residual, points with theirs, and two places of all else, of two motions.
        let one = 2 * (4 * body.surface.rest.len() + 4 * points + 6 * others);
        let followed = super::tracks::followed(e);
        let curves = followed.len() * 9 * observation.frames.len().min(super::tracks::MOST_FRAMES);
        let room = (share.saturating_sub(curves) / one.max(1)).clamp(1, most);
        let all: Vec<usize> = (0..observation.frames.len()).filter(|f| observation.frames[*f].residuals() > 0).collect();
        let every = ReadingKind::ALL.map(|k| (observation.readings(k) * k.components()).div_ceil(MOST_SAMPLES).max(1));
        Plot { body, shown: spread(&all, room), followed, every }
    }
}

/// A motion beside what was measured.
pub struct Motion {
    /// Root mean square distance frame by frame [m].
    pub rms: Vec<f64>,
    /// The frames that are shown.
    pub shown: Vec<ShownMotion>,
    /// Residuals by kind [m]: signed distances, coordinates of vectors.
    pub samples: BTreeMap<ReadingKind, Vec<f64>>,
    /// Of everything followed, frame by frame: measured and simulated place [m].
    pub tracks: Vec<BTreeMap<usize, (DVec3, DVec3)>>,
    /// Measured places of a single frame, and residuals there [m].
    pub along: Vec<(DVec3, f64)>,
    /// True where these are signed distances.
    pub signed: bool,
}

impl Motion {
    /// Simulates a scene with parameters θ `[P]`.
    ///
    /// # Errors
    /// It cannot be simulated, or was stopped.
    pub fn new(e: &Experiment, theta: &[f64], backend: Backend, plot: &Plot, stop: &Stop) -> Result<Motion, Error> {
        let plan = e.plan();
        let frames = &plan.observation.frames;
        let mut out = Motion {
            rms: vec![f64::NAN; frames.len()],
            shown: vec![ShownMotion::default(); plot.shown.len()],
            samples: BTreeMap::new(),
            tracks: vec![BTreeMap::new(); plot.followed.len()],
            along: Vec::new(),
            signed: frames.iter().any(|f| !f.points.is_empty()),
        };
        visit_frames(plan, backend, theta, stop, |frame, displacement, r| {
            out.rms[frame] = FrameResidual::new(frames[frame].time, r).rms;
            out.count(plot, r);
            out.follow(plot, frame, r);
            if frames.len() == 1 {
                out.place(r);
            }
            if let Ok(k) = plot.shown.binary_search(&frame) {
                out.shown[k] = show(&plot.body, &plot.body.surface.deform(&displacement()), r);
            }
        })?;
        Ok(out)
    }

    fn count(&mut self, plot: &Plot, r: &FrameResiduals) {
        for (kind, every) in ReadingKind::ALL.into_iter().zip(plot.every) {
            let all = r.readings.iter().filter(|r| r.sensor.kind() == kind).filter_map(|r| r.misfit);
            let scalars = all.flat_map(|m| m.components().map(|c| c.1).collect::<Vec<_>>());
            let mut some = scalars.step_by(every).peekable();
            if some.peek().is_some() {
                self.samples.entry(kind).or_default().extend(some);
            }
        }
    }

    fn follow(&mut self, plot: &Plot, frame: usize, r: &FrameResiduals) {
        for (reading, offset) in r.offsets() {
            if let Ok(k) = plot.followed.binary_search(&(reading.sensor, reading.item)) {
                self.tracks[k].insert(frame, (reading.place, reading.place + offset));
            }
        }
    }

    fn place(&mut self, r: &FrameResiduals) {
        let signed = self.signed;
        let value = |m: Misfit| match m {
            Misfit::Distance(d) => signed.then_some(d),
            Misfit::Offset(v) => (!signed).then(|| v.length()),
        };
        let all: Vec<(DVec3, f64)> = r.readings.iter().filter_map(|r| Some((r.place, value(r.misfit?)?))).collect();
        self.along = all.iter().copied().step_by(all.len().div_ceil(MOST_PLACES).max(1)).collect();
    }
}

/// A frame in space.
fn show(body: &Body, vertices: &[DVec3], r: &FrameResiduals) -> ShownMotion {
    let depth: Vec<(DVec3, Option<f64>)> =
        r.readings.iter().filter(|r| r.sensor.is_depth()).map(|r| r.place).zip(r.distances()).collect();
    let depth: Vec<_> = depth.iter().copied().step_by(depth.len().div_ceil(MOST_POINTS).max(1)).collect();
    let others: Vec<(DVec3, DVec3)> = r.offsets().map(|(r, offset)| (r.place, r.place + offset)).collect();
    let others: Vec<_> = others.iter().copied().step_by(others.len().div_ceil(MOST_OTHERS).max(1)).collect();
    let met: Vec<(DVec3, f64)> = depth.iter().filter_map(|(p, d)| Some((*p, (*d)?))).collect();
    ShownMotion {
        vertices: Floats::of_vectors(vertices),
        residual: if met.is_empty() { Floats::default() } else { Floats::of(body.spread(vertices, &met)) },
        points: Floats::of_vectors(depth.iter().map(|p| &p.0)),
        distances: Floats::of(depth.iter().map(|p| p.1)),
        measured: Floats::of_vectors(others.iter().map(|p| &p.0)),
        simulated: Floats::of_vectors(others.iter().map(|p| &p.1)),
    }
}
