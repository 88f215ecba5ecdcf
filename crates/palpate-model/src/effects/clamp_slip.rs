//! Clamps that are not where they should be, or slip: a small rigid motion of all held regions, constant and growing with time.
//!
//! A held point X is wanted at c + d(t) + R(t)(X − c), followed by the clamp's own motion, with c the middle of the first clamp, d = offset + t ·
//! drift, and R the rotation of Cayley's vector r = turn + t · turning (its angle is 2 atan(|r|/2), for small ones |r|). t counts from the
//! start of the simulation. A body that starts at rest and not in equilibrium is jerked by a constant offset.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, component};
use crate::params::changes::HOLD;

const OFFSET: &str = "displacement of the clamps";
const TURN: &str = "rotation of the clamps about their middle";
const DRIFT: &str = "speed at which the clamps slip";
const TURNING: &str = "angular speed at which the clamps slip";

pub(super) const LAW: Law = Law {
    kind: "clamp-slip",
    family: Family::Shape,
    sentence: "the clamp slips or is not where it should be",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Clamps(&Slip),
};

const PARAMS: [EffectParam; 12] = [
    component("offset", 0, "m", 0.002, OFFSET),
    component("offset", 1, "m", 0.002, OFFSET),
    component("offset", 2, "m", 0.002, OFFSET),
    component("turn", 0, "rad", 0.02, TURN),
    component("turn", 1, "rad", 0.02, TURN),
    component("turn", 2, "rad", 0.02, TURN),
    component("drift", 0, "m/s", 0.005, DRIFT),
    component("drift", 1, "m/s", 0.005, DRIFT),
    component("drift", 2, "m/s", 0.005, DRIFT),
    component("turning", 0, "rad/s", 0.05, TURNING),
    component("turning", 1, "rad/s", 0.05, TURNING),
    component("turning", 2, "rad/s", 0.05, TURNING),
];

struct Slip;

impl FieldLaw<HOLD> for Slip {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; HOLD] {
        let mut hold = [D::from(0.0); HOLD];
        hold[0] = D::from(1.0);
        for k in 0..6 {
            hold[2 + k] = p[k] + p[6 + k] * spot.elapsed;
        }
        hold
    }
}
