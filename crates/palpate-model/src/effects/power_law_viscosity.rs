//! Viscosity that is not proportional to the strain rate: viscous stress = E c (ε̇ / 1 s⁻¹)ⁿ.
//!
//! Dissipation potential φ = c Δt (ε̇² + s²)^((n+1)/2) / (n+1) with ε̇² = 2d/Δt² (Norton's law as a potential: Ziegler,
//! *An Introduction to Thermomechanics*, 1983; Ortiz & Stainier, *CMAME* 171, 1999). n = 1 is the scene's stiffness damping, n < 1 loses
//! more in small motion, n > 1 in fast motion. Below the rate s the viscosity is constant.

use super::cell::{CellLaw, Increment};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

/// Strain rate [1/s] below which the law turns linear: a bar of 10 cm changes by 1 mm in a second.
const SLOW: f64 = 1e-2;

pub(super) const LAW: Law = Law {
    kind: "power-law-viscosity",
    family: Family::Material,
    sentence: "the material's inner friction is not proportional to the speed of deformation",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Cells(&Viscosity),
};

const PARAMS: [EffectParam; 2] = [
    number("coefficient", "1", [0.0, 1e3, 0.01], Unstated::Absent(0.0), "viscous stress over E at a strain rate of 1/s"),
    number("exponent", "1", [0.1, 3.0, 0.5], Unstated::Stated(0.5), "power of the strain rate"),
];

struct Viscosity;

impl CellLaw for Viscosity {
    const LOSSY: bool = true;

    fn loss<D: Number>(&self, s: &Increment<D>, p: &[D]) -> D {
        let squared = s.density * (2.0 * s.rate * s.rate) + SLOW * SLOW;
        let power = p[1] + 1.0;
        p[0] * (squared.ln() * power * 0.5).exp() / (power * s.rate)
    }
}
