//! Order in space by a manufactured solution: the loads under which a displacement that is given would be in equilibrium.
//!
//! The weak form at the given u*, F_i = ∫ P(∇u*) ∇N_i, holds body force and traction of every u* in one. It is integrated over the true body by
//! Gauss points and brought to the residual of the CPU backend; springs to u* on every node, consistent with it, hold the free body.

use super::linear;
use super::report::{Requirement, Row};
use super::scenes;
use glam::{DMat3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::materials::ALL;
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, Time};

/// Gauss–Legendre points and weights on [−1, 1].
const GAUSS: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    [-0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
    [0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
];
/// Size of the displacement [m] on a body of a metre: strains of up to 15 %.
const SIZE: f64 = 0.04;

/// u* and its gradient H.
fn given(x: DVec3) -> (DVec3, DMat3) {
    let k = DVec3::new(2.1, 2.7, 3.3);
    let (s, c) =
        ([(k.x * x.x).sin(), (k.y * x.y).sin(), (k.z * x.z).sin()], [(k.x * x.x).cos(), (k.y * x.y).cos(), (k.z * x.z).cos()]);
    let u = SIZE * DVec3::new(s[0] * c[1], s[1] * c[2] + 0.5 * c[0], s[2] * c[0] + 0.7 * s[1]);
    let row = |a: f64, b: f64, d: f64| SIZE * DVec3::new(a, b, d);
    let h = DMat3::from_cols(
        row(k.x * c[0] * c[1], -k.y * s[0] * s[1], 0.0),
        row(-0.5 * k.x * s[0], k.y * c[1] * c[2], -k.z * s[1] * s[2]),
        row(-k.x * s[2] * s[0], 0.7 * k.y * c[1], k.z * c[2] * c[0]),
    );
    // Columns were the gradients of components.
    (u, h.transpose())
}

/// F_i over a box, cell by cell.
fn loads(plan: &Plan, model: usize, [min, max]: [DVec3; 2], [lambda, mu]: [f64; 2]) -> Vec<DVec3> {
    let body = &plan.body;
    let h = body.length;
    let mut all = vec![DVec3::ZERO; body.nodes.len()];
    for cell in body.cells() {
        let places = cell.nodes.map(|n| body.nodes[n as usize]);
        let corner = places.into_iter().reduce(DVec3::min).unwrap_or_default();
        let (low, high) = (corner.max(min), (corner + h).min(max));
        let half = 0.5 * (high - low).max(DVec3::ZERO);
        for [gx, gy, gz] in (0..64).map(|k| [GAUSS[k / 16], GAUSS[k / 4 % 4], GAUSS[k % 4]]) {
            let x = low + half * (DVec3::ONE + DVec3::new(gx[0], gy[0], gz[0]));
            let weight = gx[1] * gy[1] * gz[1] * half.element_product();
            let grad = given(x).1;
            let rows = [0, 1, 2].map(|i| grad.row(i).to_array());
            let p = ALL[model].law.stress(&rows, lambda, mu).0;
            let xi = (x - corner) / h;
            for (node, place) in cell.nodes.iter().zip(places) {
                let at = ((place - corner) / h).round();
                let value = |a: usize| if at[a] > 0.5 { xi[a] } else { 1.0 - xi[a] };
                let slope = |a: usize| (2.0 * at[a] - 1.0) / h;
                let g =
                    DVec3::new(slope(0) * value(1) * value(2), value(0) * slope(1) * value(2), value(0) * value(1) * slope(2));
                all[*node as usize] += weight
                    * DVec3::new(
                        p[0] * g.x + p[1] * g.y + p[2] * g.z,
                        p[3] * g.x + p[4] * g.y + p[5] * g.z,
                        p[6] * g.x + p[7] * g.y + p[8] * g.z,
                    );
            }
        }
    }
    all
}

/// Root mean square error over the mass, over the size of u*.
fn error(model: usize, corners: [DVec3; 2], cell: f64) -> Result<f64, String> {
    let [min, max] = corners;
    let mut s = scenes::body(Analytic::Box { min, max }, cell);
    s.material.model = &ALL[model];
    s.material.youngs_modulus = 1.0;
    let nu = s.material.poisson_ratio;
    let moduli = [nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 / (1.0 + nu)];
    // Row sums for masses: the springs are to be positive.
    s.time = Time { steps: 1, ..Time::weighted(0.6) };
    let plan = scenes::plan(&s)?;
    let mut world = CpuBackend.build(&plan, 1).map_err(|e| e.to_string())?;
    CpuBackend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let exact: Vec<DVec3> = plan.body.nodes.iter().map(|x| given(*x).0).collect();
    let loads = loads(&plan, model, corners, moduli);
    let springs = &plan.body.node_volume;
    let mut u = exact.clone();
    for _ in 0..20 {
        let (forces, blocks) = CpuBackend.statics(&mut world, &u, 0);
        let residual: Vec<DVec3> = (0..u.len()).map(|i| forces[i] + springs[i] * (u[i] - exact[i]) - loads[i]).collect();
        let factor = linear::factorise(&blocks, springs)?;
        let step = linear::solve(&factor, &residual);
        u.iter_mut().zip(&step).for_each(|(u, d)| *u -= *d);
        if step.iter().all(|d| d.length() < 1e-11 * SIZE) {
            let squares: f64 = (0..u.len()).map(|i| springs[i] * (u[i] - exact[i]).length_squared()).sum();
            return Ok((squares / plan.body.volume).sqrt() / SIZE);
        }
    }
    Err(format!("Newton's method has not converged on cells of {cell} m"))
}

/// The study.
///
/// # Errors
/// A system cannot be solved.
pub fn run() -> Result<Vec<Row>, String> {
    let whole = [DVec3::ZERO, DVec3::new(1.0, 0.75, 0.5)];
    let cut = [DVec3::new(0.031, 0.017, 0.043), DVec3::new(0.977, 0.761, 0.527)];
    let mut rows = Vec::new();
    for (model, (name, corners)) in [0, 1].into_iter().flat_map(|m| [("whole", whole), ("cut", cut)].map(|c| (m, c))) {
        let errors = [0.25, 0.125, 0.0625].map(|cell| error(model, corners, cell));
        let [a, b, c] = errors;
        let (a, b, c) = (a?, b?, c?);
        let what = |which: &str| format!("{}, {name} cells: order of displacements, {which}", ALL[model].name);
        let source = "two: trilinear displacements";
        // Cut cells change with the lattice from level to level, which moves single errors by a tenth.
        for (which, order) in [("4 to 8 cells", (a / b).log2()), ("8 to 16 cells", (b / c).log2())] {
            rows.push(Row::new(what(which), Requirement::AtLeast(1.8), order, "", source));
        }
        let requirement = Requirement::AtMost(0.01);
        rows.push(Row::new(
            format!("{}, {name} cells: error on 16 cells over the displacement", ALL[model].name),
            requirement,
            c,
            "",
            "stated",
        ));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_given_gradient_is_the_displacements() {
        let (x, d) = (DVec3::new(0.3, 0.6, 0.2), 1e-6);
        for a in 0..3 {
            let e = d * DVec3::AXES[a];
            let difference = (given(x + e).0 - given(x - e).0) / (2.0 * d);
            assert!((difference - given(x).1.col(a)).length() < 1e-9);
        }
    }
}
