//! What cells and time step do to the numbers of a fit: one evaluation on finer cells and half the step tells where its optimum lies there.
//!
//! With z₁ the fitted coordinate of a number (the logarithm of what is fitted as one), d₂ the Gauss–Newton step of the problem on cells and
//! steps half as large, and d_½ that on cells and steps twice as large: an error C h^p gives −d_½/d₂ = 2^p. Richardson's limit is z₁ + E d₂ with
//! E = 2^p/(2^p − 1) (Richardson, Phil. Trans. R. Soc. A 226, 1927; Roache, J. Fluids Eng. 116, 1994).
//!
//! - Where d₂ is larger than what noise leaves open, and the observed p agrees with orders 1 to 2 ([`ORDERS`]), the number is corrected to that
//!   limit, with p within [1, 2]. Its discretisation error is the way from the finest level that was computed to the limit, |d₂|/(2^p − 1): twice
//!   as wide as half of Roache's index with his factor of 1.25, as cut cells scatter about their order.
//! - Else it stays, and its discretisation error is 2 |d₂|: the whole error at p = 1, and half of Roache's index of the coarser of two
//!   levels at p = 2 with his factor of 3, which is meant for 95 %.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{Fitted, demand, free_parameters};
use crate::interrupt::Interrupt;
use crate::memory::BATCH_MEMORY;
use palpate_fit::{Chart, FitScene, FreeParameter, Problem, Want};
use palpate_model::params::fields::{Basis, FieldSpec};
use palpate_model::scene::{Optimizer, Resolution};
use std::ops::RangeInclusive;
use std::time::Instant;

/// Cells along an edge, and steps, for each of the fit's: the finer and the coarser level.
const FINER: f64 = 2.0;
const COARSER: f64 = 0.5;
/// Observed orders that agree with those between the first (contact and θ > ½, the ghost penalty) and the second (elements, other schemes).
const ORDERS: RangeInclusive<f64> = 0.5..=2.5;
/// Error of a number over its drift, where its order is not known.
const UNKNOWN: f64 = 2.0;

/// What cells and step do to every number of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct GridCheck {
    /// In the order of [`Fitted::free`].
    pub numbers: Vec<GridEffect>,
    /// What was half as large in the finer evaluation, in words.
    pub what: &'static str,
    /// Whether there was a coarser evaluation to compare with, or why not; `None` where none was needed.
    pub coarser: Option<Result<(), String>>,
    /// Wall-clock time of the evaluations [s].
    pub seconds: f64,
}

/// What cells and step do to a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridEffect {
    /// How far cells and step half as large would move it.
    pub drift: f64,
    /// Observed order, where there are two drifts of opposite signs.
    pub order: Option<f64>,
    /// Its value in the limit, where it is corrected to that.
    pub limit: Option<f64>,
    /// Standard error by discretisation that is left.
    pub error: f64,
}

impl GridEffect {
    /// From the steps in the coordinate at z, to the finer and to the coarser level, and the noise part of the number's error.
    fn new(chart: &Chart, z: f64, noise: Option<f64>, finer: f64, coarser: Option<f64>) -> GridEffect {
        let at = |step: f64| chart.value(z + step);
        let drift = at(finer) - at(0.0);
        let order = coarser.map(|c| -c / finer).filter(|r| r.is_finite() && *r > 0.0).map(f64::log2);
        let supported = order.filter(|p| ORDERS.contains(p)).map(|p| p.clamp(1.0, 2.0));
        match supported.filter(|_| noise.is_some_and(|n| drift.abs() > n)) {
            Some(p) => {
                let limit = at(finer * p.exp2() / (p.exp2() - 1.0));
                GridEffect { drift, order, limit: Some(limit), error: (limit - at(finer)).abs() }
            }
            None => GridEffect { drift, order, limit: None, error: UNKNOWN * drift.abs() },
        }
    }
}

/// The optimum on other cells and with another step, as the fit's best point sees it.
struct Level {
    /// Steps in z to there `[q]`.
    steps: Vec<f64>,
    /// The best point in z `[q]`.
    z: Vec<f64>,
    charts: Vec<Chart>,
}

/// The steps in z to the optimum of the same problem on other cells and with another step, from the best point; those at a bound stay.
fn level(
    experiments: &[Experiment],
    fitted: &Fitted,
    factor: f64,
    backend: Backend,
    interrupt: &Interrupt,
) -> Result<Level, Error> {
    let (_, free, _) = free_parameters(experiments)?;
    let others = experiments.iter().map(|e| e.finer(factor, factor)).collect::<Result<Vec<_>, _>>()?;
    let mut scenes = Vec::new();
    for (s, (e, theta)) in others.iter().zip(&fitted.result.theta).enumerate() {
        let asked = demand(&free, s, Optimizer::GaussNewton, 1);
        backend.members(e.plan(), &asked, 0)?;
        let bytes = asked.on_cpu(e.plan(), 0).1.total();
        if bytes > BATCH_MEMORY {
            return Err(Error::Failed(format!("on cells {factor} times as fine it would take {:.1} GB", bytes as f64 * 1e-9)));
        }
        scenes.push(FitScene {
            name: e.scene().path.display().to_string(),
            fingerprint: String::new(),
            base: theta.clone(),
            evaluate: backend.evaluator_until(e.plan(), 1, interrupt.at_once())?,
        });
    }
    // Masses are densities of a volume that the cells round.
    let places: Vec<FreeParameter> = free_parameters(&others)?.1;
    let mut problem = Problem::new(scenes, places).map_err(Error::Failed)?;
    let values = &fitted.result.parameters;
    let charts = problem.charts().to_vec();
    let z: Vec<f64> = charts.iter().zip(values).map(|(c, p)| c.coordinate(p.value)).collect();
    let sample = problem.evaluate(std::slice::from_ref(&z), Want::Curvature).remove(0);
    if sample.stopped {
        return Err(Error::Interrupted);
    }
    if let Some(why) = sample.failure {
        return Err(Error::Failed(format!("on cells {factor} times as fine: {why}")));
    }
    let inner: Vec<usize> = (0..values.len()).filter(|i| values[*i].at_bound.is_none()).collect();
    if inner.is_empty() {
        return Ok(Level { steps: vec![0.0; z.len()], z, charts });
    }
    let steps = sample.gauss_newton_step(&inner);
    let steps = steps.ok_or_else(|| Error::Failed("the finer cells do not determine every number".into()))?;
    Ok(Level { steps, z, charts })
}

/// What cells and step do to the numbers of a fit. Costs one evaluation with cells and step half as large, and one with both twice as
/// large where the first moves a number by more than noise does.
///
/// # Errors
/// The finer simulation fails, does not fit into memory or does not determine every number; there is nothing that could be finer.
pub fn grid_check(
    experiments: &[Experiment],
    fitted: &Fitted,
    backend: Backend,
    interrupt: &Interrupt,
) -> Result<GridCheck, Error> {
    let began = Instant::now();
    let on_grid = |f: &FieldSpec| !matches!(f.basis, Basis::Regions(..));
    if experiments.iter().any(|e| e.scene().fields.iter().any(on_grid)) {
        return Err(Error::Failed("a field by cells or nodes has no counterpart on finer ones".into()));
    }
    let cells = experiments.iter().any(|e| e.scene().object.resolution != Resolution::Own);
    let step = experiments.iter().any(|e| e.plan().clock.moves());
    let made = experiments.iter().all(|e| matches!(e.scene().object.resolution, Resolution::Edge(_)));
    let what = match (cells, step) {
        (true, true) if made => "tetrahedra and step",
        (true, false) if made => "tetrahedra",
        (true, true) => "cells and step",
        (true, false) => "cells",
        (false, true) => "step",
        (false, false) => {
            return Err(Error::Failed("tetrahedra and points at rest have neither cells nor step to refine".into()));
        }
    };
    let Level { steps: finer, z, charts } = level(experiments, fitted, FINER, backend, interrupt)?;
    let found = &fitted.result.parameters;
    let effect = |coarser: Option<&Vec<f64>>| -> Vec<GridEffect> {
        let one = |i: usize| GridEffect::new(&charts[i], z[i], found[i].noise, finer[i], coarser.map(|c| c[i]));
        (0..found.len()).map(one).collect()
    };
    let mut numbers = effect(None);
    let moved = |(e, p): (&GridEffect, &palpate_fit::FittedParameter)| p.noise.is_some_and(|n| e.drift.abs() > n);
    let mut coarser = None;
    if numbers.iter().zip(found).any(moved) {
        coarser = Some(match level(experiments, fitted, COARSER, backend, interrupt) {
            Ok(Level { steps, .. }) => {
                numbers = effect(Some(&steps));
                Ok(())
            }
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(why) => Err(why.to_string()),
        });
    }
    Ok(GridCheck { numbers, what, coarser, seconds: began.elapsed().as_secs_f64() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::params::Transform;

    /// Steps of a coordinate whose error is C h^p.
    fn steps(c: f64, p: f64) -> (f64, f64) {
        let error = |h: f64| c * h.powf(p);
        (error(0.5) - error(1.0), error(2.0) - error(1.0))
    }

    #[test]
    fn what_converges_with_an_order_is_corrected_to_its_limit() {
        let chart = Chart::new(Transform::Linear, 1.0, -9.0, 9.0).expect("valid");
        for p in [1.0, 1.4, 2.0] {
            let (finer, coarser) = steps(0.3, p);
            let e = GridEffect::new(&chart, 5.3, Some(0.01), finer, Some(coarser));
            assert!((e.order.unwrap() - p).abs() < 1e-12 && (e.limit.unwrap() - 5.0).abs() < 1e-12, "{e:?}");
            // From the finest level to the limit.
            assert!((e.error - 0.3 * 0.5f64.powf(p)).abs() < 1e-12, "{e:?}");
        }
        // Orders beyond the band are no reason to correct, nor is a drift that noise hides; ± then covers an error of first order.
        for p in [0.2, 3.0] {
            let (finer, coarser) = steps(0.3, p);
            let e = GridEffect::new(&chart, 5.3, Some(0.01), finer, Some(coarser));
            assert!(e.limit.is_none() && (e.error - 2.0 * finer.abs()).abs() < 1e-12, "{e:?}");
        }
        let (finer, coarser) = steps(0.3, 1.0);
        let e = GridEffect::new(&chart, 5.3, Some(0.2), finer, Some(coarser));
        assert!(e.limit.is_none() && (e.error - 0.3).abs() < 1e-12, "{e:?}");
        // Both levels on one side: no order.
        let e = GridEffect::new(&chart, 5.3, Some(0.01), -0.1, Some(-0.3));
        assert!(e.order.is_none() && e.limit.is_none(), "{e:?}");
    }

    #[test]
    fn a_positive_number_stays_positive() {
        let chart = Chart::new(Transform::Log, 1.0, 1e-3, 1e13).expect("valid");
        let (finer, coarser) = steps(0.8, 1.0);
        let e = GridEffect::new(&chart, (2e4f64).ln() + 0.8, Some(1.0), finer, Some(coarser));
        assert!((e.limit.unwrap() / 2e4 - 1.0).abs() < 1e-12, "{e:?}");
        assert!(e.drift < 0.0 && e.error > 0.0);
    }
}
