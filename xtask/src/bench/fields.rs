//! What the gradient by a field of ten thousand cell moduli costs beside that by one modulus.

use super::report::Times;
use super::{BAND, placed, plan};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::params::Layout;
use palpate_model::params::fields::{Basis, Field, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::scene::Analytic;
use palpate_model::space::body::Body;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Cells over the edge of the block: some ten thousand of them.
const ACROSS: f64 = 21.5;
/// Steps of a rollout, and how often both gradients are timed in turn.
const STEPS: usize = 4;
const RUNS: usize = 3;

/// Two gradients of the same rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fields {
    /// Values of the field, one a cell.
    pub values: usize,
    /// Simulation nodes.
    pub nodes: usize,
    /// Cost and gradient by one modulus.
    pub one: Times,
    /// Cost and gradient by all values.
    pub all: Times,
}

impl Fields {
    /// In a line.
    pub fn text(&self) -> String {
        let ratio = self.all.min / self.one.min;
        format!(
            "fields: gradient by {} cell moduli {:.2} s, by one {:.2} s: {ratio:.3} times ({} nodes, {STEPS} steps, best of {RUNS}; aim 1.2)",
            self.values, self.all.min, self.one.min, self.nodes
        )
    }
}

/// The falling block with a field of ones on its modulus.
fn block() -> Result<Plan, String> {
    let shape = placed(Analytic::Box { min: DVec3::new(-0.1, -0.1, 0.003), max: DVec3::new(0.1, 0.1, 0.203) });
    let h = 0.2 / ACROSS;
    let body = Body::build(&shape, h, BAND * h, SUBDIVISIONS).map_err(|e| e.to_string())?;
    let mut plan = plan(body, &[]);
    let spec = FieldSpec { varied: Varied::Modulus, basis: Basis::Cells, scale: Scale::Log, values: None, prior: None };
    plan.fields = vec![Field::new(&spec, &plan.body)?];
    let count = plan.fields[0].count;
    plan.layout = Layout::new(1, 0, &[], &[count]);
    plan.theta.extend(std::iter::repeat_n(1.0, count));
    plan.clock.steps = STEPS;
    Ok(plan)
}

/// Times both gradients in turn.
///
/// # Errors
/// The block cannot be built or simulated.
pub fn run() -> Result<Fields, String> {
    let plan = block()?;
    let places = plan.layout.resolve("field.0");
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).map_err(|e| e.to_string())?;
    let theta = ParamBatch::from_rows(std::slice::from_ref(&plan.theta));
    let mut time = |places: Vec<usize>| -> Result<f64, String> {
        let request = Request { gradient: Wanted::Places(places), ..Request::default() };
        let clock = Instant::now();
        let e = rollout.evaluate(&theta, &request).remove(0);
        e.failure.map_or(Ok(clock.elapsed().as_secs_f64()), |f| Err(f.to_string()))
    };
    // The first evaluation warms up.
    time(vec![0])?;
    let (mut one, mut all) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        one.push(time(vec![0])?);
        all.push(time(places.clone().collect())?);
    }
    Ok(Fields { values: places.len(), nodes: plan.body.nodes.len(), one: Times::of(one), all: Times::of(all) })
}
