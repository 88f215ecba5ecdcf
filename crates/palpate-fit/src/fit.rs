//! The fit itself: starts, the best of them, and what is known about it.

use crate::chart::AtBound;
use crate::dense::{box_step, dot};
use crate::journal::{Journal, JournalError, JournalFile};
use crate::multistart::{self, Begin};
use crate::optimise::{Sample, Status, Stop as Ending};
use crate::priors::choose::{Choice, Ended, choose};
use crate::priors::{self, FieldPosterior};
use crate::problem::{Problem, Want};
use crate::settings::{ErrorModel, Settings, Walk};
use crate::uncertainty::{self, Uncertainty};
use palpate_engine::{MOST_SENSITIVITIES, Stop};
use palpate_model::params::Transform;
use std::time::Instant;

/// Why a fit has no result.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// No start could be evaluated.
    #[error("the model could not be evaluated at any start: {0}")]
    NoStart(String),
    /// What computes broke before anything was evaluated.
    #[error("nothing was computed: {0}")]
    Broken(String),
    /// Interrupted before anything was evaluated.
    #[error("interrupted before the first evaluation")]
    Interrupted,
    /// The number of residuals changed from one evaluation to another.
    #[error("the number of residuals changed from {before} to {now}; was the recording changed since the journal was begun?")]
    Residuals {
        /// At the first evaluation.
        before: usize,
        /// At a later one.
        now: usize,
    },
    /// The journal cannot be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The operating system refused a thread, or one was lost.
    #[error("{0}")]
    Threads(String),
}

/// One iteration of one start.
#[derive(Clone, Debug, PartialEq)]
pub struct Progress {
    /// Number of the start.
    pub start: usize,
    /// Number of the iteration; 0 is the start itself.
    pub iteration: usize,
    /// Cost at its end.
    pub cost: f64,
    /// Values of the free parameters `[q]`.
    pub values: Vec<f64>,
}

/// From θ of every scene to how many residuals count as one independent reading.
pub type Worth<'a> = dyn FnMut(&[Vec<f64>]) -> f64 + 'a;

/// From the values `[q]` of starts that see nothing to those where each sees something; `None` where none were found.
pub type Lead<'a> = dyn FnMut(&[Vec<f64>]) -> Vec<Option<Vec<f64>>> + 'a;

/// What the caller hears and controls while a fit runs.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called for every iteration of every start, in the same order in every run.
    pub on_iteration: Option<&'a mut dyn FnMut(&Progress)>,
    /// Once it says so, every start stops before its next evaluation and keeps its best point; an evaluation that the physics itself
    /// cut short ([`palpate_engine::FailureKind::Stopped`]) ends its start alike.
    pub interrupt: Stop,
    /// Journal of evaluations, for resuming.
    pub journal: Option<JournalFile>,
    /// Told θ of every scene at the best point, says how many residuals count as one independent reading there; 1 without it.
    pub design_effect: Option<&'a mut Worth<'a>>,
    /// Leads starts from which nothing can be seen ([`Status::Blind`]) to where something can; without it they are searched from like others.
    pub lead: Option<&'a mut Lead<'a>>,
}

/// One start's search.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Values at the start `[q]`.
    pub start: Vec<f64>,
    /// Best values `[q]`.
    pub end: Vec<f64>,
    /// Cost at the start; infinite if it could not be evaluated.
    pub start_cost: f64,
    /// Best cost; infinite if nothing could be evaluated.
    pub cost: f64,
    /// Iterations done.
    pub iterations: usize,
    /// Evaluations used.
    pub evaluations: usize,
    /// Products with the Gauss–Newton matrix used.
    pub products: usize,
    /// How Gauss–Newton stood ([`Settings::walk`]).
    pub walk: Walk,
    /// By how much the curvature at its end promises to lower the cost further; 0 where none is known.
    pub promised: f64,
    /// How it ended.
    pub status: Status,
}

/// One found number.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedParameter {
    /// Path as the user wrote it.
    pub path: String,
    /// Its place among the free values `[q]`.
    pub index: usize,
    /// Best value.
    pub value: f64,
    /// Standard error in the same unit; `None` if it could not be computed.
    pub standard_error: Option<f64>,
    /// The part of it that averages out over residuals, without errors that those of a group share.
    pub noise: Option<f64>,
    /// SI unit, `1` for none.
    pub unit: String,
    /// Value and standard deviation that were known beforehand.
    pub known: Option<(f64, f64)>,
    /// How the fit saw it.
    pub transform: Transform,
    /// The bound that holds the value, if one does.
    pub at_bound: Option<AtBound>,
}

/// A found field.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedField {
    /// Path as the user wrote it.
    pub path: String,
    /// Place of its first value among the free values `[q]`.
    pub first: usize,
    /// Best values.
    pub values: Vec<f64>,
    /// Standard error of each; `None` at a bound or where it was not computed.
    pub standard_errors: Vec<Option<f64>>,
    /// What a prior and the recording say of it together.
    pub posterior: Option<FieldPosterior>,
    /// SI unit, `1` for none.
    pub unit: String,
}

/// What a fit found.
#[derive(Clone, Debug, PartialEq)]
pub struct FitResult {
    /// The free numbers at the best point.
    pub parameters: Vec<FittedParameter>,
    /// The free fields at the best point.
    pub fields: Vec<FittedField>,
    /// Correlation matrix of the numbers' errors (of the logarithms where these are fitted).
    pub correlation: Vec<Vec<f64>>,
    /// Mean square residual over the squared noise; 1 if the model is right and the noise as stated.
    pub reduced_chi_square: f64,
    /// How many independent readings the data are worth; NaN where the curvature was not computed.
    pub independent: f64,
    /// Number of the best start.
    pub best: usize,
    /// Distance of the best point from the optimum in standard errors, as far as the curvature there says; NaN where it was not computed.
    pub distance: f64,
    /// Cost of the first start; infinite if it could not be evaluated.
    pub initial_cost: f64,
    /// Cost of the best point.
    pub cost: f64,
    /// θ of every scene at the best point.
    pub theta: Vec<Vec<f64>>,
    /// Plain sentences on what the data do not determine and what went wrong.
    pub warnings: Vec<String>,
    /// Why the fit broke off before its end, where what computes failed; the rest is the best until then.
    pub broken: Option<String>,
    /// Every start, in order.
    pub runs: Vec<Run>,
    /// Evaluations of all starts.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Why a start could not be evaluated, or broke off.
fn reason(status: &Status) -> &str {
    match status {
        Status::Failed(why) | Status::Broken(why) => why,
        other => other.name(),
    }
}

/// Fits the free parameters of a problem.
///
/// # Errors
/// Nothing could be evaluated, or the journal cannot be used. A device that fails later ends the search, and its best so far is the
/// result, with the reason in [`FitResult::broken`].
pub fn fit(problem: &mut Problem, settings: &Settings, mut hooks: Hooks) -> Result<FitResult, FitError> {
    let clock = Instant::now();
    let mut journal = hooks.journal.as_ref().map(|place| Journal::open(place, problem, settings)).transpose()?;
    let mut choice = None;
    let starts = match problem.priors().is_empty() {
        true => multistart::run(problem, settings, &mut hooks, journal.as_mut(), None)?,
        false => match choose(problem, settings, &mut hooks, journal.as_mut())? {
            Ended::Cut(run) => vec![*run],
            Ended::Found(found) => {
                let first = Begin::given(found.values.clone(), found.evaluations, found.iterations);
                let mut starts = multistart::run(problem, settings, &mut hooks, journal.as_mut(), Some(first))?;
                found.add_to(problem, &mut starts[0]);
                choice = Some(found);
                starts
            }
        },
    };
    let runs: Vec<Run> = starts
        .iter()
        .map(|s| Run {
            start: problem.values(&s.start),
            end: problem.values(&s.outcome.z),
            start_cost: s.outcome.start_cost,
            cost: s.outcome.cost,
            iterations: s.outcome.iterations,
            evaluations: s.outcome.evaluations,
            products: s.outcome.products,
            walk: s.outcome.walk,
            promised: s.outcome.promised,
            status: s.outcome.status.clone(),
        })
        .collect();
    // The first of equally good starts, so that the choice does not depend on anything else.
    let best = (0..runs.len()).filter(|&s| runs[s].cost.is_finite()).min_by(|&a, &b| runs[a].cost.total_cmp(&runs[b].cost));
    let mut broken = runs.iter().find(|r| matches!(r.status, Status::Broken(_))).map(|r| reason(&r.status).to_string());
    let Some(best) = best else {
        if let Some(why) = broken {
            return Err(FitError::Broken(why));
        }
        let why = runs.iter().find_map(|r| if let Status::Failed(why) = &r.status { Some(why.clone()) } else { None });
        return Err(why.map_or(FitError::Interrupted, FitError::NoStart));
    };
    let values = runs[best].end.clone();
    let z = starts[best].outcome.z.clone();
    let cut = match &broken {
        Some(_) => Some("the fit broke off"),
        None => hooks.interrupt.is_over().then_some("the fit was interrupted"),
    };
    let theta: Vec<Vec<f64>> = (0..problem.scenes().len()).map(|s| problem.theta(s, &values)).collect();
    // Data whose errors go together say less; never more.
    let design_effect = hooks.design_effect.as_mut().map_or(1.0, |ask| ask(&theta)).max(1.0);
    let settings = &Settings { errors: ErrorModel { design_effect, ..settings.errors.clone() }, ..settings.clone() };
    let sample = starts[best].outcome.sample.as_ref();
    let (u, distance, extra, posteriors) = match problem.priors().is_empty() {
        true => {
            let (u, distance, extra) = curvature(problem, &z, sample, settings, cut, &mut broken);
            (u, distance, extra, Vec::new())
        }
        false => with_priors(problem, &z, (sample, choice.as_ref(), design_effect), cut, &hooks, &mut broken),
    };
    let mut warnings = u.warnings.clone();
    warnings.extend(uncertainty::compare_starts(problem, &starts, best, &u));
    let failed: Vec<usize> = (0..runs.len()).filter(|&s| runs[s].cost.is_infinite()).collect();
    if let Some(&first) = failed.first() {
        let why = reason(&runs[first].status);
        warnings.push(format!("{} of {} starts could not be evaluated (start {first}: {why})", failed.len(), runs.len()));
    }
    if settings.starts > runs.len() {
        warnings
            .push(format!("all {} starts would be the same, so one was run: give start ranges to draw from", settings.starts));
    }
    // Of a fit that was cut short, another start may still become the best.
    if cut.is_none() && runs[best].status == Status::IterationLimit {
        warnings.push(format!("the best start used up its {} iterations; more may lower the cost", settings.iterations));
    }
    let (parameters, fields) = found(problem, &values, &u, posteriors);
    let correlation = match u.correlation.is_empty() {
        true => uncertainty::identity(parameters.len()),
        false => parameters.iter().map(|a| parameters.iter().map(|b| u.correlation[a.index][b.index]).collect()).collect(),
    };
    Ok(FitResult {
        parameters,
        fields,
        correlation,
        reduced_chi_square: u.reduced_chi_square,
        independent: u.independent,
        best,
        theta,
        distance,
        initial_cost: runs[0].start_cost,
        cost: runs[best].cost,
        evaluations: runs.iter().map(|r| r.evaluations).sum::<usize>() + extra,
        warnings,
        broken,
        runs,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// The free numbers and fields at the best point.
fn found(
    problem: &Problem,
    values: &[f64],
    u: &Uncertainty,
    posteriors: Vec<FieldPosterior>,
) -> (Vec<FittedParameter>, Vec<FittedField>) {
    let (mut parameters, mut fields) = (Vec::new(), Vec::new());
    let mut posteriors = posteriors.into_iter();
    for (f, range) in problem.blocks() {
        let (path, unit, first) = (f.path.clone(), f.unit.clone(), range.start);
        if f.count == 1 {
            parameters.push(FittedParameter {
                path,
                index: first,
                value: values[first],
                standard_error: u.standard_errors[first],
                noise: u.noise_errors[first],
                unit,
                known: f.known,
                transform: f.transform,
                at_bound: problem.charts()[first].at_bound(values[first]),
            });
        } else {
            let standard_errors = u.standard_errors[range.clone()].to_vec();
            let posterior = f.prior.as_ref().and_then(|_| posteriors.next());
            fields.push(FittedField { path, first, values: values[range].to_vec(), standard_errors, posterior, unit });
        }
    }
    (parameters, fields)
}

/// Errors of a fit with priors of fields; see [`curvature`].
fn with_priors(
    problem: &mut Problem,
    z: &[f64],
    (sample, choice, design): (Option<&Sample>, Option<&Choice>, f64),
    cut: Option<&str>,
    hooks: &Hooks,
    broken: &mut Option<String>,
) -> (Uncertainty, f64, usize, Vec<FieldPosterior>) {
    let without = |problem: &Problem, why: &str| {
        let mut u = uncertainty::assess(problem, z, &Sample::default(), &ErrorModel::default());
        u.warnings.push(format!("no standard errors: {why}"));
        (u, f64::NAN, 0, Vec::new())
    };
    let (Some(sample), None) = (sample, cut) else { return without(problem, cut.unwrap_or("nothing was evaluated")) };
    let stop = hooks.interrupt.clone();
    let over = || stop.is_over();
    match priors::assess(problem, z, sample, choice, design, &over) {
        Ok(a) => (a.uncertainty, a.distance, 0, a.fields),
        Err(Ending::Interrupted) => without(problem, "the fit was interrupted"),
        Err(Ending::Broken(why)) => {
            *broken = Some(why.clone());
            without(problem, &why)
        }
    }
}

/// How far the optimum is, in standard errors, by a free step in the box.
fn distance(problem: &Problem, z: &[f64], sample: &Sample, settings: &Settings) -> f64 {
    let q = z.len();
    let diagonal = (0..q).fold(0.0, |m: f64, i| m.max(sample.curvature[i * q + i]));
    let mut h = sample.curvature.clone();
    (0..q).for_each(|i| h[i * q + i] += 1e-9 * diagonal);
    let range = |side: fn((f64, f64)) -> f64| -> Vec<f64> {
        let room = problem.charts().iter().zip(z).map(|(c, z)| side(c.range()) - z);
        room.map(|r| r.clamp(-settings.max_step, settings.max_step)).collect()
    };
    let (lower, upper) = (range(|r| r.0), range(|r| r.1));
    let Some(p) = box_step(&h, &sample.gradient, &lower, &upper) else { return f64::NAN };
    let hp = |i: usize| dot(&sample.curvature[i * q..(i + 1) * q], &p);
    let promised = -dot(&sample.gradient, &p) - 0.5 * (0..q).map(|i| p[i] * hp(i)).sum::<f64>();
    sample.decrement(q, promised)
}

/// Uncertainty and distance from the optimum at the best point, and how many evaluations that took. Nothing is computed for a fit that was `cut` short; a device
/// that fails here says so in `broken`.
fn curvature(
    problem: &mut Problem,
    z: &[f64],
    known: Option<&Sample>,
    settings: &Settings,
    cut: Option<&str>,
    broken: &mut Option<String>,
) -> (Uncertainty, f64, usize) {
    // A sample without curvature still tells of bounds.
    let without = |problem: &Problem, why: &str| {
        let mut u = uncertainty::assess(problem, z, &Sample::default(), &settings.errors);
        u.warnings.push(format!("no standard errors: {why}"));
        u
    };
    // Gauss–Newton has seen its best point's curvature.
    if let Some(sample) = known.filter(|s| s.curvature.len() == z.len() * z.len()) {
        let mut u = uncertainty::assess(problem, z, sample, &settings.errors);
        u.warnings.extend(cut.map(|why| format!("{why}: standard errors are those of the place that it had reached")));
        return (u, distance(problem, z, sample, settings), 0);
    }
    if let Some(why) = cut {
        return (without(problem, why), f64::NAN, 0);
    }
    if z.len() > MOST_SENSITIVITIES {
        let mut u =
            without(problem, &format!("{} values are free, and they are computed of {MOST_SENSITIVITIES} at most", z.len()));
        // Said first: nothing else is said of errors.
        u.warnings.rotate_right(1);
        return (u, f64::NAN, 0);
    }
    let sample = problem.evaluate(&[z.to_vec()], Want::Curvature).swap_remove(0);
    match &sample.failure {
        Some(why) => {
            *broken = sample.broken.then(|| why.clone());
            (without(problem, why), f64::NAN, 1)
        }
        None => (uncertainty::assess(problem, z, &sample, &settings.errors), distance(problem, z, &sample, settings), 1),
    }
}
