//! Damping that does not depend on frequency: a stress that opposes the strain's change and is proportional to the strain itself.
//!
//! Reid's element (Reid, *J. R. Aeronaut. Soc.* 60, 1956): force η k |u| sgn(u̇), here φ = η √(2a₀ + δ²) √(2d + (sΔt)²). In free vibration
//! about the stress-free state a cycle loses 2 η k u², which is a damping ratio η/π at every frequency. The strain counts from the
//! stress-free state: a body that hangs under its own weight is also held by about η times its sag.

use super::cell::{CellLaw, Increment};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

/// Strain rate [1/s] below which the law is viscous, so that nothing sticks.
const SLOW: f64 = 1e-2;
/// Strain below which the amplitude is not seen: the root has no derivative at zero.
const SMALL: f64 = 1e-4;

pub(super) const LAW: Law = Law {
    kind: "structural-damping",
    family: Family::Material,
    sentence: "the material loses the same part of its energy in every swing, fast or slow",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Cells(&Damping),
};

const PARAMS: [EffectParam; 1] = [number(
    "loss",
    "1",
    [0.0, 1.5, 0.1],
    Unstated::Absent(0.0),
    "opposing stress over elastic stress; the damping ratio is this over π",
)];

struct Damping;

impl CellLaw for Damping {
    const LOSSY: bool = true;

    fn loss<D: Number>(&self, s: &Increment<D>, p: &[D]) -> D {
        let slow = SLOW / s.rate;
        p[0] * (s.old * 2.0 + SMALL * SMALL).sqrt() * (s.density * 2.0 + slow * slow).sqrt()
    }
}
