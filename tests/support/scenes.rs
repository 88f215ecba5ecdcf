//! Small scenes built in code.

use glam::{DAffine3, DVec3};
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;

/// A body in free space at rest, E = 5 kPa, ν = 0.4, 1000 kg/m³, no damping, no gravity, 10 steps of 5 ms at θ = ½.
pub fn body(shape: Analytic, cell_size: f64) -> Scene {
    let object =
        Object { source: BodySource::Analytic(shape), pose: DAffine3::IDENTITY, resolution: Resolution::CellSize(cell_size) };
    let time = Time { step: 0.005, steps: 10, ..Time::weighted(0.5) };
    Scene { time, ..Scene::at_rest("in-code.toml", object, Material::undamped(5000.0, 0.4)) }
}

/// A contact plane whose stiffness follows the material.
pub fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane { point, normal: normal.normalize(), stiffness: None }
}

/// A plan without observations.
pub fn plan(scene: &Scene) -> Plan {
    build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}
