//! Preconditioned conjugate gradients with a residual norm that small cells cannot hide from.

use super::matrix::Operator;
use super::vector::{add_scaled, dot};
use glam::DVec3;

/// Something that approximates A⁻¹ and is symmetric positive definite.
pub trait Precondition {
    /// z = M⁻¹ r.
    fn apply(&self, r: &[DVec3], z: &mut [DVec3]);
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CgEnd {
    /// Reached the tolerance after so many iterations.
    Converged(usize),
    /// Did not; the relative residual that is left.
    Unconverged(f64),
    /// Found a direction of negative curvature: the matrix is not positive definite.
    Indefinite,
}

/// Solves A x = b from the given x. Stops when `‖r‖ ≤ max(relative·‖b‖, absolute)` in the norm `sqrt(rᵀ M⁻¹ r)`: scaled by the
/// preconditioner, a nearly massless node counts as much as any other (plain norms are blind to it).
pub fn solve(
    matrix: &dyn Operator,
    precondition: &dyn Precondition,
    b: &[DVec3],
    x: &mut [DVec3],
    relative: f64,
    absolute: f64,
    most: usize,
) -> CgEnd {
    let n = b.len();
    let mut r = b.to_vec();
    let mut z = vec![DVec3::ZERO; n];
    let mut q = vec![DVec3::ZERO; n];
    precondition.apply(b, &mut z);
    let scale = dot(b, &z).max(0.0).sqrt();
    if scale == 0.0 {
        x.fill(DVec3::ZERO);
        return CgEnd::Converged(0);
    }
    let target = (relative * scale).max(absolute);
    if x.iter().any(|v| *v != DVec3::ZERO) {
        matrix.multiply(x, &mut q);
        add_scaled(&mut r, -1.0, &q);
        precondition.apply(&r, &mut z);
    }
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    for iteration in 0..most {
        if rz.max(0.0).sqrt() <= target {
            return CgEnd::Converged(iteration);
        }
        matrix.multiply(&p, &mut q);
        let curvature = dot(&p, &q);
        if !curvature.is_finite() {
            return CgEnd::Unconverged(f64::NAN);
        }
        if curvature <= 0.0 {
            return CgEnd::Indefinite;
        }
        let alpha = rz / curvature;
        add_scaled(x, alpha, &p);
        add_scaled(&mut r, -alpha, &q);
        precondition.apply(&r, &mut z);
        let next = dot(&r, &z);
        let beta = next / rz;
        rz = next;
        for (p, z) in p.iter_mut().zip(&z) {
            *p = *z + beta * *p;
        }
    }
    if rz.max(0.0).sqrt() <= target { CgEnd::Converged(most) } else { CgEnd::Unconverged(rz.max(0.0).sqrt() / scale) }
}
