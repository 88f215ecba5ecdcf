//! A body too soft for its own weight collapses on the ground and its cells turn inside out. Without the guard of
//! `palpate_model::cutcells::corotation::inversion` and the tamed tangent, Newton's method ended at jumps of the potential, or crept.

use crate::CpuBackend;
use crate::linear::vector::dot;
use crate::newton::Effort;
use crate::simulate;
use crate::terms::elastic_cells::corners;
use crate::terms::zeros;
use crate::world::{Gradient, MemberState, MemberTangent, World};
use glam::{DAffine3, DVec3};
use palpate_engine::{Backend, Direction, Failure, ParamBatch, Request};
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use std::sync::Arc;

/// A torus of density 1000 kg/m³ that falls on its edge; at 500 Pa its own weight strains it by several hundred per cent.
fn torus(youngs_modulus: f64) -> Plan {
    build_plan(&scene(youngs_modulus), Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Its scene.
pub(crate) fn scene(youngs_modulus: f64) -> Scene {
    let axis = DVec3::new(1.0, 0.2, 0.5).normalize();
    Scene {
        path: "in-code.toml".into(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(Analytic::Torus { major: 0.1, minor: 0.04, center: DVec3::new(0.0, 0.0, 0.15), axis }),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(0.02),
        },
        material: Material {
            model: &palpate_model::materials::ALL[0],
            inertia: Inertia::Density(1000.0),
            youngs_modulus,
            poisson_ratio: 0.45,
            mass_damping: 0.1,
            stiffness_damping: 0.002,
            viscosity: None,
        },
        gravity: DVec3::new(0.0, 0.0, -9.81),
        clamps: Vec::new(),
        planes: vec![Plane { point: DVec3::ZERO, normal: DVec3::Z, stiffness: None }],
        masses: Vec::new(),
        effects: Vec::new(),
        fields: Vec::new(),
        curves: Default::default(),
        initial: Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state: InitialShape::Rest },
        time: Time { step: 0.01, steps: 40, start: 0.0, ..Time::weighted(0.6) },
        solver: Solver::default(),
        observation: None,
        targets: Vec::new(),
        synthesis: Synthesis::default(),
        tracking: palpate_model::scene::Tracking::default(),
        fit: None,
    }
}

/// A simulation as far as it went.
pub(crate) struct Ran {
    /// Steps that were solved before the first failure.
    pub solved: usize,
    pub failure: Option<Failure>,
    /// Displacement then [m].
    pub u: Vec<DVec3>,
    pub effort: Effort,
}

/// Simulates to the end, or to the first failure.
pub(crate) fn run(plan: &Plan) -> Ran {
    run_in(World::new(plan), plan)
}

/// The same in a world of the plan.
pub(crate) fn run_in(mut world: World, plan: &Plan) -> Ran {
    let backend = CpuBackend;
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &Request::default());
    let (mut now, mut next) = (backend.new_state(&world), backend.new_state(&world));
    backend.start(&mut world, &mut now, &mut tally);
    let (mut solved, mut failure) = (0, None);
    while solved < plan.clock.steps && failure.is_none() {
        backend.step(&mut world, &plan.clock.stages()[solved], &[&now], &mut next, &mut tally);
        failure = backend.read(&world, &tally).remove(0).failure;
        if failure.is_none() {
            solved += 1;
            std::mem::swap(&mut now, &mut next);
        }
    }
    Ran { solved, failure, u: now.members.swap_remove(0).u, effort: world.effort(0) }
}

#[test]
fn a_torus_that_bears_its_weight_is_solved_to_the_end() {
    let Ran { solved, failure, .. } = run(&torus(5000.0));
    assert!(failure.is_none(), "{solved} of 40 steps: {failure:?}");
}

#[test]
fn a_torus_that_its_weight_crushes_is_solved_to_the_end() {
    for youngs_modulus in [500.0, 1000.0, 2000.0] {
        let Ran { solved, failure, .. } = run(&torus(youngs_modulus));
        assert!(failure.is_none(), "{youngs_modulus} Pa: {solved} of 40 steps: {failure:?}");
    }
}

#[test]
fn derivatives_of_a_crushed_step_agree() {
    let mut plan = torus(1000.0);
    // Exact linear solves: what differs is the derivatives' own.
    plan.solver.linear = LinearSolver::Cholesky;
    let mut world = World::new(&plan);
    world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let World { shared, members } = &mut world;
    let member = &mut members[0];
    let n = plan.body.nodes.len();
    let blank = || MemberState { u: zeros(n), v: zeros(n) };
    let (mut now, mut next) = (blank(), blank());
    simulate::start(shared, member, &mut now).unwrap();
    let (stages, last) = (plan.clock.stages(), 29);
    for k in 0..=last {
        if k > 0 {
            std::mem::swap(&mut now, &mut next);
        }
        simulate::step(shared, member, &stages[k], &[&now], &mut next).unwrap();
    }
    let pose = |e: usize| CellPose::new(&corners(&plan.body, e, &next.u), plan.body.cut().grid.h);
    let guarded = (0..plan.body.cells().len()).filter(|e| pose(*e).guard().is_some()).count();
    assert!(guarded > 0, "no cell is turned inside out far enough");
    let directions: Vec<usize> = (0..plan.layout.len()).collect();
    let rates = simulate::rates(shared, member, &Direction::parameters(&directions));
    let blanks = || vec![zeros(n); directions.len()];
    let along = Arc::new(Direction::parameters(&directions));
    let tangents = || MemberTangent { directions: along.clone(), rates: rates.clone(), du: blanks(), dv: blanks() };
    let mut moved = tangents();
    simulate::step_tangent(shared, member, &stages[last], &[&now], &next, &[&tangents()], &mut moved).unwrap();
    let wave = |scale: f64| {
        (0..n).map(|i| scale * DVec3::new((i as f64).sin(), (2.0 * i as f64).cos(), (3.0 * i as f64).sin())).collect()
    };
    let (adj, mut adj_now) = (MemberState { u: wave(1.0), v: wave(0.01) }, blank());
    let wanted = vec![true; plan.layout.len()];
    let mut found = Gradient::new(&plan, wanted.clone());
    let past = &mut [&mut adj_now];
    simulate::step_adjoint(shared, member, &stages[last], &[&now], &next, &adj, past, &mut found).unwrap();
    let mut gradient = vec![0.0; plan.layout.len()];
    member.coefficients.pull_back(&plan, &found.coefficients, &wanted, &mut gradient);
    for p in directions {
        let forward = dot(&adj.u, &moved.du[p]) + dot(&adj.v, &moved.dv[p]);
        // Rounding through a matrix with a condition number of about 1e5.
        assert!(
            (forward - gradient[p]).abs() <= 1e-9 * forward.abs(),
            "{}: {forward} {}",
            plan.layout.keys[p].spec().path,
            gradient[p]
        );
    }
}
