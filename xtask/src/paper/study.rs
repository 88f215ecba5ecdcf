//! One synthetic experiment: simulate, record, forget, fit.

use palpate::render::{Pinhole, Sensor};
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Error, Experiment};
use palpate_fit::{FitResult, FitScene, FreeParameter, Hooks, Problem, Settings, Slot, fit};
use palpate_io::recording::Recording;
use palpate_model::observation::ReadingKind;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{ObservationSpec, Optimizer, Scene};

/// Metres per count of a depth image: far below every noise studied, and 65535 counts reach past every scene.
const DEPTH_SCALE: f64 = 2e-5;

/// How a scene is watched.
#[derive(Clone, Debug)]
pub struct Watch {
    /// Depth cameras.
    pub cameras: Vec<Pinhole>,
    /// Noise of a reading [m].
    pub noise: f64,
    /// Every so-th step of the scene is a frame.
    pub every: usize,
    /// Cells and time steps of the simulation that is recorded are divided by this.
    pub refine: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Records the true scene.
///
/// # Errors
/// The scene cannot be built or simulated.
pub fn record(truth: &Scene, watch: &Watch) -> Result<Recording, Error> {
    let scene = Scene { observation: None, ..truth.clone() };
    let experiment = Experiment::new(scene, String::new(), Vec::new())?;
    let experiment = if watch.refine == 1.0 { experiment } else { experiment.refined(watch.refine)? };
    let t = &truth.time;
    let observers = Observers {
        cameras: watch.cameras.clone(),
        markers: Vec::new(),
        points: Vec::new(),
        displacements: false,
        times: (1..=t.steps).filter(|k| k.is_multiple_of(watch.every)).map(|k| t.start + k as f64 * t.step).collect(),
        sensor: Sensor { noise: watch.noise, dropout: 0.0, depth_scale: DEPTH_SCALE, seed: watch.seed },
    };
    observe(&experiment, Backend::Auto, &observers, |_| std::ops::ControlFlow::Continue(()))
}

/// Plan of a scene compared with a recording in a band of `band` cells.
///
/// # Errors
/// The recording does not fit the scene.
pub fn plan(scene: &Scene, recording: &Recording, band: f64) -> Result<Plan, Error> {
    let spec = ObservationSpec { band, ..ObservationSpec::new("recording", vec![ReadingKind::Depth]) };
    let (observation, rest) = recording.observation(&spec, &mut Vec::new()).map_err(|e| Error::Input(e.to_string()))?;
    let scene = Scene { observation: Some(spec), ..scene.clone() };
    build_plan(&scene, observation, &rest).map_err(|e| Error::Input(e.to_string()))
}

/// A parameter to find again: its key, and where starts are drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknown {
    /// Which one.
    pub key: ParamKey,
    /// Range of the starts (log-uniform for positive parameters).
    pub start: (f64, f64),
}

impl Unknown {
    /// A positive parameter with starts within a factor of its value in the plan.
    pub fn within(plan: &Plan, key: ParamKey, factor: f64) -> Unknown {
        let v = plan.theta[plan.layout.index(key)];
        Unknown { key, start: (v / factor, v * factor) }
    }
}

/// How the unknowns are searched.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// Optimiser.
    pub optimizer: Optimizer,
    /// Most iterations of a start.
    pub iterations: usize,
    /// Number of starts.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
}

/// The fit as the product does it, on a plan. The scene's own values of the unknowns are replaced by the lower ends of the start
/// ranges, so that no start knows the truth.
///
/// # Errors
/// No start can be evaluated.
pub fn search(plan: &Plan, unknowns: &[Unknown], how: &Search) -> Result<FitResult, Error> {
    search_on(Backend::Auto, plan, unknowns, how)
}

/// The same on a given backend.
///
/// # Errors
/// As [`search`], or the backend cannot be had.
pub fn search_on(backend: Backend, plan: &Plan, unknowns: &[Unknown], how: &Search) -> Result<FitResult, Error> {
    let place = |u: &Unknown| plan.layout.index(u.key);
    let free = unknowns
        .iter()
        .map(|u| {
            let spec = u.key.spec();
            FreeParameter {
                path: spec.path,
                unit: spec.unit.into(),
                transform: spec.transform,
                typical: spec.typical,
                bounds: (spec.lower, spec.upper),
                start: u.start,
                known: None,
                prior: None,
                count: 1,
                direction: u.key.direction(),
                slots: vec![Slot { scene: 0, place: place(u), factor: 1.0 }],
            }
        })
        .collect();
    let mut base = plan.theta.clone();
    unknowns.iter().for_each(|u| base[place(u)] = u.start.0);
    let scene = FitScene {
        name: "study".into(),
        fingerprint: String::new(),
        base,
        evaluate: backend.evaluator(plan, how.starts.max(1))?,
    };
    let mut problem = Problem::new(vec![scene], free).map_err(Error::Input)?;
    let settings = Settings { iterations: how.iterations, starts: how.starts, seed: how.seed, ..Settings::new(how.optimizer) };
    let result = fit(&mut problem, &settings, Hooks::default()).map_err(|e| Error::Failed(e.to_string()))?;
    match result.broken {
        Some(why) => Err(Error::Failed(why)),
        None => Ok(result),
    }
}

/// Relative errors of one unknown over the starts of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovery {
    /// Truth.
    pub truth: f64,
    /// Number of starts.
    pub starts: usize,
    /// Starts that ended within 5 % of the truth.
    pub converged: usize,
    /// Mean relative error of the converged starts.
    pub mean_error: f64,
    /// Signed relative error of the best start.
    pub best_error: f64,
    /// Largest minus smallest end over the truth, among converged starts.
    pub spread: f64,
    /// Median number of evaluations of a start.
    pub evaluations: usize,
}

/// What counts as converged: the paper's plots separate at about this relative error.
pub const CONVERGED: f64 = 0.05;

impl Recovery {
    /// Compares the ends of all starts with the truth for unknown number `i`.
    pub fn of(result: &FitResult, i: usize, truth: f64) -> Recovery {
        let error = |v: f64| v / truth - 1.0;
        let ends: Vec<f64> = result.runs.iter().map(|r| r.end.get(i).map_or(f64::INFINITY, |v| error(*v))).collect();
        let good: Vec<f64> = ends.iter().copied().filter(|e| e.abs() <= CONVERGED).collect();
        let mut evaluations: Vec<usize> = result.runs.iter().map(|r| r.evaluations).collect();
        evaluations.sort_unstable();
        let (low, high) = good.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(*e), b.max(*e)));
        Recovery {
            truth,
            starts: ends.len(),
            converged: good.len(),
            mean_error: good.iter().map(|e| e.abs()).sum::<f64>() / good.len() as f64,
            best_error: error(result.parameters[i].value),
            spread: high - low,
            evaluations: evaluations[evaluations.len() / 2],
        }
    }
}
