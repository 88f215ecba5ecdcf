//! A mass attached at a place that the scene does not know: a marker, a load, a bubble of something heavy. Weight and inertia.
//!
//! The mass m is shared by the nodes around the place ([`around`]), each with weight and with the inertia of the θ-scheme
//! (W20 Eq. 14): Π = m s [½ i |s⃗|² − j v₀·s⃗ − g·x] for the way s⃗ of a step, i = 1/(θΔt²), j = 1/(θΔt). Unlike a `[[mass]]` its place is a parameter
//! with a derivative. A load that hangs on a long string follows up and down, not sideways: of the inertia across gravity only the share
//! 1 − `hung` is felt. It adds to the body's own mass and feels no mass-proportional damping. A place outside the body
//! loads what lies nearest.

use super::law::{Input, Number, Place, PointLaw, constant, dot, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

pub(super) const LAW: Law = Law {
    kind: "point-mass",
    family: Family::Load,
    sentence: "an additional mass is attached to the body",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Nodes(&PointMass),
};

const POINT: &str = "where it is attached, on the body at rest";

const PARAMS: [EffectParam; 6] = [
    number("mass", "kg", [0.0, 1e6, 0.02], Unstated::Absent(0.0), "attached mass"),
    EffectParam { default: Unstated::OnBody, ..component("point", 0, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 1, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 2, "m", 0.05, POINT) },
    RADIUS,
    number(
        "hung",
        "1",
        [0.0, 1.0, 0.2],
        Unstated::Fixed(0.0),
        "0 moves with the body, 1 hangs on a string: no inertia across gravity",
    ),
];

/// Size of the region that shares a load at a place.
pub(super) const RADIUS: EffectParam = number(
    "radius",
    "m",
    [1e-6, 1e6, 0.01],
    Unstated::Sharp(0.01),
    "size of the region that carries it; at an edge of the body its middle lies that far inside",
);

/// Weight (1 + d²/4r²)⁻⁴ of a node at distance d from the place: a bell like exp(−d²/r²), whose tail never underflows, so that a
/// place far outside still has a derivative.
pub(super) fn around<D: Number>(rest: DVec3, place: [D; 3], radius: D) -> D {
    let d = sub(constant(rest), place);
    (dot(d, d) / (radius * radius * 4.0) + 1.0).powi(-4)
}

struct PointMass;

impl PointLaw for PointMass {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let way = at.way();
        let (g, hung) = (at.gravity(), at.p(5));
        // Without gravity nothing hangs; the square of a number far below any gravity keeps the quotient finite.
        let square = dot(g, g) + 1e-12;
        let product = |a, b| {
            let along = dot(a, g) * dot(b, g) / square;
            dot(a, b) * (-hung + 1.0) + hung * along
        };
        let kinetic = product(way, way) * (0.5 * place.inertia) - product(at.velocity(), way) * place.momentum;
        at.p(0) * (kinetic - dot(g, at.x())) * place.measure
    }

    fn share<D: Number>(&self, rest: DVec3, p: &[D]) -> Option<D> {
        Some(around(rest, [p[1], p[2], p[3]], p[4]))
    }
}
