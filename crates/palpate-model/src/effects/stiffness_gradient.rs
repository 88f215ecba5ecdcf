//! Young's modulus that grows steadily along one direction: E(X) = E exp(s · (X − centre)), with the slope s a vector.
//!
//! The logarithm keeps E positive (graded solids: Kim & Paulino, *J. Appl. Mech.* 69, 2002, use the same exponential). At the
//! centre of mass the modulus is the scene's own.

use super::field::{FieldLaw, Spot};
use super::law::{Number, dot};
use super::{EffectParam, Family, Law, Site, Trial, component};

const DOC: &str = "growth of ln(stiffness) per metre";

pub(super) const LAW: Law = Law {
    kind: "stiffness-gradient",
    family: Family::Material,
    sentence: "one side of the body is stiffer than the other, with a steady change between",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Modulus(&Gradient),
};

const PARAMS: [EffectParam; 3] =
    [component("slope", 0, "1/m", 5.0, DOC), component("slope", 1, "1/m", 5.0, DOC), component("slope", 2, "1/m", 5.0, DOC)];

pub(super) struct Gradient;

impl FieldLaw<1> for Gradient {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 1] {
        [dot(spot.from_center(), [p[0], p[1], p[2]]).exp()]
    }
}
