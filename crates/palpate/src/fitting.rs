//! From experiments to a fit: free parameters, shared or not, batches, and the residual before and after.

use crate::engine::{Backend, most_threads, with_threads};
use crate::error::Error;
use crate::events::Stage;
use crate::experiment::Experiment;
pub(crate) use crate::fingerprint::{FNV_START, fingerprint, fnv1a};
use crate::grid::{GridCheck, grid_check};
use crate::interrupt::Interrupt;
use crate::memory::Demand;
use crate::residuals::ResidualSummary;
use crate::results::fit::{FitStatus, FoundNormal, Verdict};
use crate::scatter::Excess;
use palpate_engine::{FailureKind, MOST_SENSITIVITIES, Stop};
use palpate_fit::{ErrorModel, FitResult, FitScene, FreeParameter, Hooks, JournalFile, Problem, Progress, Settings, Tolerance};
use palpate_io::InputError;
use palpate_io::recording::Recording;
use palpate_model::observation::ReadingKind;
use palpate_model::plan::Plan;
use palpate_model::plan::join::Joint;
use palpate_model::scene::{FitSpec, Optimizer};
use std::path::PathBuf;

mod answer;
mod common_scale;
mod counted;
mod free;
mod held_out;
mod lead;
mod normals;
mod verdict;
mod warm;

/// Standard errors from the optimum up to which what finer cells do is asked.
const ARRIVED: f64 = 1.0;

/// Standard deviations from what is known beforehand beyond which chance (one in 370) is no explanation.
const SURPRISING: f64 = 3.0;

pub use answer::{Headline, Parts};
use counted::Counted;
pub use free::FreeNumber;
pub(crate) use free::free_parameters;
pub use held_out::{Distances, HeldOut};
pub(crate) use verdict::held_whole;
use verdict::verdict;
pub use warm::FromTracks;

/// How to run a fit; what is `None` is taken from the (first) scene's `[fit]` table.
#[derive(Default)]
pub struct FitOptions<'a> {
    /// What computes the physics.
    pub backend: Backend,
    /// Optimiser.
    pub optimizer: Option<Optimizer>,
    /// Most iterations per start.
    pub iterations: Option<usize>,
    /// Number of starts.
    pub starts: Option<usize>,
    /// Most simulations at once; else as many starts as fit into memory.
    pub batch: Option<usize>,
    /// Seed of the starts.
    pub seed: Option<u64>,
    /// Decrease of the cost in an iteration, relative to the cost, at which a fit has arrived.
    pub tolerance: Option<f64>,
    /// Threads; 0 = one per core.
    pub threads: Option<usize>,
    /// Stops the fit in good order.
    pub interrupt: Interrupt,
    /// Once asked to stop nothing more is simulated, also where a report would lack it: who hurries has no use for a report of the fit.
    pub hurried: bool,
    /// Journal of evaluations, and whether to go on with what it holds.
    pub journal: Option<(PathBuf, bool)>,
    /// Tracked points of each scene, from which start values follow; none = as the scenes' `fit.warm_start` says.
    pub tracked: Vec<Recording>,
    /// Hears in words what is done before the search.
    pub on_stage: Option<&'a mut (dyn FnMut(&str) + Send)>,
    /// Hears of every iteration of every start.
    pub on_iteration: Option<&'a mut (dyn FnMut(&Progress) + Send)>,
}

/// A finished (or interrupted) fit.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Name of the backend used.
    pub backend: &'static str,
    /// The free numbers, in the order of `result.parameters`.
    pub free: Vec<FreeNumber>,
    /// The free fields of many values, in the order of `result.fields`.
    pub fields: Vec<FreeNumber>,
    /// What was chosen for this fit and why, in sentences: the optimiser, where it is not the usual one and nobody named it, and start values
    /// that were not stated.
    pub notes: Vec<String>,
    /// Normals of planes of which an angle was free.
    pub normals: Vec<FoundNormal>,
    /// What a fit of tracked points found, by free number; empty where nothing was tracked.
    pub tracked: Vec<FromTracks>,
    /// θ of every scene at the first start.
    pub theta_start: Vec<Vec<f64>>,
    /// Optimiser used.
    pub optimizer: Optimizer,
    /// What the fit found.
    pub result: FitResult,
    /// Every iteration of every start, by start and iteration.
    pub history: Vec<Progress>,
    /// Residuals at the first start, scene by scene; `None` where it cannot be computed.
    pub before: Vec<Option<ResidualSummary>>,
    /// Residuals at the best point, scene by scene; the CPU's where the device fails.
    pub after: Vec<ResidualSummary>,
    /// What it makes of frames that it did not see, where the scenes keep some from it.
    pub held_out: Option<HeldOut>,
    /// True when the fit was stopped before its end.
    pub interrupted: bool,
    /// What cells and time step do to each number, where that was looked at ([`Fitted::check_grid`]).
    pub grid: Option<GridCheck>,
    /// What it is worth, in a word and its reasons.
    pub verdict: Verdict,
    /// What deserves attention: from the files, from the fit, from the residuals.
    pub warnings: Vec<String>,
}

/// Several scenes as one: root mean square over all points.
pub(crate) fn total(parts: &[ResidualSummary], value: impl Fn(&ResidualSummary) -> f64) -> f64 {
    let n: usize = parts.iter().map(|r| r.points).sum();
    let squares: f64 = parts.iter().filter(|r| r.points > 0).map(|r| value(r).powi(2) * r.points as f64).sum();
    (squares / n as f64).sqrt()
}

impl Fitted {
    /// Values of a scene's free numbers by their path in its file.
    pub fn values_of(&self, scene: usize, experiment: &Experiment) -> Vec<(String, f64)> {
        let own = |n: &FreeNumber| n.scene.is_none_or(|s| s == scene);
        let named = |n: &FreeNumber| specs(experiment).is_some_and(|f| f.parameters.iter().any(|p| p.path == n.path));
        let all = self.free.iter().zip(&self.result.parameters);
        all.filter(|(n, _)| own(n) && named(n)).map(|(n, p)| (n.path.clone(), p.value)).collect()
    }

    /// Looks at what cells and time step do to the numbers found ([`GridCheck`]): one evaluation on finer ones, and one on coarser ones
    /// where that moves a number by more than noise does. A check that cannot be made is a warning, one that is stopped an interruption.
    pub fn check_grid(&mut self, experiments: &[Experiment], backend: Backend, interrupt: &Interrupt) {
        if self.status() != FitStatus::Complete {
            return;
        }
        if self.free.is_empty() {
            if !self.result.fields.is_empty() {
                self.warnings.push("± of a field holds noise and prior; what cells and step do is not in it".into());
            }
            return;
        }
        if self.result.distance > ARRIVED {
            // The way that is left to the optimum of these cells would count as theirs.
            self.warnings.push("± does not hold what cells and step do: the search did not converge".into());
            return;
        }
        match grid_check(experiments, self, backend, interrupt) {
            Ok(check) => self.grid = Some(check),
            Err(Error::Interrupted) => self.interrupted = true,
            // The fit stands without it.
            Err(e) => self.warnings.push(format!("± does not hold what cells and step do: no grid check ({e})")),
        }
        self.verdict = verdict(self, experiments);
    }

    /// How the fit ended.
    pub fn status(&self) -> FitStatus {
        match (&self.result.broken, self.interrupted) {
            (Some(_), _) => FitStatus::BrokenOff,
            (None, true) => FitStatus::Interrupted,
            (None, false) => FitStatus::Complete,
        }
    }

    /// Root mean square distance [m] and what noise alone would leave [m], over all scenes; and the number of points.
    pub fn residual(&self) -> (f64, f64, usize) {
        let points = self.after.iter().map(|r| r.points).sum();
        (total(&self.after, |r| r.rms), total(&self.after, |r| r.noise), points)
    }
}

fn specs(experiment: &Experiment) -> Option<&FitSpec> {
    experiment.scene().fit.as_ref()
}

/// Refuses experiments that name nothing to be found or have nothing to compare with.
pub(crate) fn check(experiments: &[Experiment]) -> Result<(), Error> {
    for e in experiments {
        let file = &e.scene().path;
        if specs(e).is_none_or(|f| f.parameters.is_empty()) {
            let message =
                "is missing; name at least one number to be found, like [[fit.parameter]] path = \"material.youngs_modulus\"";
            return Err(Error::scene(file, "fit.parameter", message));
        }
        if e.plan().observation.residuals() == 0 {
            return Err(Error::scene(file, "observation", "is missing or has no data to fit to; name a recording"));
        }
    }
    Ok(())
}

/// Fits the free parameters of one or several experiments. A path named free in several scenes is shared by them unless it says
/// `per_scene = true`; where it is shared, start and bounds must agree.
///
/// # Errors
/// [`Error::Scene`] when there is nothing to fit or nothing to compare with, or when scenes contradict each other;
/// [`Error::Fit`] when no start can be computed. A device that fails later leaves the best so far, with the reason in
/// [`FitResult::broken`].
pub fn fit(experiments: &[Experiment], mut options: FitOptions) -> Result<Fitted, Error> {
    let _stage = Stage::begin("fit");
    let _span = tracing::info_span!("fit", scenes = experiments.len()).entered();
    let first = experiments.first().ok_or_else(|| Error::Input("no scene is given".into()))?;
    check(experiments)?;
    let spec = specs(first).expect("every scene was just found to have a [fit]");
    let stated = Tolerance::default();
    let settings = Settings {
        iterations: options.iterations.unwrap_or(spec.iterations),
        starts: options.starts.unwrap_or(spec.starts),
        seed: options.seed.unwrap_or(spec.seed),
        errors: errors(experiments),
        tolerance: Tolerance { cost: options.tolerance.unwrap_or(stated.cost), ..stated },
        ..Settings::new(Optimizer::GaussNewton)
    };
    let (numbers, mut free, mut warnings) = free_parameters(experiments)?;
    let warm = warm::warm(experiments, &numbers, &mut free, &mut options)?;
    let asked = options.optimizer.or(spec.optimizer);
    let plans: Vec<&Plan> = experiments.iter().map(Experiment::plan).collect();
    let trial = demand(&free, 0, asked.unwrap_or_else(|| usual(&free)), settings.starts);
    // Recordings of the first body run side by side.
    let trial = Demand { starts: trial.starts * plans.iter().filter(|p| p.is_like(plans[0])).count(), ..trial };
    let backend = options.backend.resolve_for(first.plan(), &trial, &mut |_| {}).0;
    let (optimizer, chosen) = optimizer(asked, &free).map_err(|e| Error::scene(&first.scene().path, "fit.optimizer", e))?;
    let settings = Settings { optimizer, ..settings };
    let threads = options.threads.unwrap_or(spec.threads);
    if threads > most_threads() {
        warnings.push(format!("{threads} threads are more than this machine has a use for; {} are started", most_threads()));
    }
    let threads = threads.min(most_threads());
    let members = |joint: &Joint| {
        let demand = demand(&free, joint.parts[0].0, settings.optimizer, settings.starts);
        let demand = Demand { asked: options.batch, starts: demand.starts * joint.parts.len(), ..demand };
        backend.members(&joint.plan, &demand, threads)
    };
    let inner = backend.evaluators_until(&plans, members, &options.interrupt.at_once())?;
    let mut scenes = Vec::new();
    for (e, inner) in experiments.iter().zip(inner) {
        scenes.push(FitScene {
            name: e.scene().path.display().to_string(),
            fingerprint: fingerprint(e.plan()),
            base: e.plan().theta.clone(),
            evaluate: Box::new(Counted { inner, interrupt: options.interrupt.clone(), first: scenes.is_empty() }),
        });
    }
    let mut guide =
        lead::Guide { experiments, free: &free, backend, settings: &settings, interrupt: &options.interrupt, notes: Vec::new() };
    let mut problem = Problem::new(scenes, free.clone()).map_err(|e| InputError::file(&first.scene().path, e))?;
    let interrupt = options.interrupt.clone();
    let hurried = options.hurried;
    let stop = if hurried { interrupt.at_once() } else { Stop::default() };
    let mut history = Vec::new();
    let journal = options.journal.take().map(|(path, resume)| JournalFile { path, resume });
    let mut told = options.on_iteration.take();
    type Done = (FitResult, Vec<Vec<f64>>, Vec<Option<ResidualSummary>>, Vec<ResidualSummary>, Vec<String>);
    let done: Result<Done, Error> = with_threads(threads, || {
        let mut hear = |p: &Progress| {
            history.push(p.clone());
            if let Some(f) = &mut told {
                f(p);
            }
        };
        let mut notes = Vec::new();
        let mut after: Vec<ResidualSummary> = Vec::new();
        let mut fault = None;
        let mut worth = |theta: &[Vec<f64>]| {
            let at = |(e, theta): (&Experiment, &Vec<f64>)| residuals_at(e, backend, theta, &stop, &mut notes);
            match experiments.iter().zip(theta).map(at).collect() {
                // Only where it ends counts: a search for priors asks on its way as well.
                Ok(all) => (after, fault) = (all, None),
                Err(Error::Simulation(f)) if f.kind == FailureKind::Stopped => {}
                Err(e) => fault = Some(e),
            }
            let mut excess = Excess::default();
            after.iter().for_each(|r| excess.add(r.excess));
            excess.design_effect()
        };
        let mut lead = |starts: &[Vec<f64>]| guide.lead(starts);
        let hooks = Hooks {
            on_iteration: Some(&mut hear),
            interrupt: interrupt.in_turn(),
            journal,
            design_effect: Some(&mut worth),
            lead: Some(&mut lead),
        };
        let result = palpate_fit::fit(&mut problem, &settings, hooks)?;
        notes.append(&mut guide.notes);
        if let Some(e) = fault {
            return Err(e);
        }
        let theta_before: Vec<Vec<f64>> = (0..experiments.len()).map(|s| problem.theta(s, &result.runs[0].start)).collect();
        // What the fit held on a device is free for what follows.
        drop(problem);
        // Whoever stops does not want to wait for what is only compared with.
        let before =
            |(e, t): (&Experiment, &Vec<f64>)| if hurried || interrupt.is_urgent() { None } else { e.residuals(backend, t).ok() };
        let before = experiments.iter().zip(&theta_before).map(before).collect();
        Ok((result, theta_before, before, after, notes))
    })?;
    let (result, theta_start, before, after, notes) = done?;
    let (fields, free): (Vec<FreeNumber>, Vec<FreeNumber>) =
        numbers.into_iter().partition(|n| result.fields.iter().any(|f| f.path == n.label()));
    let cut = interrupt.is_urgent();
    history.sort_by_key(|p| (p.start, p.iteration));
    warnings.extend(experiments.iter().flat_map(|e| e.warnings().iter().cloned()));
    let blind = result.runs[result.best].status == palpate_fit::Status::Blind;
    // Who saw nothing has no errors either.
    warnings.extend(result.warnings.iter().filter(|w| !(blind && w.starts_with("no standard errors"))).cloned().chain(notes));
    let held_out = match cut {
        true => None,
        false => held_out::held_out(experiments, &result.theta, &after, backend).unwrap_or_else(|e| {
            warnings.push(format!("the frames that the fit did not see were not compared: {e}"));
            None
        }),
    };
    warnings.extend(common_scale::warnings(experiments, &theta_start, backend));
    let interrupted = cut || result.runs.iter().any(|r| r.status == palpate_fit::Status::Interrupted);
    let fitted = Fitted {
        backend: backend.name(),
        normals: normals::found(experiments, &free, &result),
        free,
        fields,
        notes: chosen.into_iter().chain(warm.notes).collect(),
        tracked: warm.tracked,
        theta_start,
        optimizer: settings.optimizer,
        result,
        history,
        before,
        after,
        held_out,
        interrupted,
        grid: None,
        verdict: Verdict::default(),
        warnings,
    };
    let mut fitted = with_residual_warnings(fitted);
    fitted.verdict = verdict(&fitted, experiments);
    Ok(fitted)
}

/// Residuals at θ; the CPU's where the device fails, so that a result is not lost with it.
pub(crate) fn residuals_at(
    e: &Experiment,
    backend: Backend,
    theta: &[f64],
    stop: &Stop,
    notes: &mut Vec<String>,
) -> Result<ResidualSummary, Error> {
    match ResidualSummary::new(e, backend, theta, stop) {
        Err(why) if backend == Backend::Gpu && !stop.is_over() => {
            notes.push(format!("the residuals of the result were computed on the CPU: {why}"));
            ResidualSummary::new(e, Backend::Cpu, theta, stop)
        }
        done => done,
    }
}

fn with_residual_warnings(mut fitted: Fitted) -> Fitted {
    let points = fitted.residual().2;
    let unmatched: usize = fitted.after.iter().map(|r| r.unmatched).sum();
    // Of the larger part the verdict speaks.
    let blind = fitted.result.runs[fitted.result.best].status == palpate_fit::Status::Blind;
    if unmatched * 20 > points + unmatched && unmatched <= points && !blind {
        fitted.warnings.push(format!(
            "{unmatched} of {} observed points met no part of the simulated body; is something else in the images, or is the band too narrow?",
            points + unmatched
        ));
    }
    for (n, p) in fitted.free.iter().zip(&fitted.result.parameters) {
        let Some((value, sd)) = p.known.filter(|(value, sd)| (p.value - value).abs() > SURPRISING * sd) else { continue };
        fitted.warnings.push(format!(
            "{}: {} is {:.1} standard deviations from the {} ± {} that it is known to be: something in the model is missing or wrong, or \
             what is known",
            n.label(),
            palpate_engine::number(p.value),
            (p.value - value).abs() / sd,
            palpate_engine::number(value),
            palpate_engine::number(sd)
        ));
    }
    fitted
}

/// The optimiser where nobody names one: with more values than sensitivities are computed of, one that does without them; the same for fields with
/// priors, whose precision makes products few.
pub(crate) fn usual(free: &[FreeParameter]) -> Optimizer {
    let many = values(free) > MOST_SENSITIVITIES || free.iter().any(|f| f.prior.is_some());
    if many { Optimizer::GaussNewtonCg } else { Optimizer::GaussNewton }
}

fn values(free: &[FreeParameter]) -> usize {
    free.iter().map(|f| f.count).sum()
}

/// The optimiser of a fit and, where it was not asked for and is not Gauss–Newton, why.
fn optimizer(asked: Option<Optimizer>, free: &[FreeParameter]) -> Result<(Optimizer, Option<String>), String> {
    let count = values(free);
    match asked {
        Some(Optimizer::GaussNewton) if count > MOST_SENSITIVITIES => Err(format!(
            "\"gauss-newton\" computes sensitivities by {MOST_SENSITIVITIES} values at most, {count} are free; choose \"gauss-newton-cg\" or \"lbfgs\""
        )),
        Some(asked) => Ok((asked, None)),
        None => {
            let usual = usual(free);
            let why = || match count > MOST_SENSITIVITIES {
                false => format!("optimizer {}: a field has a prior", usual.name()),
                true => format!(
                    "optimizer {}: {count} values are free, sensitivities are computed of {MOST_SENSITIVITIES} at most",
                    usual.name()
                ),
            };
            Ok((usual, (usual != Optimizer::GaussNewton).then(why)))
        }
    }
}

/// What the recordings say of errors that do not average out. Every camera, and every marker, has its own; tracked points share one.
pub(crate) fn errors(experiments: &[Experiment]) -> ErrorModel {
    let mut model = ErrorModel { groups: 0, ..ErrorModel::default() };
    for e in experiments {
        let o = &e.plan().observation;
        // The kind of data with the most residuals decides how many independent errors there are.
        let residuals = |kind: &ReadingKind| kind.components() * o.readings(*kind);
        let Some(kind) = ReadingKind::ALL.into_iter().rev().max_by_key(residuals) else { continue };
        model.systematic = model.systematic.max(o.systematic(kind) / o.noise(kind));
        model.groups += o.sensors(kind);
    }
    ErrorModel { groups: model.groups.max(1), ..model }
}

/// What a fit asks of a scene's backend. Starts that are fixed are all the same, and one is run.
pub(crate) fn demand(free: &[FreeParameter], scene: usize, optimizer: Optimizer, starts: usize) -> Demand {
    let slots = free.iter().flat_map(|f| f.slots.iter().map(move |s| (f, s))).filter(|(_, s)| s.scene == scene);
    let mut places: Vec<usize> = slots.flat_map(|(f, s)| s.place..s.place + f.count).collect();
    places.sort_unstable();
    let fixed = free.iter().all(|f| f.start.0 == f.start.1);
    Demand { starts: if fixed { 1 } else { starts.max(1) }, asked: None, optimizer, places, compared: true }
}
