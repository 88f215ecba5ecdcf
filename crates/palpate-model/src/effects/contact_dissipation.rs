//! Contact that takes energy out: pressure p (1 + d ν) for a surface that approaches the plane at speed ν.
//!
//! The damping term of Hunt & Crossley (*J. Appl. Mech.* 42, 1975), with the pressure p₀ of the old state: dissipation potential
//! ½ d p₀ A s²/Δt of the way s along the normal in a step. It vanishes with the pressure, so nothing jumps at first touch. For a
//! rigid mass on the contact layer the restitution is 1 − ⅔ d ν₀ at small impact speeds ν₀. A soft body brakes by its own strain,
//! and its surface hardly moves once it touches: there the effect is weaker. Separating surfaces are held back likewise; d times the
//! speed of separation should stay below one, beyond that they are pulled.

use super::coulomb_friction::old_pressure;
use super::law::{Input, Number, Place, PointLaw, dot};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "contact-dissipation",
    family: Family::Contact,
    sentence: "the contact with the ground swallows energy, so that the body rebounds less",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Contact(&Dissipation),
};

const PARAMS: [EffectParam; 1] = [number(
    "dissipation",
    "s/m",
    [0.0, 1e4, 1.0],
    Unstated::Absent(0.0),
    "damping pressure over pressure and speed of approach",
)];

struct Dissipation;

impl PointLaw for Dissipation {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let way = dot(at.way(), at.normal());
        at.p(0) * old_pressure(place, &at) * way * way * (0.5 * place.rate * place.measure)
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        place.rate == 0.0 || old_pressure(place, &Input::new(z)) == 0.0
    }
}
