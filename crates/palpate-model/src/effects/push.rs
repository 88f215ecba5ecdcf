//! A ball that moves along a path and pushes the body out of its way: a fist, a finger, a robot's gripper.
//!
//! The contact law of `palpate_model::mechanics::contact`, as for the scene's planes, with the distance from a ball instead: gap = |x − c(t)| − R,
//! along the way of a step from the old place and the old centre to the new ones. Of the ball itself nothing is simulated: it goes where
//! its path says. Without friction. A ball that begins within the body throws it out in the first step.

use super::law::{Asks, Input, Number, Place, PointLaw, along_way, dot, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};
use crate::mechanics::contact;

pub(super) const LAW: Law = Law {
    kind: "push",
    family: Family::Contact,
    sentence: "a ball pushes the body along a path",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Surface(&Push),
};

const PARAMS: [EffectParam; 2] = [
    number("stiffness", "1", [0.0, 1e3, 1.0], Unstated::Stated(1.0), "contact stiffness over the default 20 E/h"),
    number("radius", "m", [1e-6, 1e3, 0.02], Unstated::Stated(0.02), "radius of the ball"),
];

struct Push;

/// Old and new distance from the ball [m].
fn gaps<D: Number>(place: &Place, at: &Input<D>) -> [D; 2] {
    let ends = [(at.old(), place.followed.old(at.time())), (at.x(), place.followed.now(at.time()))];
    ends.map(|(x, center)| {
        let d = sub(x, center);
        // The square of far less than any length keeps the root smooth at the centre.
        (dot(d, d) + 1e-30).sqrt() - at.p(1)
    })
}

impl PointLaw for Push {
    const ASKS: Asks = Asks::Path;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let energy = |gap| contact::energy_of(gap, at.p(0) * at.default_stiffness(), place.width);
        along_way(place, gaps(place, &at), energy) * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        let [old, new] = gaps(place, &Input::new(z));
        old.min(new) >= place.width
    }
}
