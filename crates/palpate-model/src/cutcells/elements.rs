//! Element and clamp matrices of a plan at one Poisson ratio: the one truth that every backend reads.

use crate::cutcells::domain::Cell;
use crate::cutcells::element::CellMatrices;
use crate::cutcells::held::FreePart;
use crate::mechanics::lame::{lame, lame_by_nu};
use crate::plan::{ClampCell, Plan};
use crate::space::body::Body;
use glam::DVec3;
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
    /// What deforms in the cells of each class.
    pub parts: Vec<FreePart>,
    /// Mean of the gradients of the corners' shape functions over what deforms in the cells of each class [1/m].
    pub gradients: Vec<[DVec3; 8]>,
    /// Fraction of every cell that deforms; where none does, and the matrix is zero, the fraction inside the body.
    pub fractions: Vec<f64>,
}

impl Classes {
    /// Groups cells with equal weights (all full cells, and cells cut alike) that are held alike.
    pub fn new(plan: &Plan) -> Classes {
        let mut known: BTreeMap<Vec<u64>, u32> = BTreeMap::new();
        let mut parts = Vec::new();
        let mut free: Vec<FreePart> = plan.body.cells().iter().map(FreePart::of).collect();
        for c in plan.clamps.iter().flat_map(|site| &site.cells) {
            free[c.cell as usize].take(&c.held);
        }
        let fraction = |(cell, part): (&Cell, &FreePart)| if part.fraction > 0.0 { part.fraction } else { cell.fraction };
        let fractions = plan.body.cells().iter().zip(&free).map(fraction).collect();
        let of_cell = free
            .into_iter()
            .map(|part| {
                let key = part.weights.iter().map(|w| w.to_bits()).collect();
                *known.entry(key).or_insert_with(|| {
                    parts.push(part);
                    parts.len() as u32 - 1
                })
            })
            .collect();
        let gradients = parts.iter().map(|part| part.mean_gradient(plan.body.cut().grid.h)).collect();
        Classes { of_cell, parts, gradients, fractions }
    }
}

/// Matrices for Young's modulus 1 Pa and one Poisson ratio; all scale linearly with Young's modulus.
#[derive(Debug)]
pub struct Elements {
    /// Poisson's ratio.
    pub nu: f64,
    /// One per class of [`Classes`].
    pub matrices: Vec<CellMatrices>,
    of_cell: Vec<u32>,
    gradients: Vec<[DVec3; 8]>,
    /// Fraction of every cell that the laws of cells act in ([`Classes::fractions`]).
    pub fractions: Vec<f64>,
    /// Per clamp and clamp cell: Nitsche's matrix and its derivative by ν.
    pub clamps: Vec<Vec<CellMatrices>>,
    /// Shear modulus μ at E = 1, and its derivative by ν (ghost penalty).
    pub shear: [f64; 2],
}

impl Elements {
    /// Computes the matrices of a plan at a Poisson ratio.
    pub fn new(plan: &Plan, classes: &Classes, nu: f64) -> Elements {
        use rayon::prelude::*;
        let matrices = classes.parts.par_iter().map(|part| cell_matrices(plan, part, nu)).collect();
        let clamps = plan.clamps.iter().map(|s| s.cells.iter().map(|c| clamp_matrices(&plan.body, c, nu)).collect()).collect();
        let (of_cell, gradients, fractions) = (classes.of_cell.clone(), classes.gradients.clone(), classes.fractions.clone());
        Elements { nu, matrices, of_cell, gradients, fractions, clamps, shear: [lame(1.0, nu).1, lame_by_nu(1.0, nu).1] }
    }

    /// Matrices of cell e.
    pub fn cell(&self, e: usize) -> &CellMatrices {
        &self.matrices[self.of_cell[e] as usize]
    }

    /// Gradient weights of cell e's mean strain [1/m]. Modes that an element adds have no mean strain, so its energy is at least that of the
    /// mean strain (Jensen's inequality), and the matrix without it is still positive semi-definite.
    #[inline(always)]
    pub fn gradient(&self, e: usize) -> &[DVec3; 8] {
        &self.gradients[self.of_cell[e] as usize]
    }
}

/// Matrices of the part of a cell that deforms, for E = 1 Pa.
pub fn cell_matrices(plan: &Plan, part: &FreePart, nu: f64) -> CellMatrices {
    CellMatrices::new(plan.solver.element, plan.body.cut().grid.h, &part.weights, part.fraction, nu)
}

/// Nitsche's matrix of one clamp cell for E = 1 Pa, and its derivative by ν.
pub fn clamp_matrices(body: &Body, c: &ClampCell, nu: f64) -> CellMatrices {
    let (h, free) = (body.cut().grid.h, c.free(body).fraction);
    let make = |(l, m)| Box::new(clamp_matrix(c, h, free, l, m));
    CellMatrices { k: make(lame(1.0, nu)), k_nu: make(lame_by_nu(1.0, nu)) }
}

/// Nitsche's symmetric terms of one cell, linear in (λ, μ): −T − Tᵀ + penalty (Nitsche 1971; the penalty's sign is plus).
///
/// The traction is that of the cell's mean strain: bounded by the element's energy whatever modes it condenses, so the
/// penalty that keeps the matrix positive does not depend on Poisson's ratio.
fn clamp_matrix(c: &ClampCell, h: f64, free: f64, lambda: f64, mu: f64) -> [f64; 576] {
    let fade = (free / 0.1).min(1.0);
    let stiff = lambda + 2.0 * mu;
    let traction = |i: usize, j: usize, row: usize, col: usize| {
        let (n, g) = (c.surface_normal[i], c.mean_gradient[j]);
        let same = if row == col { mu * g.dot(n) } else { 0.0 };
        fade * (lambda * n[row] * g[col] + mu * g[row] * n[col] + same)
    };
    let mut k = [0.0; 576];
    for i in 0..8 {
        for j in 0..8 {
            let pinned = c.pins[i] * c.pins[j] * c.volume_mass[i][j];
            let penalty = stiff * (CLAMP_SURFACE / h * c.surface_mass[i][j] + CLAMP_VOLUME / (h * h) * pinned);
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

/// Matrix ∫ t(u)·t(v) / (λ + 2μ) of one clamp cell over its held surface, and its derivative by ν, with t the same traction as in
/// Nitsche's terms: what a compliant layer behind the surface adds (Juntunen & Stenberg, *Math. Comp.* 78, 2009), per metre of
/// layer and for 1 Pa. The surface's mean normal stands for the surface, which never overestimates the term.
pub fn layer_matrix(c: &ClampCell, free: f64, nu: f64) -> [Box<[f64; 576]>; 2] {
    let fade = (free / 0.1).min(1.0);
    let normal: DVec3 = c.surface_normal.iter().sum();
    let area: f64 = c.surface_mass.iter().flatten().sum();
    let ((l, m), (dl, dm)) = (lame(1.0, nu), lame_by_nu(1.0, nu));
    // Rows r of the traction by corner displacements, per square root of area.
    let rows = |l: f64, m: f64| {
        let mut t = [[0.0; 24]; 3];
        let scale = if area > 0.0 { fade / area.sqrt() } else { 0.0 };
        for (j, g) in c.mean_gradient.iter().enumerate() {
            for (r, row) in t.iter_mut().enumerate() {
                for k in 0..3 {
                    let same = if r == k { m * g.dot(normal) } else { 0.0 };
                    row[3 * j + k] = scale * (l * normal[r] * g[k] + m * g[r] * normal[k] + same);
                }
            }
        }
        t
    };
    let (t, dt) = (rows(l, m), rows(dl, dm));
    let (stiff, d_stiff) = (l + 2.0 * m, dl + 2.0 * dm);
    let mut out = [Box::new([0.0; 576]), Box::new([0.0; 576])];
    for i in 0..24 {
        for j in 0..24 {
            let (mut own, mut by_nu) = (0.0, 0.0);
            for r in 0..3 {
                own += t[r][i] * t[r][j];
                by_nu += dt[r][i] * t[r][j] + t[r][i] * dt[r][j];
            }
            out[0][24 * i + j] = own / stiff;
            out[1][24 * i + j] = by_nu / stiff - own * d_stiff / (stiff * stiff);
        }
    }
    out
}

/// Clamp matrix with a layer of thickness ℓ [m]: s (K − ℓ K₃) with s = 1/(1 + 20 ℓ/h); with `slope` its derivative by ℓ.
pub fn layered(k: &[f64; 576], k3: &[f64; 576], h: f64, layer: f64, slope: bool) -> [f64; 576] {
    let s = 1.0 / (1.0 + CLAMP_SURFACE * layer / h);
    let (a, b) = if slope { (-CLAMP_SURFACE / h * s * s, s * s) } else { (s, s * layer) };
    std::array::from_fn(|i| a * k[i] - b * k3[i])
}
