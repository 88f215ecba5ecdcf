//! Small scenes in code, their plans and their states.

use glam::{DAffine3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Rollout, Snapshot};
use palpate_model::effects::{ALL, Effect, find};
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use std::ops::ControlFlow;

/// Standard acceleration of gravity [m/s²].
pub const G: f64 = 9.81;

/// A body at rest in free space: 100 kPa, ν = 0.3, 1000 kg/m³, undamped, and what a scene file that says no more gets.
pub fn body(shape: Analytic, cell: f64) -> Scene {
    of(BodySource::Analytic(shape), cell)
}

/// The same of any source.
pub fn of(source: BodySource, cell: f64) -> Scene {
    let object = Object { source, pose: DAffine3::IDENTITY, resolution: Resolution::CellSize(cell) };
    Scene::at_rest("verify.toml", object, Material::undamped(1e5, 0.3))
}

/// Steps of the scheme that scenes have by default.
pub fn steps(step: f64, steps: usize) -> Time {
    Time { step, steps, ..Time::default() }
}

/// A plane of the default stiffness through the origin.
pub fn plane(normal: DVec3) -> Plane {
    Plane { point: DVec3::ZERO, normal: normal.normalize(), stiffness: None }
}

/// Friction.
///
/// # Panics
/// There is no such effect any more.
pub fn friction(coefficient: f64) -> Effect {
    let law = find("coulomb-friction").unwrap_or_else(|| panic!("coulomb-friction has gone"));
    let mut effect = Effect::absent(law);
    let slot = ALL[law].params.iter().position(|p| p.key == "coefficient");
    effect.values[slot.unwrap_or_else(|| panic!("friction has no coefficient"))] = Some(coefficient);
    effect
}

/// A plan without observations.
///
/// # Errors
/// The scene gives none.
pub fn plan(scene: &Scene) -> Result<Plan, String> {
    build_plan(scene, Observation::default(), &[]).map_err(|e| e.to_string())
}

/// All states of a plan, the start first.
///
/// # Errors
/// It cannot be simulated to its end.
pub fn states(plan: &Plan) -> Result<Vec<Snapshot>, String> {
    let mut all = Vec::new();
    let mut rollout = Rollout::new(CpuBackend, plan, 1).map_err(|e| e.to_string())?;
    rollout
        .visit(&plan.theta, |_, s, _| {
            all.push(s);
            ControlFlow::Continue(())
        })
        .map_err(|e| e.to_string())?;
    Ok(all)
}

/// The last of them.
///
/// # Errors
/// As [`states`].
pub fn end(scene: &Scene) -> Result<(Plan, Snapshot), String> {
    let plan = plan(scene)?;
    let last = states(&plan)?.pop().ok_or("a simulation has a start")?;
    Ok((plan, last))
}

/// Mean over the mass.
pub fn mean(plan: &Plan, values: &[DVec3]) -> DVec3 {
    let sum: DVec3 = values.iter().zip(&plan.body.node_volume).map(|(v, w)| *w * *v).sum();
    sum / plan.body.node_volume.iter().sum::<f64>()
}
