//! Nearly empty cells spoil neither conditioning nor solution: a face slides through a cell.

use super::effects_materials::effect;
use faer::{Mat, Side};
use glam::{DAffine3, DMat3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch, Request};
use palpate_model::plan::Plan;
use palpate_model::scene::*;
use support::scenes;

const H: f64 = 0.01;

/// Plan of a scene at rest under its loads, eigenvalues of its Jacobi-scaled stiffness there, and displacement.
fn spectrum(s: &Scene) -> (Plan, Vec<f64>, Vec<DVec3>) {
    let plan = scenes::plan(s);
    let backend = CpuBackend;
    let mut world = backend.build(&plan, 1).unwrap();
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut state = backend.new_state(&world);
    let mut tally = backend.new_tally(&world, &Request::default());
    backend.start(&mut world, &mut state, &mut tally);
    assert!(!backend.all_failed(&tally), "{:?}", backend.read(&world, &tally)[0].failure);
    let n = 3 * plan.body.nodes.len();
    let mut a = Mat::<f64>::zeros(n, n);
    for (i, j, b) in backend.stiffness(&mut world, &state, 0) {
        for r in 0..3 {
            for c in 0..3 {
                a[(3 * i + r, 3 * j + c)] = b.col(c)[r];
            }
        }
    }
    let d: Vec<f64> = (0..n).map(|i| a[(i, i)].sqrt()).collect();
    let scaled = Mat::from_fn(n, n, |i, j| a[(i, j)] / (d[i] * d[j]));
    let eigen = scaled.self_adjoint_eigenvalues(Side::Lower).unwrap();
    let u = backend.read_state(&world, &state, 0).0;
    (plan, eigen, u)
}

/// Condition number of the Jacobi-scaled stiffness, and the sag of the top face over that of a column of its height, for a
/// block of 2 × 2 cells that ends a fraction `cut` into its third layer, all of it turned against the lattice by `turn`.
fn block(cut: f64, turn: DMat3, ghost: f64) -> (f64, f64) {
    let top = (2.0 + cut) * H;
    let mut s = scenes::body(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(2.0 * H, 2.0 * H, top) }, H);
    s.object.pose = DAffine3::from_mat3(turn);
    let base = Clamp::still(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1e-5));
    s.clamps = vec![base.in_object_frame()];
    let up = turn * DVec3::Z;
    s.gravity = -up;
    s.material.poisson_ratio = 0.3;
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time.steps = 0;
    s.solver.ghost = ghost;
    let (plan, eigen, u) = spectrum(&s);
    let body = &plan.body;
    // Mean sag over the top face, from the patches that lie in it.
    let (mut sag, mut area) = (0.0, 0.0);
    for (p, place) in body.pieces().filter(|(p, _)| p.normal.dot(up) > 0.9) {
        sag -= p.area * place.at(&u).dot(up);
        area += p.area;
    }
    (eigen[eigen.len() - 1] / eigen[0], sag / area / (1000.0 * top * top / (2.0 * 5000.0)))
}

#[test]
fn condition_and_solution_are_bounded_as_a_face_slides_through_a_cell() {
    let cuts = [1e-7, 1e-5, 1e-3, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0];
    let table: Vec<(f64, f64)> = cuts.iter().map(|&c| block(c, DMat3::IDENTITY, Solver::default().ghost)).collect();
    for (c, (condition, sag)) in cuts.iter().zip(&table) {
        println!("cut at {c:8.1e}: condition {condition:8.1}, sag over a column's {sag:.4}");
    }
    let (two, three) = (table[0], table[cuts.len() - 1]);
    // A thin layer hangs on by the ghost penalty: scaled by the diagonal it is no worse than a full layer.
    assert!(table.iter().all(|t| t.0 < 1.5 * three.0), "condition bounded");
    // The held base makes the block a little stiffer than a free column, less so the higher it is: by 2 % from two layers to three. In
    // between the sag goes along, but for what the ghost penalty does to a part of a layer: a fifth of that change.
    for (cut, t) in cuts.iter().zip(&table) {
        let between = two.1 + cut * (three.1 - two.1);
        assert!((t.1 - between).abs() < 0.2 * (three.1 - two.1), "cut at {cut}: {} instead of {between}", t.1);
    }
    // The test can fail: without the penalty a thin layer is many orders softer than the rest.
    assert!(block(1e-3, DMat3::IDENTITY, 0.0).0 > 10.0 * table[2].0);
}

#[test]
fn condition_and_solution_are_bounded_as_an_oblique_face_slides_through_the_lattice() {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, -0.5, 0.3).normalize(), 0.7);
    let at = |cut: f64, ghost: f64| block(cut, turn, ghost);
    let cuts: Vec<f64> = (0..=10).map(|k| f64::from(k) / 10.0).collect();
    let table: Vec<(f64, f64)> = cuts.iter().map(|&c| at(c, Solver::default().ghost)).collect();
    for (c, (condition, sag)) in cuts.iter().zip(&table) {
        println!("oblique, cut at {c:.1}: condition {condition:8.1}, sag over a column's {sag:.4}");
    }
    let (two, three) = (table[0], table[10]);
    // Slivers of every thickness are cut at once. The condition grows from two layers to three as the height's fourth power does in
    // bending, (3/2)⁴ = 5, at most, so by less than a fifth from one cut to the next unless a sliver sticks out; bounds as above.
    let full = block(1.0, DMat3::IDENTITY, Solver::default().ghost).0;
    assert!(table.iter().all(|t| t.0 < 1.5 * full), "condition bounded");
    assert!(table.windows(2).all(|w| w[1].0 < 1.2 * w[0].0 && w[1].0 > w[0].0 / 1.2), "condition without peaks");
    for (cut, t) in cuts.iter().zip(&table) {
        let between = two.1 + cut * (three.1 - two.1);
        assert!((t.1 - between).abs() < 0.2 * (three.1 - two.1), "cut at {cut}: {} instead of {between}", t.1);
    }
    assert!(at(0.5, 0.0).0 > 10.0 * table[5].0, "the test can fail");
}

#[test]
fn a_clamp_keeps_the_stiffness_positive_wherever_its_faces_cut_the_lattice() {
    let mut table = Vec::new();
    for layer in [0.0, 0.0015, 0.02] {
        for edge in [0.0, 0.02, 0.05, 0.1, 0.3, 0.5, 0.9, 0.97, 0.99] {
            let mut s = scenes::body(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, -0.002, 0.06) }, 0.022);
            let at = 0.022 * (1.0 + edge);
            s.clamps = vec![Clamp::still(DVec3::new(-0.1, at, 0.0), DVec3::new(0.1, 0.1, 0.2))];
            s.initial.state = InitialShape::StaticEquilibrium;
            s.time.steps = 0;
            s.material.youngs_modulus = 1e5;
            if layer > 0.0 {
                s.effects = vec![effect("compliant-clamp", &[("layer", &[layer])])];
            }
            let eigen = spectrum(&s).1;
            println!("layer {layer} m, edge at {edge} of a cell: {:.1e} to {:.1e}", eigen[0], eigen[eigen.len() - 1]);
            table.push(eigen[0]);
        }
    }
    assert!(table.iter().all(|e| *e > 1e-5), "{table:?}");
}
