//! A body too soft for its own weight collapses on the ground and its cells turn inside out. How far the solver gets is held fast
//! here: a cell's rotation jumps when it is inverted as far along one axis as it is stretched along another, the potential of its
//! bending modes jumps with it, and Newton's method ends at such an edge, where the residual is not zero on either side.

use crate::CpuBackend;
use glam::{DAffine3, DVec3};
use palpate_engine::{Backend, Failure, FailureKind, ParamBatch};
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan_build::build_plan;
use palpate_model::scene::*;

/// A torus of density 1000 kg/m³ that falls on its edge; at 500 Pa its own weight strains it by several hundred per cent.
fn torus(youngs_modulus: f64) -> Plan {
    let axis = DVec3::new(1.0, 0.2, 0.5).normalize();
    let scene = Scene {
        path: "in-code.toml".into(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(Analytic::Torus { major: 0.1, minor: 0.04, center: DVec3::new(0.0, 0.0, 0.15), axis }),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(0.02),
        },
        material: Material {
            inertia: Inertia::Density(1000.0),
            youngs_modulus,
            poisson_ratio: 0.45,
            mass_damping: 0.1,
            stiffness_damping: 0.002,
        },
        gravity: DVec3::new(0.0, 0.0, -9.81),
        clamps: Vec::new(),
        planes: vec![Plane { point: DVec3::ZERO, normal: DVec3::Z, stiffness: None }],
        masses: Vec::new(),
        effects: Vec::new(),
        initial: Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state: InitialShape::Rest },
        time: Time { step: 0.01, steps: 40, start: 0.0, theta: 0.6 },
        solver: Solver::default(),
        observation: None,
        fit: None,
    };
    build_plan(&scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Steps that are solved before the first failure, and that failure.
fn run(plan: &Plan) -> (usize, Option<Failure>) {
    let backend = CpuBackend;
    let mut world = backend.build(plan, 1).unwrap();
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &[]);
    let (mut now, mut next) = (backend.new_state(&world), backend.new_state(&world));
    backend.start(&mut world, &mut now, &mut tally);
    for k in 0..plan.clock.steps {
        backend.step(&mut world, k, &now, &mut next, &mut tally);
        if let Some(failure) = backend.read(&world, &tally).remove(0).failure {
            return (k, Some(failure));
        }
        std::mem::swap(&mut now, &mut next);
    }
    (plan.clock.steps, None)
}

#[test]
fn a_torus_that_bears_its_weight_is_solved_to_the_end() {
    let (solved, failure) = run(&torus(5000.0));
    assert!(failure.is_none(), "{solved} of 40 steps: {failure:?}");
}

#[test]
fn a_collapsing_torus_gets_this_far_and_says_why_it_stops() {
    // Steps of 0.01 s solved today; the ground is touched in step 6. More is better.
    for (youngs_modulus, least) in [(500.0, 15), (1000.0, 19), (2000.0, 23)] {
        let (solved, failure) = run(&torus(youngs_modulus));
        println!("{youngs_modulus} Pa: {solved} steps, {failure:?}");
        assert!(solved >= least, "{youngs_modulus} Pa: {solved} steps, were {least}: {failure:?}");
        assert!(failure.is_none_or(|f| f.kind == FailureKind::NewtonStalled));
    }
}
