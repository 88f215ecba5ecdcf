//! A spring from a place on the body to a fixed point: a thread, a cable, a rubber band.
//!
//! Energy ½ k |d|² with d = u + (attachment − anchor), spread over the nodes around the attachment by their shares
//! (`point_mass::around`): every node of the blob is pulled by the same spring, so the blob is not squeezed. The spring has no length
//! of its own; one that does acts like this for motion along it, with the anchor moved by its length. Massless and undamped;
//! weighted θ and 1 − θ in time like the cells, so that a swing on it keeps its energy at θ = ½.

use super::law::{Input, Number, Place, PointLaw, constant, dot, sub};
use super::point_mass::{RADIUS, around};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

pub(super) const LAW: Law = Law {
    kind: "tether",
    family: Family::Load,
    sentence: "a spring ties the body to a fixed point",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Nodes(&Tether),
};

const ATTACHMENT: &str = "where it is attached, on the body at rest";
const ANCHOR: &str = "fixed point at its other end";

const PARAMS: [EffectParam; 8] = [
    number("stiffness", "N/m", [0.0, 1e9, 10.0], Unstated::Absent(0.0), "force over change of length"),
    EffectParam { default: Unstated::OnBody, ..component("attachment", 0, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::OnBody, ..component("attachment", 1, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::OnBody, ..component("attachment", 2, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::Center, ..component("anchor", 0, "m", 0.05, ANCHOR) },
    EffectParam { default: Unstated::Center, ..component("anchor", 1, "m", 0.05, ANCHOR) },
    EffectParam { default: Unstated::Center, ..component("anchor", 2, "m", 0.05, ANCHOR) },
    RADIUS,
];

struct Tether;

impl PointLaw for Tether {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (rest, offset): ([D; 3], _) = (constant(place.rest), sub(at.vector(1), at.vector(4)));
        let stretch = |x: [D; 3]| -> [D; 3] { std::array::from_fn(|i| x[i] - rest[i] + offset[i]) };
        let (new, theta) = (stretch(at.x()), place.theta());
        // The old state's force has a linear potential.
        let energy = dot(new, new) * (0.5 * theta) + dot(stretch(at.old()), at.x()) * (1.0 - theta);
        at.p(0) * energy * place.measure
    }

    fn share<D: Number>(&self, rest: DVec3, p: &[D]) -> Option<D> {
        Some(around(rest, [p[1], p[2], p[3]], p[7]))
    }
}
