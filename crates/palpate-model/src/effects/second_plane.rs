//! A plane that the scene does not know: a wall, a table's edge, a tilted floor. Place and tilt are parameters.
//!
//! The contact law of `palpate_model::contact` at the new state, as for the scene's own planes, with `stiffness` times their default
//! penalty. The body stays on the side that the normal n = (cos ε cos α, cos ε sin α, sin ε) points to, for azimuth α and elevation
//! ε; the plane lies at `distance` from `point` against n, so that turning it leaves it near the body. Without friction.

use super::law::{Input, Number, Place, PointLaw, dot, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use crate::contact;
use std::f64::consts::TAU;

pub(super) const LAW: Law = Law {
    kind: "second-plane",
    family: Family::Contact,
    sentence: "the body touches something flat that the scene does not know",
    params: &PARAMS,
    trial: Trial::Walls,
    site: Site::Surface(&SecondPlane),
};

const POINT: &str = "point that the distance is counted from";

const PARAMS: [EffectParam; 7] = [
    number("stiffness", "1", [0.0, 1e3, 1.0], Unstated::Absent(0.0), "contact stiffness over the default 10 E/h"),
    number(
        "distance",
        "m",
        [-1e3, 1e3, 0.01],
        Unstated::Stated(0.05),
        "distance of the plane from the point, against its normal",
    ),
    number("azimuth", "rad", [-TAU, TAU, 0.5], Unstated::Stated(0.0), "angle of the normal in the x-y plane, from x towards y"),
    number("elevation", "rad", [-TAU, TAU, 0.5], Unstated::Stated(0.0), "angle of the normal above the x-y plane"),
    EffectParam { default: Unstated::Reference, ..component("point", 0, "m", 0.01, POINT) },
    EffectParam { default: Unstated::Reference, ..component("point", 1, "m", 0.01, POINT) },
    EffectParam { default: Unstated::Reference, ..component("point", 2, "m", 0.01, POINT) },
];

struct SecondPlane;

/// Distance above the plane [m].
fn gap<D: Number>(at: &Input<D>) -> D {
    let ((sa, ca), (se, ce)) = (at.p(2).sin_cos(), at.p(3).sin_cos());
    dot([ce * ca, ce * sa, se], sub(at.x(), at.vector(4))) + at.p(1)
}

impl PointLaw for SecondPlane {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        contact::energy_of(gap(&at), at.p(0) * at.default_stiffness(), place.width) * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        gap(&Input::new(z)) >= place.width
    }
}
