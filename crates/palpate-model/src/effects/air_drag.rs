//! Quadratic drag of still air (or water) on the surface.
//!
//! Every surface patch of area A feels −½ ρ C A |v| v, v its mean velocity in the step. Incremental potential ⅓ · ½ ρ C A |s|³/Δt² of its way
//! s, convex and exact. For a body in translation this is the drag equation (Batchelor, *An Introduction to Fluid Dynamics*,
//! 1967, section 5.11) over the whole surface instead of the shadow: C is a quarter of the usual coefficient for a ball. Each patch
//! drags alone: windward and lee sides, lift and added mass are not told apart.

use super::law::{Input, Number, Place, PointLaw, dot};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

/// Way [m] over which the force goes smoothly through zero: 1 µm a step is slower than anything that feels drag.
const SMOOTH: f64 = 1e-6;

pub(super) const LAW: Law = Law {
    kind: "air-drag",
    family: Family::Load,
    sentence: "the air brakes the body",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Surface(&AirDrag),
};

const PARAMS: [EffectParam; 2] = [
    number("coefficient", "1", [0.0, 1e6, 1.0], Unstated::Absent(0.0), "drag over dynamic pressure and whole surface"),
    number("fluid_density", "kg/m³", [1e-6, 1e5, 1.2], Unstated::Fixed(1.2), "density of the air"),
];

struct AirDrag;

impl PointLaw for AirDrag {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let way = at.way();
        let length = (dot(way, way) + SMOOTH * SMOOTH).sqrt();
        at.p(0) * at.p(1) * length.powi(3) * (place.rate * place.rate * place.measure / 6.0)
    }

    fn idle(&self, place: &Place, _z: &[f64]) -> bool {
        place.rate == 0.0
    }
}
