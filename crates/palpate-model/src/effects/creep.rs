//! The body slowly gives way: its stiffness relaxes with the time since the start, E(t) = E (1 − c (1 − e^(−t/τ))).
//!
//! One term of a Prony series (Ferry, *Viscoelastic Properties of Polymers*, 1980) for a load that acts from the start on: the stiffness
//! depends on the time alone, not on the history of the strain, so a body that is loaded later relaxes by the same clock. A
//! static start sees the full E.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "creep",
    family: Family::Material,
    sentence: "the body slowly gives way under its load",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Aging(&Creep),
};

const PARAMS: [EffectParam; 2] = [
    number("fraction", "1", [-5.0, 0.95, 0.2], Unstated::Absent(0.0), "part of the stiffness that is lost in the end"),
    number("time", "s", [1e-3, 1e6, 0.5], Unstated::Stated(0.5), "time in which 63 % of that is lost"),
];

struct Creep;

impl FieldLaw<1> for Creep {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 1] {
        [-p[0] * (-(-(p[1].recip() * spot.elapsed)).exp() + 1.0) + 1.0]
    }
}
