//! Element and clamp matrices of a plan at one Poisson ratio: the one truth that every backend reads.

use crate::body::Body;
use crate::element::CellMatrices;
use crate::material::{lame, lame_by_nu};
use crate::plan::{ClampCell, ClampSite, Plan};
use std::collections::BTreeMap;

/// Nitsche's surface penalty, in units of (λ + 2μ)/h. The mean-strain traction of a full cell needs 2; a cell that is cut down
/// to a tenth needs 20; below that the traction terms are faded out (see [`clamp_matrix`]).
const CLAMP_SURFACE: f64 = 20.0;
/// Penalty of the held volume, in units of (λ + 2μ)/h².
const CLAMP_VOLUME: f64 = 10.0;

/// Which elements of a body need a matrix of their own; depends on the geometry only.
#[derive(Debug)]
pub struct Classes {
    /// Class of each cell.
    pub of_cell: Vec<u32>,
    weights: Vec<([f64; 27], f64)>,
}

impl Classes {
    /// Groups cells with equal weights (all full cells, and cells cut alike).
    pub fn new(body: &Body) -> Classes {
        let mut known: BTreeMap<Vec<u64>, u32> = BTreeMap::new();
        let mut weights = Vec::new();
        let of_cell = body
            .cells
            .iter()
            .map(|cell| {
                let key = cell.weights.iter().map(|w| w.to_bits()).collect();
                *known.entry(key).or_insert_with(|| {
                    weights.push((cell.weights, cell.fraction));
                    weights.len() as u32 - 1
                })
            })
            .collect();
        Classes { of_cell, weights }
    }
}

/// Matrices for Young's modulus 1 Pa and one Poisson ratio; all scale linearly with Young's modulus.
#[derive(Debug)]
pub struct Elements {
    /// Poisson's ratio.
    pub nu: f64,
    matrices: Vec<CellMatrices>,
    of_cell: Vec<u32>,
    /// Per clamp and clamp cell: Nitsche's matrix and its derivative by ν.
    pub clamps: Vec<Vec<CellMatrices>>,
    /// Shear modulus μ at E = 1, and its derivative by ν (ghost penalty).
    pub shear: [f64; 2],
}

impl Elements {
    /// Computes the matrices of a plan at a Poisson ratio.
    pub fn new(plan: &Plan, classes: &Classes, nu: f64) -> Elements {
        use rayon::prelude::*;
        let h = plan.body.grid.h;
        let matrices = classes
            .weights
            .par_iter()
            .map(|(weights, fraction)| CellMatrices::new(plan.solver.element, h, weights, *fraction, nu))
            .collect();
        let clamps = plan.clamps.iter().map(|c| clamp_matrices(&plan.body, c, nu)).collect();
        Elements { nu, matrices, of_cell: classes.of_cell.clone(), clamps, shear: [lame(1.0, nu).1, lame_by_nu(1.0, nu).1] }
    }

    /// Matrices of cell e.
    pub fn cell(&self, e: usize) -> &CellMatrices {
        &self.matrices[self.of_cell[e] as usize]
    }
}

fn clamp_matrices(body: &Body, clamp: &ClampSite, nu: f64) -> Vec<CellMatrices> {
    let (l, m) = lame(1.0, nu);
    let (dl, dm) = lame_by_nu(1.0, nu);
    clamp
        .cells
        .iter()
        .map(|c| {
            let fraction = body.cells[c.cell as usize].fraction;
            CellMatrices {
                k: Box::new(clamp_matrix(c, body.grid.h, fraction, l, m)),
                k_nu: Box::new(clamp_matrix(c, body.grid.h, fraction, dl, dm)),
            }
        })
        .collect()
}

/// Nitsche's symmetric terms of one cell, linear in (λ, μ): −T − Tᵀ + penalty (Nitsche 1971; the penalty's sign is plus).
///
/// The traction is that of the cell's mean strain: bounded by the element's energy whatever modes it condenses, so the
/// penalty that keeps the matrix positive does not depend on Poisson's ratio.
fn clamp_matrix(c: &ClampCell, h: f64, fraction: f64, lambda: f64, mu: f64) -> [f64; 576] {
    let fade = (fraction / 0.1).min(1.0);
    let stiff = lambda + 2.0 * mu;
    let traction = |i: usize, j: usize, row: usize, col: usize| {
        let (n, g) = (c.surface_normal[i], c.mean_gradient[j]);
        let same = if row == col { mu * g.dot(n) } else { 0.0 };
        fade * (lambda * n[row] * g[col] + mu * g[row] * n[col] + same)
    };
    let mut k = [0.0; 576];
    for i in 0..8 {
        for j in 0..8 {
            let penalty = stiff * (CLAMP_SURFACE / h * c.surface_mass[i][j] + CLAMP_VOLUME / (h * h) * c.volume_mass[i][j]);
            for row in 0..3 {
                for col in 0..3 {
                    let own = if row == col { penalty } else { 0.0 };
                    k[24 * (3 * i + row) + 3 * j + col] = own - traction(i, j, row, col) - traction(j, i, col, row);
                }
            }
        }
    }
    k
}
