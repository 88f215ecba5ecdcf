//! Which linear solver a time step gets, and that the answer does not depend on it.

use crate::collapse_tests::{Ran, run, scene};
use palpate_model::observation::Observation;
use palpate_model::plan_build::build_plan;
use palpate_model::scene::{LinearSolver, Resolution};

/// A torus on the ground after six steps.
fn steps_of(step: f64, linear: LinearSolver) -> Ran {
    let mut scene = scene(5e4);
    scene.object.resolution = Resolution::CellSize(0.03);
    (scene.time.step, scene.time.steps, scene.solver.linear) = (step, 6, linear);
    // On the ground from the first step on.
    scene.planes[0].point.z = 0.05;
    let plan = build_plan(&scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let ran = run(&plan);
    assert!(ran.failure.is_none(), "{:?}", ran.failure);
    ran
}

#[test]
fn short_steps_iterate_and_long_ones_factorise() {
    for (step, iterates) in [(0.002, true), (0.1, false)] {
        let Ran { u, effort, .. } = steps_of(step, LinearSolver::Auto);
        assert_eq!(effort.linear > 0, iterates, "steps of {step} s: {effort:?}");
        let Ran { u: v, effort: direct, .. } = steps_of(step, LinearSolver::Cholesky);
        assert_eq!(direct.linear, 0);
        let largest = u.iter().map(|u| u.length()).fold(0.0, f64::max);
        let apart = u.iter().zip(&v).map(|(u, v)| u.distance(*v)).fold(0.0, f64::max);
        // Six steps, each solved to the scene's tolerance of its forces.
        assert!(apart < 1e-5 * largest, "{apart} m of {largest} m");
    }
}
