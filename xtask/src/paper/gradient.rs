//! The adjoint's gradient beside finite differences.

use crate::table;
use palpate::{Backend, Error};
use palpate_engine::{ParamBatch, Request, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use serde::Serialize;
use std::time::Instant;

/// The paper's figure 24: error of E after 7 fits with the adjoint, with forward differences over 5 and with those over 100 [%].
pub const PAPER: [f64; 3] = [1.41, 35.14, 39.33];

/// Adjoint against central differences at one E.
#[derive(Clone, Debug, Serialize)]
pub struct Gradient {
    /// E over the truth.
    pub at: f64,
    /// dJ/d ln E by the adjoint.
    pub adjoint: f64,
    /// Relative deviation of central differences of relative step 1e-4 [%].
    pub central_percent: f64,
    /// Of forward differences over 5 Pa, the paper's smaller step [%].
    pub forward_5_percent: f64,
    /// Of forward differences over 100 Pa, the paper's larger step [%].
    pub forward_100_percent: f64,
    /// Time of cost and adjoint gradient over that of the cost.
    pub adjoint_cost: f64,
}

/// Compares at these multiples of the plan's own E.
///
/// # Errors
/// A simulation fails.
pub fn gradients(plan: &Plan, at: &[f64]) -> Result<Vec<Gradient>, Error> {
    let mut evaluator = Backend::Auto.evaluator(plan, 1)?;
    let place = plan.layout.index(ParamKey::YoungsModulus);
    let truth = plan.theta[place];
    let mut evaluate = |e: f64, gradient: bool| {
        let mut theta = plan.theta.clone();
        theta[place] = e;
        let gradient = if gradient { Wanted::All } else { Wanted::Nothing };
        let request = Request { gradient, sensitivities: Vec::new() };
        let clock = Instant::now();
        let r = evaluator.evaluate(&ParamBatch::from_rows(&[theta]), &request).remove(0);
        let seconds = clock.elapsed().as_secs_f64();
        r.failure.map_or(Ok(()), |f| Err(Error::Failed(f.to_string())))?;
        Ok::<_, Error>((r.cost, r.gradient.get(place).copied().unwrap_or(0.0), seconds))
    };
    let one = |&at: &f64| {
        let e = at * truth;
        let d = 1e-4 * e;
        let (cost, _, forward) = evaluate(e, false)?;
        let (_, adjoint, both) = evaluate(e, true)?;
        let central = (evaluate(e + d, false)?.0 - evaluate(e - d, false)?.0) / (2.0 * d);
        let (small, large) = ((evaluate(e + 5.0, false)?.0 - cost) / 5.0, (evaluate(e + 100.0, false)?.0 - cost) / 100.0);
        let off = |g: f64| 100.0 * (g / adjoint - 1.0).abs();
        Ok(Gradient {
            at,
            adjoint: adjoint * e,
            central_percent: off(central),
            forward_5_percent: off(small),
            forward_100_percent: off(large),
            adjoint_cost: both / forward,
        })
    };
    at.iter().map(one).collect()
}

/// Prints the table, the paper's figures last.
pub fn print(gradients: &[Gradient]) {
    let head = ["E / truth", "dJ/d ln E", "central 1e-4", "forward 5 Pa", "forward 100 Pa", "gradient / cost"];
    let mut rows = vec![head.map(String::from).to_vec()];
    rows.extend(gradients.iter().map(|g| {
        let percent = |p: f64| format!("{p:.4} %");
        vec![
            g.at.to_string(),
            format!("{:+.5}", g.adjoint),
            percent(g.central_percent),
            percent(g.forward_5_percent),
            percent(g.forward_100_percent),
            format!("{:.2}", g.adjoint_cost),
        ]
    }));
    let [adjoint, small, large] = PAPER.map(|p| format!("{p:.2} %"));
    rows.push(vec!["paper, figure 24".into(), adjoint, "-".into(), small, large, "-".into()]);
    table::print(
        "deviation of differences from the adjoint (time ratio: cost and gradient over cost alone; the paper's row: how far E was off \
         that was found with the adjoint and with such differences)",
        &rows,
    );
}
