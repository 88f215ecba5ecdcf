//! The fit itself: starts, the best of them, and what is known about it.

use crate::journal::{Journal, JournalError, JournalFile};
use crate::multistart;
use crate::optimise::Status;
use crate::problem::Problem;
use crate::settings::Settings;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Why a fit has no result.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// No start could be evaluated.
    #[error("the model could not be evaluated at any start: {0}")]
    NoStart(String),
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

/// What the caller hears and controls while a fit runs.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called for every iteration of every start, in the same order in every run.
    pub on_iteration: Option<&'a mut dyn FnMut(&Progress)>,
    /// When set, every start stops before its next evaluation and keeps its best point.
    pub interrupt: Option<&'a AtomicBool>,
    /// Journal of evaluations, for resuming.
    pub journal: Option<JournalFile>,
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
    /// How it ended.
    pub status: Status,
}

/// What a fit found.
#[derive(Clone, Debug)]
pub struct FitResult {
    /// Best values `[q]`.
    pub values: Vec<f64>,
    /// Cost of the first start; infinite if it could not be evaluated.
    pub initial_cost: f64,
    /// Cost of the best point.
    pub cost: f64,
    /// θ of every scene at the best point.
    pub theta: Vec<Vec<f64>>,
    /// Every start, in order.
    pub runs: Vec<Run>,
    /// Evaluations of all starts.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Fits the free parameters of a problem.
pub fn fit(problem: &mut Problem, settings: &Settings, mut hooks: Hooks) -> Result<FitResult, FitError> {
    let clock = Instant::now();
    let journal = hooks.journal.as_ref().map(|place| Journal::open(place, problem, settings)).transpose()?;
    let starts = multistart::run(problem, settings, &mut hooks, journal)?;
    let runs: Vec<Run> = starts
        .iter()
        .map(|s| Run {
            start: problem.values(&s.start),
            end: problem.values(&s.outcome.z),
            start_cost: s.outcome.start_cost,
            cost: s.outcome.cost,
            iterations: s.outcome.iterations,
            evaluations: s.outcome.evaluations,
            status: s.outcome.status.clone(),
        })
        .collect();
    // The first of equally good starts, so that the choice does not depend on anything else.
    let best = (0..runs.len()).filter(|&s| runs[s].cost.is_finite()).min_by(|&a, &b| runs[a].cost.total_cmp(&runs[b].cost));
    let Some(best) = best else {
        let why = runs.iter().find_map(|r| if let Status::Failed(why) = &r.status { Some(why.clone()) } else { None });
        return Err(why.map_or(FitError::Interrupted, FitError::NoStart));
    };
    let values = runs[best].end.clone();
    Ok(FitResult {
        theta: (0..problem.scenes().len()).map(|s| problem.theta(s, &values)).collect(),
        initial_cost: runs[0].start_cost,
        cost: runs[best].cost,
        evaluations: runs.iter().map(|r| r.evaluations).sum(),
        values,
        runs,
        seconds: clock.elapsed().as_secs_f64(),
    })
}
