//! Running a plan and looking at its states.

use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Rollout, Snapshot};
use palpate_model::plan::Plan;
use std::ops::ControlFlow;

/// All states of a simulation at the plan's own parameters, the initial one first.
pub fn states(plan: &Plan) -> Vec<Snapshot> {
    let mut all = Vec::new();
    Rollout::new(CpuBackend, plan, 1)
        .unwrap()
        .visit(&plan.theta, |_, s, _| {
            all.push(s);
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
    all
}

/// Mass of every node [kg] at a density [kg/m³].
pub fn masses(plan: &Plan, density: f64) -> Vec<f64> {
    plan.body.node_volume.iter().map(|w| density * w).collect()
}

/// Σ m v over nodes [kg m/s].
pub fn momentum(m: &[f64], s: &Snapshot) -> DVec3 {
    m.iter().zip(&s.velocity).map(|(m, v)| *m * *v).sum()
}

/// Σ m x × v over nodes, about the origin [kg m²/s].
pub fn angular_momentum(plan: &Plan, m: &[f64], s: &Snapshot) -> DVec3 {
    (0..m.len()).map(|i| m[i] * (plan.body.nodes[i] + s.displacement[i]).cross(s.velocity[i])).sum()
}

/// Displacement of the simulation node nearest to a rest point.
pub fn nearest(plan: &Plan, point: DVec3) -> usize {
    let d = |i: &usize| (plan.body.nodes[*i] - point).length_squared();
    (0..plan.body.nodes.len()).min_by(|a, b| d(a).total_cmp(&d(b))).expect("a body has nodes")
}
