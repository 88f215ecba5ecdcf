//! Experiments on finer cells and with a shorter step, and what they change.

use crate::error::Error;
use crate::experiment::Experiment;
use palpate_diagnose::{Field, Readings};

/// Cells of the finer grid per cell along an edge: the cheapest that shows the error well.
pub(super) const FINER: f64 = 1.5;
/// The error of the grid, which falls with the square of the cell, over what the finer grid changes.
pub(super) const GRID: f64 = 1.0 / (1.0 - 1.0 / (FINER * FINER));
/// The error of the step, which falls with it, over what half the step changes.
pub(super) const STEP: f64 = 2.0;

/// An experiment on finer cells, with the same step: that is halved by itself.
pub(super) fn finer(e: &Experiment) -> Result<Experiment, Error> {
    let mut f = e.finer(FINER, FINER)?;
    f.plan.clock = e.plan.clock;
    f.plan.theta.clone_from(&e.plan.theta);
    f.scene.fit.clone_from(&e.scene.fit);
    Ok(f)
}

/// An experiment with half the step; one of equilibria has none.
pub(super) fn halved(mut e: Experiment) -> Experiment {
    if !e.plan.clock.moves() {
        return e;
    }
    e.plan.clock.step *= 0.5;
    e.plan.clock.steps *= 2;
    e
}

/// What a finer computation changed, carried on to the limit by a factor.
pub(super) fn difference(name: &'static str, fine: &Readings, coarse: &Readings, factor: f64) -> Field {
    let both = fine.rows.iter().zip(coarse.rows.iter());
    let change = both.map(|(f, c)| Some(factor * (f.row.value? - c.row.value?))).collect();
    Field::refined(name, change)
}
