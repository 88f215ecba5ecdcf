//! Recordings of a simulation, as a depth camera or a motion-capture system would have made them.

use crate::embed::Embedding;
use crate::engine::{Backend, between};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::render::{self, Pinhole, Sensor, rasterise};
use glam::DVec3;
use palpate_engine::Snapshot;
use palpate_io::recording::{
    DepthImage, DepthPixels, MarkerSample, RecordedCamera, RecordedDisplacements, RecordedFrame, RecordedMarkers, RecordedPoints,
    Recording, Sequence,
};
use palpate_model::effects::check_choices;
use palpate_model::effects::sensors::Sensors;
use palpate_model::mechanics::rotation::Polar;
use palpate_model::observation::{Camera, MarkerRest, MarkerSite};
use palpate_model::plan::Plan;
use palpate_model::plan::build::marker_sites;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::path::PathBuf;

/// Smallest noise stated for markers [m]: a cost divides by it, and optical systems do not resolve less.
const LEAST_MARKER_NOISE: f64 = 1e-6;

/// Random numbers of points and of nodes count down from here, far from those of images and of markers.
const POINTS: u64 = u64::MAX / 2;
const NODES: u64 = u64::MAX / 4;

/// What watches the simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Observers {
    /// Depth cameras.
    pub cameras: Vec<Pinhole>,
    /// Points of the rest surface [m] that are tracked, with their labels.
    pub markers: Vec<(String, DVec3)>,
    /// Points of the body at rest [m] that are tracked by themselves.
    pub points: Vec<DVec3>,
    /// Whether the displacement of every simulation node is recorded.
    pub displacements: bool,
    /// Times of the frames on the recording's clock [s], increasing.
    pub times: Vec<f64>,
    /// Imperfections of the depth cameras; its noise [m] is also that of every coordinate of markers, points and
    /// displacements, its dropout the share of their readings that are missing.
    pub sensor: Sensor,
}

/// Simulates an experiment with its own values and records it. The scene's measurement effects act on the recording: cameras stand where
/// `observers` has them and the recording states them elsewhere, frames are taken at `observers.times` and stamped with others. Depth images
/// without a single pixel of the body are left out.
/// `progress` hears the share of the simulation that is done. The same seed gives the same recording.
///
/// # Errors
/// [`Error::Input`] when a time is not simulated or nothing is ever seen, [`Error::Simulation`] when that fails.
pub fn observe(
    experiment: &Experiment,
    backend: Backend,
    observers: &Observers,
    mut progress: impl FnMut(f64) -> std::ops::ControlFlow<()>,
) -> Result<Recording, Error> {
    let plan = experiment.plan();
    let (start, end) = (experiment.start_time(), experiment.end_time());
    let is_static = plan.clock.steps == 0;
    // A time on the last step must not fail by rounding.
    let slack = 1e-9 * (1.0 + end.abs());
    if let Some(t) = observers.times.iter().find(|t| !is_static && !(start - slack..=end + slack).contains(*t)) {
        return Err(Error::Input(format!("{t} s is not simulated: the scene runs from {start} s to {end} s")));
    }
    check_choices(&experiment.scene().effects, observers.cameras.len(), observers.markers.len())
        .map_err(|(key, message)| experiment.fault(&key, message))?;
    let errors = Errors::new(experiment, observers)?;
    let (surface, triangles) = experiment.surface(0.25 * plan.body.length);
    let tracked = Embedding::new(&plan.body, observers.markers.iter().map(|m| m.1).collect());
    let points = Embedding::new(&plan.body, observers.points.clone());
    let (mut tracked_points, mut displaced) = (Sequence::default(), Sequence::default());
    let mut waiting = observers.times.iter().copied().enumerate().peekable();
    let mut last: Option<Snapshot> = None;
    let (mut frames, mut samples) = (Vec::new(), Vec::new());
    let steps = plan.clock.steps.max(1) as f64;
    let mut stopped = false;
    backend.visit(plan, &plan.theta, |k, state, _| {
        while let Some((number, time)) = waiting.next_if(|(_, t)| is_static || t - start <= state.time + slack) {
            let u = last.as_ref().map_or_else(|| state.displacement.clone(), |a| between(a, &state, time - start));
            let stamp = time + errors.sensors.ahead();
            frames.extend(images(observers, &errors.sensors, (number, stamp), &surface.deform(&u), &triangles));
            samples.extend(marker_samples(observers, number, stamp, &errors.markers(tracked.deform(&u), &u)));
            if !observers.points.is_empty() {
                read_vectors(observers, POINTS - number as u64, stamp, points.deform(&u), &mut tracked_points);
            }
            if observers.displacements {
                read_vectors(observers, NODES - number as u64, stamp, u, &mut displaced);
            }
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
        cameras: (observers.cameras.iter().enumerate())
            .map(|(i, c)| RecordedCamera {
                world_from_camera: errors.sensors.stated_pose(i as u32, c.world_from_camera),
                ..recorded_camera(c, &observers.sensor)
            })
            .collect(),
        frames,
        clouds: Vec::new(),
        markers: (!observers.markers.is_empty()).then(|| recorded_markers(observers, samples)),
        points: (!observers.points.is_empty()).then(|| RecordedPoints {
            track: Sequence { file: PathBuf::from("points.npz"), ..tracked_points },
            rest: observers.points.clone(),
            tolerance: None,
        }),
        displacements: observers.displacements.then(|| RecordedDisplacements {
            track: Sequence { file: PathBuf::from("displacements.npz"), ..displaced },
            nodes: plan.body.nodes.clone(),
        }),
        warnings: Vec::new(),
    })
}

/// The scene's measurement effects.
struct Errors<'a> {
    plan: &'a Plan,
    sensors: Sensors,
    /// Attachments of markers; empty where none sits elsewhere than stated.
    sites: Vec<MarkerSite>,
}

impl Errors<'_> {
    fn new<'a>(experiment: &'a Experiment, observers: &Observers) -> Result<Errors<'a>, Error> {
        let plan = experiment.plan();
        let sensors = Sensors::new(&plan.layout, &plan.theta);
        let mut sites = Vec::new();
        if (0..observers.markers.len()).any(|m| sensors.marker_offset(m as u32) != DVec3::ZERO) {
            sites = marker_sites(&marker_rest(observers), &plan.body, experiment.shape())
                .map_err(|e| experiment.fault(&e.key, e.message))?;
        }
        Ok(Errors { plan, sensors, sites })
    }

    /// Moves markers from where they are stated to sit on the deformed body to where they do.
    fn markers(&self, mut positions: Vec<DVec3>, u: &[DVec3]) -> Vec<DVec3> {
        for ((number, site), p) in self.sites.iter().enumerate().zip(&mut positions) {
            let (_, f) = site.carry(|i| self.plan.body.nodes[i] + u[i]);
            *p += Polar::new(f).r * self.sensors.marker_offset(number as u32);
        }
        positions
    }
}

fn images(
    observers: &Observers,
    sensors: &Sensors,
    (number, time): (usize, f64),
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
) -> Vec<RecordedFrame> {
    let one = |camera: usize| {
        let pinhole = &observers.cameras[camera];
        let exact = read_depths(sensors, camera as u32, pinhole, vertices, triangles);
        if exact.covered() == 0 {
            return None;
        }
        // Every image has its own random numbers; frames × cameras never meet.
        let image_number = (number * observers.cameras.len() + camera) as u64;
        let r = observers.sensor.read(&exact, image_number);
        let depth = DepthImage { width: r.width, height: r.height, pixels: DepthPixels::Counts(r.counts) };
        Some(RecordedFrame { camera, time, depth: Some(depth), mask: Some(r.mask) })
    };
    (0..observers.cameras.len()).into_par_iter().filter_map(one).collect()
}

/// Depths that a camera with these errors, truly standing where `pinhole` says, reads of a surface (world points [m]), without noise.
pub(crate) fn read_depths(
    sensors: &Sensors,
    number: u32,
    pinhole: &Pinhole,
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
) -> render::DepthImage {
    let mut exact = rasterise(pinhole, vertices, triangles);
    if !sensors.exact_points() {
        let pose = pinhole.world_from_camera;
        let truly = Camera::Pinhole { center: pose.translation, axis: pose.matrix3.z_axis };
        let width = exact.width;
        for (i, z) in exact.depth.iter_mut().enumerate().filter(|(_, z)| z.is_finite()) {
            *z = sensors.read(&truly, number, pinhole.unproject((i % width) as f64, (i / width) as f64, *z));
        }
    }
    exact
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

/// Reads vectors at one time, with noise and gaps; `stream` numbers the random ones.
fn read_vectors(observers: &Observers, stream: u64, time: f64, vectors: Vec<DVec3>, out: &mut Sequence) {
    let mut rng = ChaCha8Rng::seed_from_u64(observers.sensor.seed);
    rng.set_stream(stream);
    out.times.push(time);
    out.noise_sigma = Some(observers.sensor.noise.max(LEAST_MARKER_NOISE));
    out.vectors.extend(vectors.into_iter().map(|v| {
        let gauss: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
        let seen = rand::RngExt::random::<f64>(&mut rng) >= observers.sensor.dropout;
        if seen { v + observers.sensor.noise * DVec3::from_array(gauss) } else { DVec3::NAN }
    }));
}

/// A camera as a recording of this sensor states it.
pub fn recorded_camera(c: &Pinhole, sensor: &Sensor) -> RecordedCamera {
    RecordedCamera {
        name: c.name.clone(),
        width: c.width,
        height: c.height,
        focal: [c.fx, c.fy],
        center: [c.cx, c.cy],
        distortion: [0.0; 8],
        world_from_camera: c.world_from_camera,
        depth_scale: Some(sensor.depth_scale),
        depth_offset: 0.0,
        // Rounding to counts adds the variance of a uniform error.
        noise_sigma: Some((sensor.noise.powi(2) + sensor.depth_scale.powi(2) / 12.0).sqrt()),
        noise_systematic: 0.0,
    }
}

fn recorded_markers(observers: &Observers, samples: Vec<MarkerSample>) -> RecordedMarkers {
    RecordedMarkers {
        file: PathBuf::from("markers.csv"),
        names: observers.markers.iter().map(|m| m.0.clone()).collect(),
        samples,
        noise_sigma: Some(observers.sensor.noise.max(LEAST_MARKER_NOISE)),
        noise_systematic: 0.0,
        rest: marker_rest(observers),
    }
}

/// Where the recording states the markers to sit.
fn marker_rest(observers: &Observers) -> Vec<MarkerRest> {
    observers.markers.iter().map(|(name, p)| MarkerRest { name: name.clone(), position: *p, surface: Some(*p) }).collect()
}
