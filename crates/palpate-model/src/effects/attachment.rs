//! Points of the body that springs draw to where they were measured: strings, a gripper, whatever moves the body and is seen but not weighed.
//!
//! Energy ½ κ |x − a(t) − o|² of every point, where a is its measured place and o an offset that all of them share (a target that was
//! measured beside the point). A point acts only at times at which it was seen. The law of `handle` for many points, each with
//! its own path, linear between samples. Weighted θ and 1 − θ in time like the cells.

use super::law::{Asks, Input, Number, Place, PointLaw, dot};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};

/// Kind of this law.
pub const KIND: &str = "attachment";

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Load,
    sentence: "springs draw points of the body to where they were measured",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Driven(&Attachment),
};

const OFFSET: &str = "from the measured places to where the springs draw";

const PARAMS: [EffectParam; 4] = [
    number("stiffness", "N/m", [0.0, 1e12, 1e3], Unstated::Absent(0.0), "force of a point over its distance"),
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 0, "m", 1e-3, OFFSET) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 1, "m", 1e-3, OFFSET) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 2, "m", 1e-3, OFFSET) },
];

struct Attachment;

impl PointLaw for Attachment {
    const ASKS: Asks = Asks::Series;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (followed, theta, offset) = (&place.followed, place.theta(), at.vector(1));
        let stretch = |x: [D; 3], target: [D; 3]| -> [D; 3] { std::array::from_fn(|i| x[i] - target[i] - offset[i]) };
        let new = stretch(at.x(), followed.now(at.time()));
        let old = stretch(at.old(), followed.old(at.time()));
        // The old state's force has a linear potential.
        let energy = dot(new, new) * (0.5 * theta) + dot(old, at.x()) * (1.0 - theta);
        at.p(0) * energy * place.measure
    }
}
