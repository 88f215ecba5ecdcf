//! Coulomb friction on contact planes, smoothed at small sliding speed.
//!
//! Dissipation potential μ p₀ A √(s² + ε²) of the sliding way s in a step, with the pressure p₀ of the old state, so that the law
//! is symmetric (lagged normal force: Li et al., *Incremental Potential Contact*, ACM TOG 39, 2020, section 5). Below the speed ε/Δt the
//! force grows linearly with s instead of holding still: the body creeps by less than that.

use super::law::{Input, Number, Place, PointLaw, dot, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};
use crate::mechanics::contact;

/// Sliding speed [m/s] below which friction is proportional to it: far slower than anything a camera sees in a frame.
const CREEP: f64 = 5e-3;

pub(super) const LAW: Law = Law {
    kind: "coulomb-friction",
    family: Family::Contact,
    sentence: "the ground holds the body back by friction",
    params: &PARAMS,
    trial: Trial::Saturates,
    site: Site::Contact(&Friction),
};

const PARAMS: [EffectParam; 1] =
    [number("coefficient", "1", [0.0, 10.0, 0.3], Unstated::Absent(0.0), "friction force over normal force")];

struct Friction;

/// Pressure at the old state by value and derivative.
pub(super) fn old_pressure<D: Number>(place: &Place, at: &Input<D>) -> D {
    contact::pressure_of(at.gaps()[0], at.plane_stiffness(), place.width)
}

impl PointLaw for Friction {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (way, n) = (at.way(), at.normal());
        let away = dot(way, n);
        let slide = sub(way, n.map(|n| n * away));
        let creep = CREEP / place.rate;
        at.p(0) * old_pressure(place, &at) * (dot(slide, slide) + creep * creep).sqrt() * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        place.rate == 0.0 || old_pressure(place, &Input::new(z)) == 0.0
    }
}
