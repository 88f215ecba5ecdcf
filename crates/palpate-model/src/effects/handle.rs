//! A hand that holds the body at a place and moves: a spring from there to a point that follows a path.
//!
//! The law of `tether`, with an anchor that the scene states as a path instead of a fixed point: energy ½ k |x − a(t)|² of the
//! place, where x is what it has become, spread over the nodes around it by their shares. The stiffer the spring, the closer the body
//! follows. Between samples the path is cubic, outside them the anchor is held. Weighted θ and 1 − θ in time like the cells. In a static
//! problem the anchor is where it is at the start.

use super::law::{Asks, Input, Number, Place, PointLaw, constant, dot};
use super::point_mass::{RADIUS, around};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

/// Kind of this law in scene files.
pub const KIND: &str = "handle";

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Load,
    sentence: "a spring pulls the body along a path",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Nodes(&Handle),
};

const POINT: &str = "where it holds the body at rest";

const PARAMS: [EffectParam; 5] = [
    number("stiffness", "N/m", [0.0, 1e9, 10.0], Unstated::Absent(0.0), "force over distance from the path"),
    EffectParam { default: Unstated::OnBody, ..component("point", 0, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 1, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 2, "m", 0.05, POINT) },
    RADIUS,
];

struct Handle;

impl PointLaw for Handle {
    const ASKS: Asks = Asks::Path;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (rest, point): ([D; 3], _) = (constant(place.rest), at.vector(1));
        let (followed, theta) = (&place.followed, place.theta());
        // Every node of the region is pulled by the displacement that the anchor asks of the place, so that the region is not squeezed.
        let stretch = |x: [D; 3], anchor: [D; 3]| -> [D; 3] { std::array::from_fn(|i| x[i] - rest[i] + point[i] - anchor[i]) };
        let new = stretch(at.x(), followed.now(at.time()));
        let old = stretch(at.old(), followed.old(at.time()));
        // The old state's force has a linear potential.
        let energy = dot(new, new) * (0.5 * theta) + dot(old, at.x()) * (1.0 - theta);
        at.p(0) * energy * place.measure
    }

    fn share<D: Number>(&self, rest: DVec3, p: &[D]) -> Option<D> {
        Some(around(rest, [p[1], p[2], p[3]], p[4]))
    }
}
