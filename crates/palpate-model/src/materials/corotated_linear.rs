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

    fn stress_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<Stress> {
        let at = Turned::new(h, lambda, mu);
        Some((at.first(), at.second(lambda, mu)))
    }

    fn first_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<[f64; 9]> {
        Some(Turned::new(h, lambda, mu).first())
    }

    fn is_linear_in_moduli(&self) -> bool {
        true
    }
}

/// A deformation F = R S: P = R σ, σ = λ tr(ε) I + 2μ ε, ε = S − I. Along dF, with M = Rᵀ dF: dR = R [ω]× with (tr(S) I − S) ω = axial(M), as the skew
/// part of M = [ω]× S + dS says; then dP = R ([ω]× σ + dσ).
struct Turned {
    /// Rᵀ.
    back: DMat3,
    s: DMat3,
    sigma: DMat3,
}

/// λ tr(ε) I + 2μ ε.
fn stress_of(e: DMat3, lambda: f64, mu: f64) -> DMat3 {
    DMat3::IDENTITY * (lambda * trace(e)) + e * (2.0 * mu)
}

impl Turned {
    fn new(h: &Gradient<f64>, lambda: f64, mu: f64) -> Turned {
        let f = matrix(&deformation(h));
        let back = nearest(f).transpose();
        let s = half(back * f);
        Turned { back, s, sigma: stress_of(s - DMat3::IDENTITY, lambda, mu) }
    }

    fn first(&self) -> [f64; 9] {
        let p = self.back.transpose() * self.sigma;
        std::array::from_fn(|k| p.col(k % 3)[k / 3])
    }

    fn second(&self, lambda: f64, mu: f64) -> [[f64; 9]; 9] {
        let Turned { back, s, sigma } = *self;
        let pairs = (DMat3::IDENTITY * trace(s) - s).inverse();
        let mut tangent = [[0.0; 9]; 9];
        for l in 0..9 {
            // Rᵀ dF of a change of one entry: a column of Rᵀ.
            let mut m = DMat3::ZERO;
            *m.col_mut(l % 3) = back.col(l / 3);
            let omega = pairs * DVec3::new(m.y_axis.z - m.z_axis.y, m.z_axis.x - m.x_axis.z, m.x_axis.y - m.y_axis.x);
            let turn = DMat3::from_cols(omega.cross(DVec3::X), omega.cross(DVec3::Y), omega.cross(DVec3::Z));
            let change = back.transpose() * (turn * sigma + stress_of(half(m - turn * s), lambda, mu));
            (0..9).for_each(|k| tangent[k][l] = change.col(k % 3)[k / 3]);
        }
        tangent
    }
}

/// R with F = R S, as [`rotation`] finds it; done when a step leaves nothing to do.
fn nearest(f: DMat3) -> DMat3 {
    let size = |m: DMat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    let mut r = f;
    for _ in 0..STEPS {
        let (a, b, c) = (r.x_axis, r.y_axis, r.z_axis);
        let cofactors = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
        let next = (r + cofactors * (1.0 / a.dot(cofactors.x_axis))) * 0.5;
        let moved = size(next - r);
        r = next;
        // What is off after a step is half its square: below rounding, where the step was below its root.
        if moved < 1e-16 {
            break;
        }
    }
    r
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
