//! Contact that is stiffer or softer than the plane's stated stiffness: a padded floor, a skin that gives before the body does.
//!
//! Adds c times the contact energy of `palpate_model::mechanics::contact`, so that every pressure is (1 + c) times the stated one.
//! Relative to the stiffness in use, whether the scene states it or it follows Young's modulus. Valid for all c above −1; the
//! layer keeps its width, so a soft floor lets the body sink in by its pressure over the stiffness.

use super::law::{Input, Number, Place, PointLaw, along_way};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};
use crate::mechanics::contact;
use crate::params::Transform;

pub(super) const LAW: Law = Law {
    kind: "contact-stiffness",
    family: Family::Contact,
    sentence: "the contact with the ground is stiffer or softer than stated",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Contact(&ContactStiffness),
};

// What a body sinks in goes with 1/(1 + c): over decades a step of the logarithm does alike, one of c itself does nothing or too much.
const PARAMS: [EffectParam; 1] = [EffectParam {
    transform: Transform::Relative,
    ..number("change", "1", [-0.999, 1e3, 0.5], Unstated::Absent(0.0), "change of the contact stiffness, relative to it")
}];

struct ContactStiffness;

impl PointLaw for ContactStiffness {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let energy = |gap| contact::energy_of(gap, at.plane_stiffness(), place.width);
        at.p(0) * along_way(place, at.gaps(), energy) * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        let [old, new] = Input::new(z).gaps();
        old.min(new) >= place.width
    }
}
