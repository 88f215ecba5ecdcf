//! Stable neo-Hookean (Smith, de Goes & Kim, *ACM TOG* 37(2), 2018), ψ = ½m (|F|² − 3) + ½l (J − α)² − ½m ln(|F|² + 1) with m = 4μ/3,
//! l = λ + 5μ/6, α = 1 + 3m/(4l): defined for every F, inverted ones too, but soft in compression at a low Poisson's ratio.
//!
//! With x = (|F|² − 3)/4 and J = 1 + j this is ½l j² + ¾m (½|H|² − c − det H) + ½m (x − ln(1 + x)), up to a constant.

use super::{Gradient, Hyperelastic, Model, minus_ln1p, squares, volume_parts};
use crate::effects::law::Number;

/// The law.
pub struct StableNeoHookean;

pub(super) const MODEL: Model = Model {
    name: "stable-neo-hookean",
    doc: "neo-Hookean for bodies that may turn inside out",
    law: &StableNeoHookean,
    is_linear: false,
};

impl Hyperelastic for StableNeoHookean {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        let (m, l) = (mu * (4.0 / 3.0), lambda + mu * (5.0 / 6.0));
        let [trace, c, det] = volume_parts(h);
        let j = trace + c + det;
        let x = trace * 0.5 + squares(h) * 0.25;
        j * j * l * 0.5 + (squares(h) * 0.5 - c - det) * m * 0.75 + minus_ln1p(x) * m * 0.5
    }
}
