//! Whether anything tells how stiff a body is, or only how much stiffer one part of it is than another.
//!
//! Where no force is known, twice the stiffness of everything (material, attachments, contact) is balanced by twice the forces of whatever
//! moves the body: the same states. Then the derivative by the logarithm of a common factor is zero, whatever the numbers are.

use crate::engine::Backend;
use crate::experiment::Experiment;
use palpate_engine::{ParamBatch, Request, Wanted};
use palpate_model::params::{On, ParamKey, Transform};
use palpate_model::plan::Plan;

/// Share of the gradient along the common scale below which nothing speaks of it. A weight of a thousandth of the elastic forces leaves a
/// hundred times as much, rounding of solves to 1e-8 a hundredth.
const SILENT: f64 = 1e-6;

/// A word about a free stiffness that no force measures, scene by scene.
pub(crate) fn warnings(experiments: &[Experiment], theta: &[Vec<f64>], backend: Backend) -> Vec<String> {
    let mut out = Vec::new();
    for (e, theta) in experiments.iter().zip(theta) {
        let plan = e.plan();
        // Motions have inertia, which is a force.
        if plan.clock.moves() || !frees(e, |path| path == "material.youngs_modulus" || path.starts_with("field.")) {
            continue;
        }
        if is_silent(plan, theta, backend) == Some(true) {
            let advice = match frees(e, |path| path.starts_with("field.")) {
                false => "leave the modulus as it is stated and free ratios alone (a field)",
                true => "read the field as ratios: its mean is what the scene or the field's prior states, not what was measured",
            };
            out.push(format!(
                "{}: no known force acts, so that only ratios of stiffnesses are determined and Young's modulus is not: twice as stiff a body with \
                 supports twice as stiff gives the same states. Give a [[load]] or the weight (gravity and density), or {advice}",
                e.scene().path.display()
            ));
        }
    }
    out
}

fn frees(e: &Experiment, which: impl Fn(&str) -> bool) -> bool {
    e.scene().fit.iter().flat_map(|f| &f.parameters).any(|p| which(&p.path))
}

/// Whether the derivative along the common scale vanishes beside the gradient; `None` where that cannot be computed.
pub(crate) fn is_silent(plan: &Plan, theta: &[f64], backend: Backend) -> Option<bool> {
    let mut evaluate = backend.evaluator(plan, 1).ok()?;
    let request = Request { gradient: Wanted::All, sensitivities: Vec::new() };
    let found = evaluate.evaluate(&ParamBatch::of(theta), &request).into_iter().next()?;
    if found.failure.is_some() {
        return None;
    }
    let (mut common, mut squares) = (0.0, 0.0f64);
    for (place, key) in plan.layout.keys.iter().enumerate() {
        let spec = key.spec();
        let size = match spec.transform {
            Transform::Log => theta[place],
            _ => spec.size_at(theta[place]),
        };
        let g = found.gradient[place];
        if matches!(key.on(), On::Scene | On::Effect(_) | On::Field(_)) {
            squares += (g * size).powi(2);
        }
        if is_stiffness(plan, *key) {
            common += g * theta[place];
        }
    }
    (squares > 0.0).then(|| common.abs() < SILENT * squares.sqrt())
}

/// Numbers that a common scale multiplies. Contact follows Young's modulus where the scene states no stiffness of its own.
fn is_stiffness(plan: &Plan, key: ParamKey) -> bool {
    match key {
        ParamKey::YoungsModulus => true,
        ParamKey::Effect { effect, slot, .. } => {
            let of = plan.layout.effects().nth(usize::from(effect));
            of.is_some_and(|(law, _)| matches!(law.params[usize::from(slot)].unit, "N/m" | "Pa/m"))
        }
        _ => false,
    }
}
