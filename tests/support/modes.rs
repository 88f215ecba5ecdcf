//! Modes of vibration of a plan's body at rest, from its stiffness and its masses alone: no time step takes part.

use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::plan::{Physics, Plan};

/// A mode of vibration.
pub struct Mode {
    /// Circular frequency [rad/s].
    pub omega: f64,
    /// Displacements of the nodes, with `shape` · M `shape` = 1 [kg^-½].
    pub shape: Vec<DVec3>,
    /// M `shape` [kg^½].
    pub momentum: Vec<DVec3>,
}

impl Mode {
    /// How much of the mode is in a displacement [m kg^½].
    pub fn of(&self, u: &[DVec3]) -> f64 {
        dot(&self.momentum, u)
    }
}

/// M u: lumped masses of the body and consistent ones of point masses.
fn momentum(plan: &Plan, physics: &Physics, u: &[DVec3]) -> Vec<DVec3> {
    let mut p: Vec<DVec3> = plan.body.node_volume.iter().zip(u).map(|(w, u)| physics.density * *w * *u).collect();
    for (site, m) in plan.masses.iter().zip(&physics.masses) {
        site.spread(*m * site.at(u), &mut p);
    }
    p
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// The slowest mode that a uniform pull along `direction` stirs, by inverse iteration, of a body that clamps hold.
pub fn first(plan: &Plan, direction: DVec3) -> Mode {
    let backend = CpuBackend;
    let mut world = backend.build(plan, 1).unwrap();
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    // All zero: the shape at rest.
    let state = backend.new_state(&world);
    let n = plan.body.nodes.len();
    let mut entries = Vec::new();
    for (i, j, b) in backend.stiffness(&mut world, &state, 0) {
        for (r, c) in (0..9).map(|k| (k / 3, k % 3)).filter(|(r, c)| 3 * i + r >= 3 * j + c) {
            entries.push(Triplet::new(3 * i + r, 3 * j + c, b.col(c)[r]));
        }
    }
    let stiffness = SparseColMat::try_new_from_triplets(3 * n, 3 * n, &entries).unwrap();
    let factor = stiffness.sp_cholesky(Side::Lower).expect("a held body resists every motion");
    let physics = Physics::new(&plan.layout, &plan.theta);
    let normalise = |u: Vec<DVec3>| -> (Vec<DVec3>, Vec<DVec3>) {
        let p = momentum(plan, &physics, &u);
        let scale = dot(&u, &p).sqrt().recip();
        (u.iter().map(|u| scale * *u).collect(), p.iter().map(|p| scale * *p).collect())
    };
    let mut p = normalise(vec![direction; n]).1;
    let mut omega = 0.0f64;
    // Every pass takes what other modes hold down by the square of the ratio of frequencies: 40 for a cantilever's next one.
    for _ in 0..60 {
        let mut x = Mat::from_fn(3 * n, 1, |i, _| p[i / 3][i % 3]);
        factor.solve_in_place(&mut x);
        let u: Vec<DVec3> = (0..n).map(|i| DVec3::new(x[(3 * i, 0)], x[(3 * i + 1, 0)], x[(3 * i + 2, 0)])).collect();
        // Rayleigh's quotient uᵀKu / uᵀMu, where K u = p.
        let now = (dot(&u, &p) / dot(&u, &momentum(plan, &physics, &u))).sqrt();
        let (shape, next) = normalise(u);
        p = next;
        if (now / omega - 1.0).abs() < 1e-12 {
            return Mode { omega: now, shape, momentum: p };
        }
        omega = now;
    }
    panic!("inverse iteration has not converged: {omega}");
}
