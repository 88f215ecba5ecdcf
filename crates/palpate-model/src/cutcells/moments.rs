//! Lumped volumes whose second moments are the body's: a rigid body of nodes with the right moment of inertia.
//!
//! Row sums of the shape functions put the volume of a cell into its corners. Volume and centre are right, but the second moment
//! along each axis comes out too large by V h²/6: a ball on cells of a quarter of its radius turns with 5 % too much inertia. Every
//! nodal volume is therefore multiplied by 1 + q(x) with the quadratic polynomial q of least Σ V q² that mends the second moments and
//! leaves volume and centre (in one dimension and with two cells this is Simpson's rule). Masses stay diagonal and positive. That is
//! for bodies that may turn: where a clamp holds one, row sums are better, for they share a weight out as linear elements want it, and a
//! column under its weight has the right sag at every node.

use crate::cutcells::cut::POINTS27;
use crate::space::body::Body;
use glam::DVec3;

/// Number of monomials up to degree two.
const MONOMIALS: usize = 10;

/// A monomial whose part that is new at the nodes has about this share of its square counts half, one with less fades out: across a body
/// one cell thick x² is a constant at the nodes, and no volumes there have the right moment.
const NEW: f64 = 1e-3;

/// Least factor of a nodal volume.
const LEAST: f64 = 0.1;

fn monomials(x: DVec3) -> [f64; MONOMIALS] {
    [1.0, x.x, x.y, x.z, x.x * x.x, x.y * x.y, x.z * x.z, x.x * x.y, x.y * x.z, x.z * x.x]
}

impl Body {
    /// Makes the second moments of `node_volume` those of the body.
    pub fn mend_moments(&mut self) {
        let (grid, h) = (&self.cut().grid, self.cut().grid.h);
        let of = |x: DVec3, v: f64| (x - self.center) * (x - self.center) * v;
        let cells = self.cells().iter().flat_map(|c| {
            let low = grid.position(c.lattice);
            (0..27).map(move |q| of(low + POINTS27[q] * h, c.weights[q] * h.powi(3)))
        });
        let second = cells.sum();
        let factors = factors(&self.nodes, &self.node_volume, self.center, second);
        self.node_volume.iter_mut().zip(factors).for_each(|(v, factor)| *v *= factor);
    }
}

/// Factors `[N]` of the nodal volumes `volumes` [m³] at `nodes` [m], about `center` [m]; `second` is ∫ (x − center)² dV by component [m⁵].
fn factors(nodes: &[DVec3], volumes: &[f64], center: DVec3, second: DVec3) -> Vec<f64> {
    let volume: f64 = volumes.iter().sum();
    let size = (second.element_sum() / volume).sqrt();
    let values: Vec<[f64; MONOMIALS]> = nodes.iter().map(|x| monomials((*x - center) / size)).collect();
    let product = |f: &dyn Fn(usize) -> f64| -> f64 { volumes.iter().enumerate().map(|(i, v)| v * f(i)).sum::<f64>() / volume };
    let missing: [f64; MONOMIALS] = std::array::from_fn(|k| match k {
        4..=6 => second[k - 4] / (volume * size * size) - product(&|i| values[i][k]),
        _ => 0.0,
    });
    let mut q = vec![0.0; nodes.len()];
    // Orthonormal polynomials (Gram–Schmidt), each with what it is to be the product with.
    let mut basis: Vec<(Vec<f64>, f64)> = Vec::new();
    for k in 0..MONOMIALS {
        let mut e: Vec<f64> = values.iter().map(|v| v[k]).collect();
        let whole = product(&|i| e[i] * e[i]);
        let mut owed = missing[k];
        for (b, mends) in &basis {
            let along = product(&|i| e[i] * b[i]);
            e.iter_mut().zip(b).for_each(|(e, b)| *e -= along * b);
            owed -= along * mends;
        }
        let left = product(&|i| e[i] * e[i]);
        let new = left / whole;
        // Rounding of a monomial that is not new at all.
        if new < 1e-12 {
            continue;
        }
        e.iter_mut().for_each(|e| *e /= left.sqrt());
        owed *= new * new / ((new * new + NEW * NEW) * left.sqrt());
        q.iter_mut().zip(&e).for_each(|(q, e)| *q += owed * e);
        basis.push((e, owed));
    }
    let lowest = q.iter().copied().fold(0.0, f64::min);
    let share = if lowest < LEAST - 1.0 { (LEAST - 1.0) / lowest } else { 1.0 };
    q.iter().map(|q| 1.0 + share * q).collect()
}
