//! Corotated linear elasticity: ψ = μ |S − I|² + ½λ tr²(S − I) with F = RS. On cut cells this is the element itself; here it is written at one
//! F, for points.

use super::{Gradient, Hyperelastic, Model, cofactors, deformation, linear};
use crate::effects::law::Number;

/// The law.
pub struct CorotatedLinear;

pub(super) const MODEL: Model = Model {
    name: "corotated-linear",
    doc: "linear in the stretch, whatever the rotation; exact for small strains, and calm for any",
    law: &CorotatedLinear,
    is_linear: true,
    has_curves: false,
};

/// Steps of the iteration for the rotation: it doubles its digits in each, from any F that squeezes to no less than a twentieth.
const STEPS: usize = 9;

impl Hyperelastic for CorotatedLinear {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        linear(&stretch(h), lambda, mu)
    }
}

/// S − I with F = R S.
pub(super) fn stretch<D: Number>(h: &Gradient<D>) -> Gradient<D> {
    let f = deformation(h);
    // R ← ½ (R + R⁻ᵀ) (Higham, SIAM J. Sci. Stat. Comput. 7, 1986), with derivatives that converge along.
    let mut r = f;
    for _ in 0..STEPS {
        let c = cofactors(&r);
        let det = r[0][0] * c[0][0] + r[0][1] * c[0][1] + r[0][2] * c[0][2];
        r = std::array::from_fn(|i| std::array::from_fn(|j| (r[i][j] + c[i][j] / det) * 0.5));
    }
    let product = |i: usize, j: usize| (0..3).fold(D::from(0.0), |sum, k| sum + r[k][i] * f[k][j]);
    std::array::from_fn(|i| std::array::from_fn(|j| product(i, j) - f64::from(u8::from(i == j))))
}
