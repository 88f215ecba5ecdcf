//! Fits in laps: one that goes on where an earlier one ended takes over its damping and the sizes that its steps count in, so that two laps
//! of three iterations are one fit of six.

use super::crowd::Physics;
use super::limits::Limits;
use super::simulate::{NEWTON, problem};
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::fitting::errors;
use crate::results::checkpoint::CheckpointLap;
use palpate_diagnose::{Change, Fit, LabError, Model, Start};
use palpate_fit::{Hooks, Settings, Status, Tolerance, Walk};
use palpate_model::scene::Optimizer;
use std::collections::HashMap;

/// How a fit stood at its end.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Lap {
    pub walk: Walk,
    /// Sizes that steps count in, of every number.
    pub typical: Vec<f64>,
}

impl Lap {
    /// For the checkpoint, which keeps the reach beside it.
    pub fn to_document(&self) -> CheckpointLap {
        let Walk { damping, level, .. } = self.walk;
        CheckpointLap { damping, level, typical: self.typical.clone() }
    }

    /// As the checkpoint has it.
    pub fn from_document(lap: &CheckpointLap, reach: f64) -> Lap {
        let walk = Walk { reach, damping: lap.damping, level: lap.level };
        Lap { walk, typical: lap.typical.clone() }
    }
}

/// Ends of fits, by what they fit and where they ended.
#[derive(Default)]
pub(super) struct Laps(HashMap<String, Lap>);

fn key(changes: &[Change], values: &[f64]) -> String {
    format!("{changes:?} {values:?}")
}

impl Laps {
    /// Keeps the end of a fit.
    pub fn keep(&mut self, fit: &Fit, lap: &Lap) {
        self.0.insert(key(&fit.model.changes, &fit.model.values), lap.clone());
    }

    /// The fit that a start goes on with: it begins where that ended, with its reach.
    pub fn before(&self, start: &Start) -> Option<&Lap> {
        let lap = self.0.get(&key(&start.changes, &start.values))?;
        (start.reach.min(f64::MAX) == lap.walk.reach.min(f64::MAX)).then_some(lap)
    }
}

/// Fits one hypothesis; when the time is over, what was reached until then.
pub(super) fn fit(
    base: &[Experiment],
    physics: (Backend, Option<Physics>),
    limits: &Limits,
    Start { changes, values, reach }: &Start,
    (iterations, tolerance): (usize, f64),
    before: Option<&Lap>,
) -> Result<(Fit, Lap), LabError> {
    limits.check()?;
    let (mut problem, numbers) = problem(base, physics, limits, (changes, values), NEWTON * tolerance, before)?;
    let settings = Settings {
        iterations,
        walk: before.map_or(Walk { reach: *reach, ..Walk::default() }, |lap| lap.walk),
        // Of ten thousand readings a share of 2e-4 of the cost is that of two. Steps count as its square root.
        tolerance: Tolerance { cost: tolerance, gradient: tolerance, step: 0.1 * tolerance.sqrt(), ..Tolerance::default() },
        errors: errors(base),
        ..Settings::new(Optimizer::GaussNewton)
    };
    let hooks = Hooks { interrupt: limits.interrupt().in_turn(), ..Hooks::default() };
    let result = palpate_fit::fit(&mut problem, &settings, hooks).map_err(|e| match e {
        palpate_fit::FitError::Interrupted => limits.stopped(),
        palpate_fit::FitError::Broken(why) => limits.break_off(why),
        e => LabError::failed(e),
    })?;
    if let Some(why) = result.broken {
        return Err(limits.break_off(why));
    }
    if limits.is_over() {
        return Err(LabError::Interrupted);
    }
    let model = Model {
        changes: changes.clone(),
        numbers,
        values: result.parameters.iter().map(|p| p.value).collect(),
        errors: result.parameters.iter().map(|p| p.standard_error).collect(),
    };
    let run = &result.runs[result.best];
    let unsettled = matches!(run.status, Status::IterationLimit | Status::Interrupted);
    let lap = Lap { walk: run.walk, typical: problem.free().iter().map(|f| f.typical).collect() };
    let (promised, reach) = (run.promised, run.walk.reach);
    Ok((Fit { model, cost: result.cost, promised, reach, settled: !unsettled }, lap))
}
