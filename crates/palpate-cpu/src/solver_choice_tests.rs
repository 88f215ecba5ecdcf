//! Which linear solver a time step gets, and that the answer does not depend on it.

use crate::CpuBackend;
use crate::collapse_tests::scene;
use crate::newton::Effort;
use glam::DVec3;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::observation::Observation;
use palpate_model::plan_build::build_plan;
use palpate_model::scene::{LinearSolver, Resolution};

/// Displacements after six steps, and the work that they took.
fn run(step: f64, linear: LinearSolver) -> (Vec<DVec3>, Effort) {
    let mut scene = scene(5e4);
    scene.object.resolution = Resolution::CellSize(0.03);
    (scene.time.step, scene.time.steps, scene.solver.linear) = (step, 6, linear);
    // On the ground from the first step on.
    scene.planes[0].point.z = 0.05;
    let plan = build_plan(&scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let backend = CpuBackend;
    let mut world = backend.build(&plan, 1).unwrap();
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &[]);
    let (mut now, mut next) = (backend.new_state(&world), backend.new_state(&world));
    backend.start(&mut world, &mut now, &mut tally);
    for k in 0..plan.clock.steps {
        backend.step(&mut world, k, &now, &mut next, &mut tally);
        std::mem::swap(&mut now, &mut next);
    }
    (now.members[0].u.clone(), world.effort(0))
}

#[test]
fn short_steps_iterate_and_long_ones_factorise() {
    for (step, iterates) in [(0.002, true), (0.1, false)] {
        let (u, effort) = run(step, LinearSolver::Auto);
        assert_eq!(effort.linear > 0, iterates, "steps of {step} s: {effort:?}");
        let (v, direct) = run(step, LinearSolver::Cholesky);
        assert_eq!(direct.linear, 0);
        let largest = u.iter().map(|u| u.length()).fold(0.0, f64::max);
        let apart = u.iter().zip(&v).map(|(u, v)| u.distance(*v)).fold(0.0, f64::max);
        // Six steps, each solved to the scene's tolerance of its forces.
        assert!(apart < 1e-5 * largest, "{apart} m of {largest} m");
    }
}
