//! Neo-Hookean, ψ = ½μ (|F|² − 3 − 2 ln J) + ½λ (½(J² − 1) − ln J) (Hahn et al. 2019, Eq. 16): a barrier as J → 0, stiffening in expansion.

use super::{Barrier, Gradient, Hyperelastic, Model, Stress, minus_ln1p, shear, volume_parts};
use crate::effects::law::Number;

/// The law.
pub struct NeoHookean;

pub(super) const MODEL: Model = Model {
    name: "neo-hookean",
    doc: "rubber and gels at large strains; resists being squeezed to nothing",
    law: &NeoHookean,
    is_linear: false,
    has_curves: false,
};

impl Hyperelastic for NeoHookean {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        let parts = volume_parts(h);
        let j = parts[0] + parts[1] + parts[2];
        shear(h, parts, j) * mu + (j * j * 0.5 + minus_ln1p(j)) * lambda * 0.5
    }

    fn stress_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<Stress> {
        Some(barrier(h, lambda, mu).stress(h))
    }

    fn first_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<[f64; 9]> {
        Some(barrier(h, lambda, mu).first(h))
    }
}

fn barrier(h: &Gradient<f64>, lambda: f64, mu: f64) -> Barrier {
    Barrier::new(h, mu, |j| [0.5 * lambda * j * (2.0 + j), lambda * (1.0 + j) * (1.0 + j)])
}
