//! Simulations that cannot go on: exit code 1 and one line with what happened, when, at which values, and what may help.

use super::{SCENE, changed, folder, refused, write};
use support::command::arg;

/// What the simulation of the scene with these tables before `[time]` fails with.
fn failure(tables: &str, poisson_ratio: &str) -> String {
    let folder = folder();
    // One solve a step, so that what fails is at its end.
    let text = changed(SCENE, "[time]", &format!("{tables}\n\n[time]\nscheme = \"theta\""));
    let path = write(folder.path(), &changed(&text, "poisson_ratio = 0.45", &format!("poisson_ratio = {poisson_ratio}")));
    refused(&["simulate", arg(&path), "--backend", "cpu", "--out", arg(&folder.path().join("out"))], 1)
}

#[test]
fn a_newton_method_that_stalls() {
    let e = failure("[initial]\nvelocity = [0, 0, -5]\n\n[solver]\nnewton_iterations = 1", "0.45");
    assert!(e.starts_with("the nonlinear solve of a step did not converge at t = 0.01 s: 1 iterations took"), "{e}");
    // Values with their units, and none where the unit is 1.
    let values = "material.youngs_modulus = 200000 Pa, material.poisson_ratio = 0.45, material.density = 1070 kg/m³, \
                  world.gravity.z = -9.81 m/s², initial.velocity.z = -5 m/s (hint: ";
    assert!(e.contains(values), "{e}");
    assert!(e.ends_with("(hint: use a smaller [time] step, or allow more solver.newton_iterations)"), "{e}");
}

#[test]
fn numbers_that_overflow() {
    let e = failure("[initial]\nvelocity = [0, 0, 1e200]", "0.45");
    assert!(e.starts_with("a number became infinite or undefined at t = 0.01 s: "), "{e}");
    assert!(e.contains("initial.velocity.z = 1e200 m/s (hint: use a smaller [time] step, or narrower bounds"), "{e}");
}

#[test]
fn a_matrix_that_cannot_be_solved_with() {
    // So nearly incompressible that rounding takes the matrix's definiteness, which both solvers notice.
    for linear in ["cg", "cholesky"] {
        let e = failure(&format!("[solver]\nlinear = \"{linear}\""), "0.4999999999999999");
        assert!(e.starts_with("the linear solve of a step failed at t = 0.01 s: "), "{e}");
        assert!(e.contains("material.poisson_ratio = 0.5, ") && e.ends_with("poisson_ratio further below 0.5)"), "{e}");
    }
}

#[test]
fn a_body_that_leaves_the_world() {
    let e = failure("[initial]\nvelocity = [0, 0, 1e7]", "0.45");
    assert!(e.starts_with("the body left the world at t = 0.01 s: a node moved 100000 m"), "{e}");
    assert!(e.contains("initial.velocity.z = 10000000 m/s (hint: check gravity, planes and initial velocity"), "{e}");
}
