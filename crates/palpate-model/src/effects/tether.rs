//! A spring from a place on the body to a fixed point: a thread, a cable, a rubber band.
//!
//! Energy ½ k (|d| − L)² with d = u + (attachment − anchor), spread over the nodes around the attachment by their shares
//! (`point_mass::around`): every node of the blob is pulled by the same spring, so the blob is not squeezed. A spring of length L = 0 is
//! linear. It pushes when shorter than L, unlike a thread that goes slack. Massless and undamped.

use super::law::{Input, Number, Place, PointLaw, constant, dot, sub};
use super::point_mass::{RADIUS, around};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

/// Length [m] below which the spring's direction is smoothed.
const SMOOTH: f64 = 1e-5;

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

const PARAMS: [EffectParam; 9] = [
    number("stiffness", "N/m", [0.0, 1e9, 10.0], Unstated::Absent(0.0), "force over change of length"),
    EffectParam { default: Unstated::Center, ..component("attachment", 0, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::Center, ..component("attachment", 1, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::Center, ..component("attachment", 2, "m", 0.05, ATTACHMENT) },
    EffectParam { default: Unstated::Center, ..component("anchor", 0, "m", 0.05, ANCHOR) },
    EffectParam { default: Unstated::Center, ..component("anchor", 1, "m", 0.05, ANCHOR) },
    EffectParam { default: Unstated::Center, ..component("anchor", 2, "m", 0.05, ANCHOR) },
    number("length", "m", [0.0, 1e6, 0.05], Unstated::Fixed(0.0), "length without force"),
    RADIUS,
];

struct Tether;

impl PointLaw for Tether {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let u = sub(at.x(), constant(place.rest));
        let offset = sub(at.vector(1), at.vector(4));
        let d = std::array::from_fn(|i| u[i] + offset[i]);
        let squared = dot(d, d);
        // (|d| − L)² without its constant.
        let energy = squared - at.p(7) * (squared + SMOOTH * SMOOTH).sqrt() * 2.0;
        at.p(0) * energy * (0.5 * place.measure)
    }

    fn share<D: Number>(&self, rest: DVec3, p: &[D]) -> Option<D> {
        Some(around(rest, [p[1], p[2], p[3]], p[8]))
    }
}
