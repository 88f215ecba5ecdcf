//! Recordings of a simulation, as a depth camera or a motion-capture system would have made them.

use crate::embed::Embedding;
use crate::engine::{Backend, between};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::render::{Pinhole, Sensor, rasterise};
use glam::DVec3;
use palpate_engine::Snapshot;
use palpate_io::recording::{DepthImage, MarkerSample, RecordedCamera, RecordedFrame, RecordedMarkers, Recording};
use palpate_model::observation::MarkerRest;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::path::PathBuf;

/// Smallest noise stated for markers [m]: a cost divides by it, and optical systems do not resolve less.
const LEAST_MARKER_NOISE: f64 = 1e-6;

/// What watches the simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Observers {
    /// Depth cameras.
    pub cameras: Vec<Pinhole>,
    /// Points of the rest surface [m] that are tracked, with their labels.
    pub markers: Vec<(String, DVec3)>,
    /// Times of the frames on the recording's clock [s], increasing.
    pub times: Vec<f64>,
    /// Imperfections of the depth cameras; its noise [m] is also that of every marker coordinate, its dropout the share of
    /// marker readings that are missing.
    pub sensor: Sensor,
}

/// Simulates an experiment with its own values and records it. Depth images without a single pixel of the body are left out.
/// `progress` hears the share of the simulation that is done. The same seed gives the same recording.
///
/// # Errors
/// [`Error::Input`] when a time is not simulated or nothing is ever seen, [`Error::Failed`] when the simulation fails.
pub fn observe(
    experiment: &Experiment,
    backend: Backend,
    observers: &Observers,
    mut progress: impl FnMut(f64) -> std::ops::ControlFlow<()>,
) -> Result<Recording, Error> {
    let plan = experiment.plan();
    let (start, end) = (experiment.scene().time.start, experiment.end_time());
    let is_static = plan.clock.steps == 0;
    // A time on the last step must not fail by rounding.
    let slack = 1e-9 * (1.0 + end.abs());
    if let Some(t) = observers.times.iter().find(|t| !is_static && !(start - slack..=end + slack).contains(*t)) {
        return Err(Error::Input(format!("{t} s is not simulated: the scene runs from {start} s to {end} s")));
    }
    let (surface, triangles) = experiment.surface(0.25 * plan.body.grid.h);
    let tracked = Embedding::new(&plan.body, observers.markers.iter().map(|m| m.1).collect());
    let mut waiting = observers.times.iter().copied().enumerate().peekable();
    let mut last: Option<Snapshot> = None;
    let (mut frames, mut samples) = (Vec::new(), Vec::new());
    let steps = plan.clock.steps.max(1) as f64;
    let mut stopped = false;
    backend.visit(plan, &plan.theta, |k, state, _| {
        while let Some((number, time)) = waiting.next_if(|(_, t)| is_static || t - start <= state.time + slack) {
            let u = last.as_ref().map_or_else(|| state.displacement.clone(), |a| between(a, &state, time - start));
            frames.extend(images(observers, number, time, &surface.deform(&u), &triangles));
            samples.extend(marker_samples(observers, number, time, &tracked.deform(&u)));
        }
        last = Some(state);
        let flow = progress(k as f64 / steps);
        stopped = flow.is_break();
        flow
    })?;
    if stopped {
        return Err(Error::Interrupted);
    }
    for (i, c) in observers.cameras.iter().enumerate() {
        if !frames.iter().any(|f| f.camera == i) {
            return Err(Error::Input(format!("camera \"{}\" never sees the body; check eye, target and fov", c.name)));
        }
    }
    Ok(Recording {
        path: PathBuf::from("recording.toml"),
        title: format!("Synthetic: {}", experiment.scene().title),
        source: "Simulated by palpate".into(),
        cameras: observers.cameras.iter().map(|c| recorded_camera(c, &observers.sensor)).collect(),
        frames,
        markers: (!observers.markers.is_empty()).then(|| recorded_markers(observers, samples)),
        warnings: Vec::new(),
    })
}

fn images(observers: &Observers, number: usize, time: f64, vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<RecordedFrame> {
    let one = |camera: usize| {
        let exact = rasterise(&observers.cameras[camera], vertices, triangles);
        if exact.covered() == 0 {
            return None;
        }
        // Every image has its own random numbers; frames × cameras never meet.
        let image_number = (number * observers.cameras.len() + camera) as u64;
        let r = observers.sensor.read(&exact, image_number);
        let depth = DepthImage { width: r.width, height: r.height, counts: r.counts };
        Some(RecordedFrame { camera, time, depth: Some(depth), mask: Some(r.mask) })
    };
    (0..observers.cameras.len()).into_par_iter().filter_map(one).collect()
}

fn marker_samples(observers: &Observers, number: usize, time: f64, positions: &[DVec3]) -> Vec<MarkerSample> {
    let mut rng = ChaCha8Rng::seed_from_u64(observers.sensor.seed);
    // Far from the streams of images, which count from 0.
    rng.set_stream(u64::MAX - number as u64);
    let mut samples = Vec::new();
    for (marker, p) in positions.iter().enumerate() {
        let gauss: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
        let seen = rand::RngExt::random::<f64>(&mut rng) >= observers.sensor.dropout;
        if seen {
            samples.push(MarkerSample { time, marker, position: *p + DVec3::from_array(gauss) * observers.sensor.noise });
        }
    }
    samples
}

fn recorded_camera(c: &Pinhole, sensor: &Sensor) -> RecordedCamera {
    RecordedCamera {
        name: c.name.clone(),
        width: c.width,
        height: c.height,
        focal: [c.fx, c.fy],
        center: [c.cx, c.cy],
        distortion: [0.0; 5],
        world_from_camera: c.world_from_camera,
        depth_scale: Some(sensor.depth_scale),
        depth_offset: 0.0,
        // Rounding to counts adds the variance of a uniform error.
        noise_sigma: Some((sensor.noise.powi(2) + sensor.depth_scale.powi(2) / 12.0).sqrt()),
        noise_systematic: 0.0,
    }
}

fn recorded_markers(observers: &Observers, samples: Vec<MarkerSample>) -> RecordedMarkers {
    let rest = observers.markers.iter().map(|(name, p)| MarkerRest { name: name.clone(), position: *p, surface: Some(*p) });
    RecordedMarkers {
        file: PathBuf::from("markers.csv"),
        names: observers.markers.iter().map(|m| m.0.clone()).collect(),
        samples,
        noise_sigma: Some(observers.sensor.noise.max(LEAST_MARKER_NOISE)),
        noise_systematic: 0.0,
        rest: rest.collect(),
    }
}
