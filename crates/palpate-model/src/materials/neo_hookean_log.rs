//! Neo-Hookean with a logarithmic volume term, ψ = ½μ (|F|² − 3) − μ ln J + ½λ ln²J (Hahn et al. 2019, Eq. 19): the same at small strains as
//! [`super::neo_hookean`], twice as stiff at half the volume, and softer in expansion (not convex beyond J = e).

use super::{Barrier, Gradient, Hyperelastic, Model, Stress, shear, volume_parts};
use crate::effects::law::Number;

/// The law.
pub struct NeoHookeanLog;

pub(super) const MODEL: Model = Model {
    name: "neo-hookean-log",
    doc: "neo-Hookean with the square of the volume's logarithm, as many programs have it",
    law: &NeoHookeanLog,
    is_linear: false,
    has_curves: false,
};

impl Hyperelastic for NeoHookeanLog {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        let parts = volume_parts(h);
        let j = parts[0] + parts[1] + parts[2];
        let ln = j.ln_1p();
        shear(h, parts, j) * mu + ln * ln * lambda * 0.5
    }

    fn stress_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<Stress> {
        Some(barrier(h, lambda, mu).stress(h))
    }

    fn first_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<[f64; 9]> {
        Some(barrier(h, lambda, mu).first(h))
    }
}

fn barrier(h: &Gradient<f64>, lambda: f64, mu: f64) -> Barrier {
    Barrier::new(h, mu, |j| [lambda * j.ln_1p(), lambda])
}
