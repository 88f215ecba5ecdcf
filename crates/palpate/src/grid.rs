//! How much of a result is the grid's: one evaluation on a finer grid tells where its optimum lies.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{Fitted, free_parameters};
use palpate_fit::{FitScene, Problem, Want};
use palpate_model::params::fields::{Basis, FieldSpec};

/// Change of every free parameter (order of `fitted.free`) that cells and time step divided by `factor` would bring: the
/// Gauss–Newton step of the finer problem at the coarse optimum. One evaluation instead of a fit; good to second order in the
/// change. Where errors fall with the square of the cell size, the whole error at `factor` 2 is four thirds of it.
///
/// # Errors
/// The finer simulation fails or does not determine every parameter.
pub fn grid_shift(experiments: &[Experiment], fitted: &Fitted, factor: f64, backend: Backend) -> Result<Vec<f64>, Error> {
    let (_, free, _) = free_parameters(experiments)?;
    let on_grid = |f: &FieldSpec| !matches!(f.basis, Basis::Regions(..));
    if experiments.iter().any(|e| e.scene().fields.iter().any(on_grid)) {
        return Err(Error::Failed("a field by cells or nodes has no counterpart on a finer grid".into()));
    }
    let finer = experiments.iter().map(|e| e.finer(factor)).collect::<Result<Vec<_>, _>>()?;
    let mut scenes = Vec::new();
    for (e, theta) in finer.iter().zip(&fitted.result.theta) {
        scenes.push(FitScene {
            name: e.scene().path.display().to_string(),
            fingerprint: String::new(),
            base: theta.clone(),
            evaluate: backend.evaluator(e.plan(), 1)?,
        });
    }
    let mut problem = Problem::new(scenes, free).map_err(Error::Failed)?;
    let values: Vec<f64> = fitted.result.parameters.iter().map(|p| p.value).collect();
    let sample = problem.evaluate_values(&[values], Want::Curvature).remove(0);
    if let Some(why) = sample.failure {
        return Err(Error::Failed(format!("on a grid {factor} times as fine: {why}")));
    }
    sample.gauss_newton_step().ok_or_else(|| Error::Failed("the finer grid does not determine every parameter".into()))
}
