//! A clamp that gives way: between the held surface and the clamp lies a layer of the body's own material, of thickness ℓ.
//!
//! Traction = (λ + 2μ) u / ℓ over the held surface, a Robin condition in Nitsche's form (Juntunen & Stenberg, *Math. Comp.* 78, 2009), exact
//! down to ℓ = 0, where it is the stiff clamp. What is held inside the body is held 1/(1 + 20 ℓ/h) times as stiffly.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};
use crate::params::changes::HOLD;

pub(super) const LAW: Law = Law {
    kind: "compliant-clamp",
    family: Family::Shape,
    sentence: "the clamp gives way under the load",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Clamps(&Compliant),
};

const PARAMS: [EffectParam; 1] = [number(
    "layer",
    "m",
    [0.0, 10.0, 0.005],
    Unstated::Absent(0.0),
    "thickness of a layer of the body's material, held sideways, that gives as much as the clamp",
)];

struct Compliant;

impl FieldLaw<HOLD> for Compliant {
    fn values<D: Number>(&self, _: &Spot, p: &[D]) -> [D; HOLD] {
        let mut hold = [D::from(0.0); HOLD];
        (hold[0], hold[1]) = (D::from(1.0), p[0]);
        hold
    }
}
