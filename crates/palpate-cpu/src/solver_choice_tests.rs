//! Which linear solver a time step gets, that the answer does not depend on it, and what is said where one does not come to an end.

use crate::collapse_tests::{Ran, run, run_in, scene};
use crate::world::World;
use palpate_engine::FailureKind;
use palpate_model::observation::Observation;
use palpate_model::plan::build::build_plan;
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

#[test]
fn a_solve_that_does_not_converge_stops_the_run_and_says_where() {
    let mut scene = scene(5e4);
    scene.object.resolution = Resolution::CellSize(0.03);
    (scene.time.step, scene.time.steps) = (0.01, 20);
    scene.solver.linear = LinearSolver::ConjugateGradient;
    let plan = build_plan(&scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut world = World::new(&plan);
    // Too few for the first step.
    world.shared.solvers.most = 3;
    let Ran { solved, failure, .. } = run_in(world, &plan);
    let failure = failure.expect("three iterations are too few");
    assert!(solved < 20 && failure.kind == FailureKind::LinearSolve, "{solved} steps, {failure}");
    assert!((failure.time - 0.01 * (solved + 1) as f64).abs() < 1e-12, "{solved} steps, {failure}");
    let text = failure.to_string();
    for word in [
        "conjugate gradients stopped at a relative residual of ",
        "at t = 0.",
        "material.youngs_modulus = 50000 Pa",
        "material.poisson_ratio = 0.45",
        "world.gravity.z = -9.81 m/s²",
        "(hint: set solver.linear = \"cholesky\"",
    ] {
        assert!(text.contains(word), "\"{word}\" is not in: {text}");
    }
    println!("after {solved} steps: {text}");
}
