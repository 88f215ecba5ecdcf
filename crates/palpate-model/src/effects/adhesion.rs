//! Adhesion to contact planes: a surface that has come close is pulled towards the plane until the pull-off pressure is passed.
//!
//! Traction σ S(g) against the gap g, with S = 1 up to the end w of the contact layer and a C² fall to zero over the range r beyond:
//! a cohesive zone (Barenblatt, *Advances in Applied Mechanics* 7, 1962; Xu & Needleman, *J. Mech. Phys. Solids* 42, 1994) whose
//! work of separation is σ (r/2 + w). Reversible: what separates can stick again. The pull is normal to the plane; holding sideways is
//! `coulomb-friction`. Valid while r is small against the body; peeling is resolved where r is not small against a cell times
//! σ over Young's modulus.

use super::law::{Input, Number, Place, PointLaw, along_way};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "adhesion",
    family: Family::Contact,
    sentence: "the body sticks to the ground and must be pulled off",
    params: &PARAMS,
    trial: Trial::Saturates,
    site: Site::Contact(&Adhesion),
};

const PARAMS: [EffectParam; 2] = [
    number("pressure", "Pa", [0.0, 1e9, 500.0], Unstated::Absent(0.0), "pull-off force per area"),
    number("range", "m", [1e-6, 1.0, 1e-3], Unstated::Fixed(1e-3), "distance beyond contact at which the pull ends"),
];

struct Adhesion;

impl PointLaw for Adhesion {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (pressure, range) = (at.p(0), at.p(1));
        let depth = |gap: D| {
            let beyond = gap - place.width;
            if beyond.re() >= range.re() {
                D::from(0.0)
            } else if beyond.re() <= 0.0 {
                -beyond + range * 0.5
            } else {
                // ∫ of the quintic step 10 s³ − 15 s⁴ + 6 s⁵ with s falling from 1 at the layer to 0 at the range.
                let s = (range - beyond) / range;
                range * s.powi(4) * (s * s - s * 3.0 + 2.5)
            }
        };
        -pressure * along_way(place, at.gaps(), depth) * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        let at = Input::new(z);
        let [old, new] = at.gaps();
        old.min(new) - place.width >= at.p(1)
    }
}
