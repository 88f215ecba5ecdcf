//! What was not in the capture: a jet on a plate and on a sphere, and obstacles that press a ball.

use super::Figures;
use crate::verify::scenes::{self, end};
use glam::{DAffine3, DVec3};
use palpate_cpu::terms::contact::touches;
use palpate_cpu::terms::{jets, obstacles};
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{Effect, find};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::mechanics::{contact, plane};
use palpate_model::observation::Observation;
use palpate_model::plan::Physics;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::QUASI_STATIC;
use palpate_model::scene::{Analytic, Clamp, InitialShape, Plane, Scene, Time};
use palpate_model::shape::Placed;
use std::f64::consts::PI;
use std::sync::Arc;

const SPREAD: f64 = 0.1;

/// Force of a jet of 1 N along −x from `origin` on a body at rest [N].
fn blown(mut scene: Scene, origin: DVec3) -> Result<DVec3, String> {
    let values = [1.0, SPREAD, origin.x, origin.y, origin.z].map(Some).to_vec();
    let moving = Some(Arc::new(Moving::nozzle(-DVec3::X, RigidMotion::default())));
    scene.effects = vec![Effect { values, moving, ..Effect::absent(find("jet").expect("it is in the table")) }];
    let plan = build_plan(&scene, Observation::default(), &[]).map_err(|e| e.to_string())?;
    let physics = Physics::new(&plan.layout, &plan.theta);
    Ok(jets::forces(&plan, &physics, 0.0, &vec![DVec3::ZERO; plan.body.nodes.len()])[0])
}

/// A plate across a jet, 0.2 m from its origin, and one askew.
pub fn plate() -> Result<Figures, String> {
    let plate = || scenes::body(Analytic::Box { min: DVec3::new(-0.02, -0.1, -0.1), max: DVec3::new(0.0, 0.1, 0.1) }, 0.005);
    let mut askew = plate();
    askew.object.pose = DAffine3::from_rotation_z(PI / 6.0);
    let across = blown(plate(), DVec3::new(0.2, 0.0, 0.0))?;
    let turned = blown(askew, DVec3::new(0.2, 0.0, 0.0))?;
    // Thrust times the sine squared along the normal, spread over a longer patch: the cosine of the turn.
    let exact = (PI / 6.0).cos() * DVec3::new(-(PI / 6.0).cos(), -(PI / 6.0).sin(), 0.0);
    Ok(Figures::from([
        ("force on a plate over thrust".into(), -across.x),
        ("force across the jet over thrust".into(), across.y.hypot(across.z)),
        ("plate askew: error of the force over thrust".into(), (turned - exact).length()),
    ]))
}

/// A sphere that is small beside a jet far away: an even stream.
pub fn sphere() -> Result<Figures, String> {
    let (radius, s) = (0.05, 500.0);
    let mut figures = Figures::new();
    for cells in [6.0, 12.0] {
        let ball = scenes::body(Analytic::Ball { radius, center: DVec3::new(0.001, 0.002, -0.001) }, radius / cells);
        let force = blown(ball, DVec3::new(s, 0.0, 0.0))?;
        // F = c ½ρU² πR² with ρU² = 2T/(πb²).
        let b = SPREAD * s;
        figures
            .insert(format!("drag coefficient of a sphere, {cells} cells to its radius"), -force.x * b * b / (radius * radius));
    }
    Ok(figures)
}

/// A plate that a file moves along −`n` from where it touches a ball of radius 1 to where it flattens it by `approach`.
fn pressing(n: DVec3, center: DVec3, approach: f64, stiffness: f64) -> Effect {
    let shape = Placed::new(Analytic::Box { min: DVec3::splat(-1.0), max: DVec3::splat(1.0) }, DAffine3::IDENTITY);
    let away = |d: f64| center + n * (2.0 - d);
    let motion = RigidMotion {
        times: vec![0.0, 1.0],
        translations: vec![away(0.0), away(approach)],
        rotations: vec![glam::DQuat::IDENTITY; 2],
    };
    let moving = Some(Arc::new(Moving::obstacle(&shape, 1.0 / 16.0, motion)));
    let values = [stiffness, 0.0, 0.0, 0.0].map(Some).to_vec();
    Effect { values, moving, ..Effect::absent(find("obstacle").expect("it is in the table")) }
}

/// A ball pressed flat by a tenth of its radius on either side, by planes and by obstacles of the same stiffness.
pub fn obstacle() -> Result<Figures, String> {
    let (h, approach, c) = (1.0 / 10.0, 0.1, DVec3::new(0.02, 0.01, 0.03));
    let mut s = scenes::body(Analytic::Ball { radius: 1.0, center: c }, h);
    (s.material.youngs_modulus, s.material.poisson_ratio) = (1.0, 0.3);
    let core = DVec3::splat(0.15);
    s.clamps = vec![Clamp::still(c - core, c + core)];
    let mut planes = s.clone();
    let at = |n: DVec3| Plane { point: c - n * (1.0 - approach), ..scenes::plane(n) };
    planes.planes = vec![at(DVec3::Z), at(-DVec3::Z)];
    planes.initial.state = InitialShape::StaticEquilibrium;
    let (plan, state) = end(&planes)?;
    let known = plane::planes(&plan, &Physics::new(&plan.layout, &plan.theta));
    let wanted: f64 = touches(&plan.body, &known[0], 1.0, [&state.displacement; 2]).map(|(_, t)| t.area * t.pressure).sum();
    let flat = state.displacement;

    let stiffness = contact::DEFAULT_STIFFNESS / h;
    s.effects = [DVec3::Z, -DVec3::Z].map(|n| pressing(n, c, approach, stiffness)).to_vec();
    s.time = Time { scheme: &QUASI_STATIC, step: 0.25, steps: 4, ..Time::default() };
    let (plan, state) = end(&s)?;
    let forces = obstacles::forces(&plan, &Physics::new(&plan.layout, &plan.theta), 1.0, &state.displacement);
    let largest = |v: &mut dyn Iterator<Item = DVec3>| v.map(|u| u.length()).fold(0.0, f64::max);
    let size = largest(&mut flat.iter().copied());
    let apart = largest(&mut flat.iter().zip(&state.displacement).map(|(a, b)| *a - *b)) / size;
    Ok(Figures::from([
        ("force over that of a plane".into(), forces[1].length() / wanted),
        ("what both forces leave over one".into(), (forces[0] + forces[1]).length() / wanted),
        ("largest difference of the displacement over the largest".into(), apart),
    ]))
}
