//! Corotated linear elasticity: ψ = μ |S − I|² + ½λ tr²(S − I) with F = RS. On cut cells this is the element itself; here it is written at one
//! F, for points.

use super::{Gradient, Hyperelastic, Model, Stress, cofactors, deformation, linear};
use crate::effects::law::Number;
use glam::{DMat3, DVec3};

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

    /// P = R σ, σ = λ tr(ε) I + 2μ ε, ε = S − I. Along dF, with M = Rᵀ dF: dR = R [ω]× with (tr(S) I − S) ω = axial(M), as the skew part of
    /// M = [ω]× S + dS says; then dP = R ([ω]× σ + dσ).
    fn stress_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<Stress> {
        let back = matrix(&rotation(h)).transpose();
        let f = matrix(&deformation(h));
        let s = half(back * f);
        let linear = |e: DMat3| DMat3::IDENTITY * (lambda * trace(e)) + e * (2.0 * mu);
        let sigma = linear(s - DMat3::IDENTITY);
        let pairs = (DMat3::IDENTITY * trace(s) - s).inverse();
        let mut tangent = [[0.0; 9]; 9];
        for l in 0..9 {
            // Rᵀ dF of a change of one entry: a column of Rᵀ.
            let mut m = DMat3::ZERO;
            *m.col_mut(l % 3) = back.col(l / 3);
            let omega = pairs * DVec3::new(m.y_axis.z - m.z_axis.y, m.z_axis.x - m.x_axis.z, m.x_axis.y - m.y_axis.x);
            let turn = DMat3::from_cols(omega.cross(DVec3::X), omega.cross(DVec3::Y), omega.cross(DVec3::Z));
            let change = back.transpose() * (turn * sigma + linear(half(m - turn * s)));
            (0..9).for_each(|k| tangent[k][l] = change.col(k % 3)[k / 3]);
        }
        let p = back.transpose() * sigma;
        Some((std::array::from_fn(|k| p.col(k % 3)[k / 3]), tangent))
    }

    fn is_linear_in_moduli(&self) -> bool {
        true
    }
}

/// Rows as a matrix.
fn matrix(rows: &Gradient<f64>) -> DMat3 {
    DMat3::from_cols_array_2d(rows).transpose()
}

fn trace(m: DMat3) -> f64 {
    m.x_axis.x + m.y_axis.y + m.z_axis.z
}

/// The symmetric part.
fn half(m: DMat3) -> DMat3 {
    (m + m.transpose()) * 0.5
}

/// R with F = R S.
fn rotation<D: Number>(h: &Gradient<D>) -> Gradient<D> {
    let f = deformation(h);
    // R ← ½ (R + R⁻ᵀ) (Higham, SIAM J. Sci. Stat. Comput. 7, 1986), with derivatives that converge along.
    let mut r = f;
    for _ in 0..STEPS {
        let c = cofactors(&r);
        let det = r[0][0] * c[0][0] + r[0][1] * c[0][1] + r[0][2] * c[0][2];
        r = std::array::from_fn(|i| std::array::from_fn(|j| (r[i][j] + c[i][j] / det) * 0.5));
    }
    r
}

/// S − I with F = R S.
pub(super) fn stretch<D: Number>(h: &Gradient<D>) -> Gradient<D> {
    let (f, r) = (deformation(h), rotation(h));
    let product = |i: usize, j: usize| (0..3).fold(D::from(0.0), |sum, k| sum + r[k][i] * f[k][j]);
    std::array::from_fn(|i| std::array::from_fn(|j| product(i, j) - f64::from(u8::from(i == j))))
}
