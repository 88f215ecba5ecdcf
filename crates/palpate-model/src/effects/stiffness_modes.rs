//! Stiffness that varies smoothly and not steadily: ln E is a quadratic form of the rest position, ξ = (X − centre) / half length.
//!
//! ln E(X)/E = s · (ξ₁², ξ₂², ξ₃²) + m · (ξ₂ξ₃, ξ₃ξ₁, ξ₁ξ₂): softer or stiffer towards both ends, or saddle-like. With
//! `stiffness-gradient` this is every polynomial of degree two.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, component};

const SQUARE: &str = "ln(stiffness) at the end of the axis over that in the middle";
const MIXED: &str = "amplitude of the product of the two other axes in ln(stiffness)";

pub(super) const LAW: Law = Law {
    kind: "stiffness-modes",
    family: Family::Material,
    sentence: "the stiffness varies smoothly over the body",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Modulus(&Modes),
};

const PARAMS: [EffectParam; 6] = [
    amplitude("square", 0, SQUARE),
    amplitude("square", 1, SQUARE),
    amplitude("square", 2, SQUARE),
    amplitude("mixed", 0, MIXED),
    amplitude("mixed", 1, MIXED),
    amplitude("mixed", 2, MIXED),
];

/// Within a factor of a thousand, as far as stiffness may differ from one part to another in other laws.
const fn amplitude(key: &'static str, axis: u8, doc: &'static str) -> EffectParam {
    EffectParam { lower: -7.0, upper: 7.0, ..component(key, axis, "1", 0.5, doc) }
}

struct Modes;

impl FieldLaw<1> for Modes {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 1] {
        let x = ((spot.rest - spot.center) / spot.size).to_array();
        let mut log = D::from(0.0);
        for a in 0..3 {
            log += p[a] * (x[a] * x[a]) + p[3 + a] * (x[(a + 1) % 3] * x[(a + 2) % 3]);
        }
        [log.exp()]
    }
}
