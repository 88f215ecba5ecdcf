//! Stable neo-Hookean (Smith, de Goes & Kim, *ACM TOG* 37(2), 2018), ψ = ½m (|F|² − 3) + ½l (J − α)² − ½m ln(|F|² + 1) with m = 4μ/3,
//! l = λ + 5μ/6, α = 1 + 3m/(4l): defined for every F, inverted ones too, but soft in compression at a low Poisson's ratio.
//!
//! With x = (|F|² − 3)/4 and J = 1 + j this is ½l j² + ¾m (½|H|² − c − det H) + ½m (x − ln(1 + x)), up to a constant.

use super::{Gradient, Hyperelastic, Model, Stress, cofactors, deformation, minus_ln1p, squares, volume_parts};
use crate::effects::law::Number;

/// The law.
pub struct StableNeoHookean;

pub(super) const MODEL: Model = Model {
    name: "stable-neo-hookean",
    doc: "neo-Hookean for bodies that may turn inside out",
    law: &StableNeoHookean,
    is_linear: false,
    has_curves: false,
};

impl Hyperelastic for StableNeoHookean {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        let (m, l) = (mu * (4.0 / 3.0), lambda + mu * (5.0 / 6.0));
        let [trace, c, det] = volume_parts(h);
        let j = trace + c + det;
        let x = trace * 0.5 + squares(h) * 0.25;
        j * j * l * 0.5 + (squares(h) * 0.5 - c - det) * m * 0.75 + minus_ln1p(x) * m * 0.5
    }

    /// P = ¾m (F − C) + ½m x/(1 + x) · ½F + l j C with C the cofactors, where F − C = H + Hᵀ − tr H I − cof H loses no digits at small strains.
    /// With a = ¾m + ¼m x/(1 + x) and b = l j − ¾m, ∂P[δ] = a δ + ⅛m (F : δ) F/(1 + x)² + l (C : δ) C + b ∂C[δ].
    fn stress_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<Stress> {
        let (m, l) = (mu * (4.0 / 3.0), lambda + mu * (5.0 / 6.0));
        let [trace, c, det] = volume_parts(h);
        let (j, x) = (trace + c + det, trace * 0.5 + squares(h) * 0.25);
        let (f, of_h) = (deformation(h), cofactors(h));
        let cof = cofactors(&f);
        let shared = 0.25 * m * x / (1.0 + x);
        let (a, b, bend) = (0.75 * m + shared, l * j - 0.75 * m, 0.125 * m / ((1.0 + x) * (1.0 + x)));
        let (mut first, mut second) = ([0.0; 9], [[0.0; 9]; 9]);
        for p in 0..9 {
            let (i, k) = (p / 3, p % 3);
            let apart = h[i][k] + h[k][i] - if i == k { trace } else { 0.0 } - of_h[i][k];
            first[p] = 0.75 * m * apart + shared * f[i][k] + l * j * cof[i][k];
            for (q, entry) in second[p].iter_mut().enumerate() {
                let (n, o) = (q / 3, q % 3);
                *entry = bend * f[i][k] * f[n][o] + l * cof[i][k] * cof[n][o];
                // ∂C_ik/∂F_no is an entry of F with the sign of its place in the determinant, or nothing within a row or a column.
                if i != n && k != o {
                    let sign = if ((n + 3 - i) % 3 == 1) == ((o + 3 - k) % 3 == 1) { 1.0 } else { -1.0 };
                    *entry += b * sign * f[3 - i - n][3 - k - o];
                }
            }
            second[p][p] += a;
        }
        Some((first, second))
    }
}
