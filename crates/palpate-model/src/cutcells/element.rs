//! Element matrices of a (cut) cell: linear isotropic elasticity about the rest shape.
//!
//! Three formulations share one assembly in the modal basis of `modal`:
//! - *trilinear*, integrated exactly over the part of the cell inside the body;
//! - *corner*, the rule of Weiss et al. (CVPR 2020): K_ij = Σ_v w_v K_ij(v) over the cell's corners with w_v = ∫ N_v. It is
//!   exact for affine motion and three times (and more) too stiff in bending;
//! - *enhanced* (default): trilinear plus nine incompatible modes (Taylor, Beresford & Wilson, IJNME 10(6), 1976; Simo &
//!   Rifai, IJNME 29(8), 1990) and linear dilatation, see `enhanced`.
//!
//! K scales with Young's modulus, so matrices are made for 1 Pa, with their derivative by Poisson's ratio.

mod enhanced;
mod modal;
#[cfg(test)]
mod tests;

use crate::cutcells::corotation::M24;
use crate::scene::Element;

/// A cell's matrices for a Young's modulus of 1 Pa.
#[derive(Clone, Debug)]
pub struct CellMatrices {
    /// Stiffness [m] (force [N] per displacement [m] and Pa), row-major, 3 · corner + component, exactly symmetric.
    pub k: Box<M24>,
    /// Derivative of `k` by Poisson's ratio.
    pub k_nu: Box<M24>,
}

impl CellMatrices {
    /// Matrices of one cell; arguments as in [`stiffness`].
    pub fn new(element: Element, h: f64, weights: &[f64; 27], fraction: f64, nu: f64) -> CellMatrices {
        let mut m = CellMatrices { k: Box::new([0.0; 576]), k_nu: Box::new([0.0; 576]) };
        stiffness(element, h, weights, fraction, nu, &mut m.k, &mut m.k_nu);
        m
    }
}

/// Stiffness of a cell with edge `h` [m] for a Young's modulus of 1 Pa, and its derivative by ν.
///
/// `weights` belong to the 3 × 3 × 3 Gauss points (x fastest), divided by h³, and integrate polynomials of degree ≤ 2 per
/// variable over the part inside the body; they sum to `fraction` and may be negative. −1 < `nu` < ½. Both results are
/// exactly symmetric, and K is positive semi-definite with the six rigid motions as its null space. A cell without
/// volume gives zero.
pub fn stiffness(element: Element, h: f64, weights: &[f64; 27], fraction: f64, nu: f64, out_k: &mut M24, out_dk_dnu: &mut M24) {
    let mut moments = modal::moments(weights);
    if moments[0] <= 0.0 {
        out_k.fill(0.0);
        out_dk_dnu.fill(0.0);
        return;
    }
    let law = Law::new(nu);
    match element {
        Element::Enhanced => enhanced::assemble(&moments, fraction, &law, out_k, out_dk_dnu),
        Element::Trilinear => modal::assemble(&moments, &law, out_k, out_dk_dnu),
        Element::Corner => {
            modal::corner_rule(&mut moments);
            modal::assemble(&moments, &law, out_k, out_dk_dnu);
        }
    }
    modal::to_corners(out_k, h);
    modal::to_corners(out_dk_dnu, h);
}

/// Split of the energy density μ |dev ε|² + ½ κ (tr ε)² for Young's modulus 1.
struct Law {
    /// 2μ and its derivative by ν.
    shear: [f64; 2],
    /// κ and its derivative by ν.
    bulk: [f64; 2],
}

impl Law {
    fn new(nu: f64) -> Law {
        let (a, b) = (1.0 / (1.0 + nu), 1.0 / (1.0 - 2.0 * nu));
        Law { shear: [a, -a * a], bulk: [b / 3.0, 2.0 * b * b / 3.0] }
    }
}
