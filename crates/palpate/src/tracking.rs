//! Tracking as people ask for it: a scene with a recording in, the moving body out.

mod refine;

pub use refine::{Refined, Round, RoundValue, refine};

use crate::embed::Embedding;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use glam::DVec3;
use palpate_cpu::Tracker;
use palpate_engine::number;
use palpate_engine::tracking::{self, Doubt, Met, Settings, Tracked};
use palpate_io::recording::{RecordedPoints, Recording, Sequence};
use palpate_model::shape::spread;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Draws of the posterior: a standard deviation from so many is known to 1/√(2·32·3), a fourteenth.
const DRAWS: usize = 32;
/// Share of the readings that meet the body in a frame, over the median of all frames, below which it is doubted.
const FEW: f64 = 0.7;
/// Points of the body that become a recording: fewer tell less, more repeat what the prior says of their neighbours.
const POINTS: (usize, usize) = (12, 200);
/// A point counts as measured where readings have taken away this share of the prior's variance.
const MEASURED: f64 = 0.5;

/// A frame of the tracked body.
#[derive(Clone, Debug)]
pub struct TrackedFrame {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Displacement of every node [m] `[N]`.
    pub displacement: Vec<DVec3>,
    /// Velocity of every node [m/s] `[N]`.
    pub velocity: Vec<DVec3>,
    /// Places of the surface [m] `[V]`.
    pub surface: Vec<DVec3>,
    /// Standard deviation of one coordinate of each [m] `[V]`; NaN where the body is too large to say.
    pub deviation: Vec<f64>,
    /// Whether a reading lies on the line of sight of each `[V]`.
    pub seen: Vec<bool>,
    /// Share of the prior's variance that readings took away, of every node `[N]`.
    pub data: Vec<f64>,
    /// How well the readings are met.
    pub met: Met,
    /// η [J].
    pub temperature: f64,
    /// Number of directions that the readings determine.
    pub determined: f64,
    /// Steps of Gauss–Newton's method.
    pub steps: usize,
    /// True where the first phase, without correspondences, was needed.
    pub cold: bool,
    /// What is wrong with it.
    pub doubts: Vec<Doubt>,
}

/// A tracked body.
#[derive(Clone, Debug)]
pub struct TrackedBody {
    /// The surface at rest, carried by the nodes.
    pub surface: Embedding,
    /// Its triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Frames by rising time.
    pub frames: Vec<TrackedFrame>,
    /// True where somebody stopped it before the last one.
    pub interrupted: bool,
    /// Frames of the recording.
    pub recorded: usize,
    /// True where the prior is a step from the frame before.
    pub dynamic: bool,
    /// The finest noise of the readings [m].
    pub noise: f64,
}

/// Root mean square of one coordinate.
fn deviation<'a>(draws: impl Iterator<Item = &'a DVec3>) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for v in draws {
        sum += v.length_squared();
        count += 3;
    }
    (sum / count as f64).sqrt()
}

/// Of every place the number of the nearest patch at rest.
fn nearest_patches(experiment: &Experiment, places: &[DVec3]) -> Vec<usize> {
    use rayon::prelude::*;
    let patches = &experiment.plan().body.patches;
    let nearest = |p: &DVec3| {
        (0..patches.len())
            .min_by(|a, b| (patches[*a].point - *p).length_squared().total_cmp(&(patches[*b].point - *p).length_squared()))
    };
    places.par_iter().map(|p| nearest(p).unwrap_or(0)).collect()
}

/// Tracks the body through all frames of the experiment's recording; `progress` hears the number of frames that are done and may end it.
///
/// # Errors
/// [`Error::Scene`] without a recording, [`Error::Simulation`] where a solve fails.
pub fn track(experiment: &Experiment, progress: impl FnMut(usize) -> ControlFlow<()>) -> Result<TrackedBody, Error> {
    track_on(experiment, Backend::Cpu, progress)
}

/// The same with a backend that says which readings belong to which part of the surface; the body is moved on the CPU.
///
/// # Errors
/// As [`track`], or [`Error::Device`] where the device cannot be had.
pub fn track_on(
    experiment: &Experiment,
    backend: Backend,
    mut progress: impl FnMut(usize) -> ControlFlow<()>,
) -> Result<TrackedBody, Error> {
    let plan = experiment.plan();
    let frames: Vec<(usize, f64)> = plan.observation.frames.iter().enumerate().map(|(k, f)| (k, f.time)).collect();
    if frames.is_empty() {
        return Err(experiment.fault("observation", "names no recording: there is nothing to track"));
    }
    let held = !plan.clamps.is_empty();
    let wish = &experiment.scene().tracking;
    let dynamic = wish.dynamic.unwrap_or(!held || frames.len() > 1);
    if !dynamic && !held {
        return Err(experiment.fault("track.prior", "\"elastic\" needs a clamp: nothing else holds the body in its equilibrium"));
    }
    let mut body = Tracker::with(plan, backend.correspondence()?);
    let settings = Settings {
        dynamic,
        temperature: wish.temperature,
        outliers: wish.outliers,
        spread: wish.spread,
        widest: plan.band,
        spacing: body.spacing(),
        noise: noise(experiment),
        size: plan.body.size(),
    };
    let mut random = ChaCha8Rng::seed_from_u64(experiment.scene().fit.as_ref().map_or(1, |f| f.seed));
    let n = plan.body.nodes.len();
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let draws: Vec<Vec<DVec3>> = (0..DRAWS).map(|_| (0..n).map(|_| DVec3::new(normal(), normal(), normal())).collect()).collect();
    let (surface, triangles) = experiment.surface(0.5 * plan.body.length);
    let patches = nearest_patches(experiment, &surface.rest);
    let mut done = Vec::new();
    let mut interrupted = false;
    let visit = |t: Tracked| {
        done.push(frame(&surface, &patches, t));
        let flow = progress(done.len());
        interrupted = flow.is_break() && done.len() < frames.len();
        flow
    };
    tracking::track(&mut body, &settings, &frames, experiment.start_time(), &draws, visit)?;
    doubt_the_sparse(&mut done);
    Ok(TrackedBody { surface, triangles, frames: done, interrupted, recorded: frames.len(), dynamic, noise: settings.noise })
}

/// The finest noise of an experiment's readings [m].
fn noise(experiment: &Experiment) -> f64 {
    experiment.plan().observation.channels.iter().map(|c| c.noise).fold(f64::INFINITY, f64::min)
}

fn frame(surface: &Embedding, patches: &[usize], t: Tracked) -> TrackedFrame {
    let c = &t.certainty;
    let carried: Vec<Vec<DVec3>> = c.posterior.iter().map(|d| surface.carry(d).collect()).collect();
    let data = |i: usize| {
        let variance = |draws: &[Vec<DVec3>]| draws.iter().map(|d| d[i].length_squared()).sum::<f64>();
        let prior = variance(&c.prior);
        if prior > 0.0 { (1.0 - variance(&c.posterior) / prior).clamp(0.0, 1.0) } else { 0.0 }
    };
    TrackedFrame {
        time: t.time,
        surface: surface.deform(&t.pose.displacement),
        deviation: (0..surface.rest.len()).map(|v| deviation(carried.iter().map(|d| &d[v]))).collect(),
        seen: patches.iter().map(|p| t.seen.get(*p).copied().unwrap_or(false)).collect(),
        data: (0..t.pose.displacement.len()).map(data).collect(),
        displacement: t.pose.displacement,
        velocity: t.pose.velocity,
        met: t.met,
        temperature: t.temperature,
        determined: c.determined,
        steps: t.steps,
        cold: t.cold,
        doubts: t.doubts,
    }
}

/// The middle of those that are finite; `None` of none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut all: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

/// Frames with far fewer matched readings than the others.
fn doubt_the_sparse(frames: &mut [TrackedFrame]) {
    let shares = frames.iter().filter(|f| f.met.readings > 0).map(|f| f.met.share());
    let Some(median) = median(shares) else { return };
    for f in frames.iter_mut().filter(|f| f.met.readings > 0 && f.met.share() < FEW * median) {
        f.doubts.push(Doubt::Unmatched(f.met.share()));
    }
}

impl TrackedBody {
    /// Frames that nothing is wrong with.
    pub fn sound(&self) -> usize {
        self.frames.iter().filter(|f| f.doubts.is_empty()).count()
    }

    /// A recording of points of the surface, for a fit: as many as the readings determine directions, three to a point. Points that no reading
    /// tells of, and whole frames that something is wrong with, are left out.
    ///
    /// # Errors
    /// [`Error::Input`] where nothing is left.
    pub fn recording(&self, title: &str, noise: f64) -> Result<Recording, Error> {
        let sound: Vec<&TrackedFrame> = self.frames.iter().filter(|f| f.doubts.is_empty()).collect();
        let mean = sound.iter().map(|f| f.determined).sum::<f64>() / sound.len().max(1) as f64;
        let mut chosen = spread(&self.surface.rest, 0, ((mean / 3.0).ceil() as usize).clamp(POINTS.0, POINTS.1));
        chosen.sort_unstable();
        let (mut squares, mut count) = (0.0, 0usize);
        let mut vectors = Vec::new();
        for f in &sound {
            for v in &chosen {
                let place = self.surface.places.get(*v);
                let data: f64 = place.nodes.iter().zip(place.value).map(|(n, w)| w * f.data[*n as usize]).sum();
                let known = f.seen[*v] && data >= MEASURED;
                vectors.push(if known { f.surface[*v] } else { DVec3::NAN });
                if known {
                    squares += f.deviation[*v].powi(2);
                    count += 1;
                }
            }
        }
        if count == 0 {
            let first = self.frames.iter().find_map(|f| f.doubts.first().map(|d| (f.time, crate::report::words(d))));
            let why = match first {
                Some((time, words)) if sound.is_empty() => {
                    format!("all {} frames are doubted, that at {} s because {words}", self.frames.len(), number(time))
                }
                _ => format!("in {} frames that nobody doubts no reading tells of a place", sound.len()),
            };
            return Err(Error::Input(format!("no frame was tracked well enough to be fitted: {why}")));
        }
        let track = Sequence {
            file: PathBuf::from("points.npz"),
            times: sound.iter().map(|f| f.time).collect(),
            vectors,
            noise_sigma: Some((squares / count as f64).sqrt().max(1e-3 * noise)),
            noise_systematic: 0.0,
        };
        Ok(Recording {
            path: PathBuf::from("recording.toml"),
            title: format!("Tracked: {title}"),
            source: "tracked by palpate".into(),
            cameras: Vec::new(),
            frames: Vec::new(),
            clouds: Vec::new(),
            markers: None,
            points: Some(RecordedPoints { track, rest: chosen.iter().map(|v| self.surface.rest[*v]).collect(), tolerance: None }),
            displacements: None,
            warnings: Vec::new(),
        })
    }
}
