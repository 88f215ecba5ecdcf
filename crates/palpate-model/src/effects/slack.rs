//! Slack: a free smooth force field, which stands for any load that nobody has named. It is a bound, not an explanation.
//!
//! Force per volume f(X, t) = w(t) [f₀ + f_x (X−c)_x + f_y (X−c)_y + f_z (X−c)_z], affine over the body at rest about its centre c, during a time window
//! w = cos²(½π (t − t₀)/τ) for |t − t₀| < τ. Windows of width τ at distances τ add up to one: several of these cover any
//! time, and twelve amplitudes each cover any net force and moment and the first six ways to squeeze, stretch and shear.

use super::law::{Input, Number, Place, PointLaw, constant, dot, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use std::f64::consts::FRAC_PI_2;

pub(super) const LAW: Law = Law {
    kind: "slack",
    family: Family::Slack,
    sentence: "some load that changes smoothly over body and time acts on it",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Nodes(&Slack),
};

const FORCE: &str = "force per volume at the centre";
const BY_X: &str = "its change along x";
const BY_Y: &str = "its change along y";
const BY_Z: &str = "its change along z";
const CENTER: &str = "where the field is the force alone";

const PARAMS: [EffectParam; 17] = [
    component("force", 0, "N/m³", 1e3, FORCE),
    component("force", 1, "N/m³", 1e3, FORCE),
    component("force", 2, "N/m³", 1e3, FORCE),
    component("by_x", 0, "N/m⁴", 1e4, BY_X),
    component("by_x", 1, "N/m⁴", 1e4, BY_X),
    component("by_x", 2, "N/m⁴", 1e4, BY_X),
    component("by_y", 0, "N/m⁴", 1e4, BY_Y),
    component("by_y", 1, "N/m⁴", 1e4, BY_Y),
    component("by_y", 2, "N/m⁴", 1e4, BY_Y),
    component("by_z", 0, "N/m⁴", 1e4, BY_Z),
    component("by_z", 1, "N/m⁴", 1e4, BY_Z),
    component("by_z", 2, "N/m⁴", 1e4, BY_Z),
    EffectParam { default: Unstated::Center, ..component("center", 0, "m", 0.05, CENTER) },
    EffectParam { default: Unstated::Center, ..component("center", 1, "m", 0.05, CENTER) },
    EffectParam { default: Unstated::Center, ..component("center", 2, "m", 0.05, CENTER) },
    number("time", "s", [-1e6, 1e6, 0.5], Unstated::Fixed(0.0), "middle of the window"),
    // So wide that the window is one over any recording.
    number("width", "s", [1e-6, 1e9, 0.5], Unstated::Fixed(1e6), "half of the window: half strength lies at half of it"),
];

struct Slack;

impl PointLaw for Slack {
    const IS_LOAD: bool = true;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let s = (at.time() - at.p(15)) / at.p(16);
        if s.re().abs() >= 1.0 {
            return D::from(0.0);
        }
        let window = (s * FRAC_PI_2).cos().powi(2);
        let from = sub(constant(place.rest), at.vector(12));
        let field = std::array::from_fn(|i| at.p(i) + at.p(3 + i) * from[0] + at.p(6 + i) * from[1] + at.p(9 + i) * from[2]);
        -window * dot(field, at.x()) * place.measure
    }

    fn idle(&self, _place: &Place, z: &[f64]) -> bool {
        let at = Input::new(z);
        ((at.time() - at.p(15)) / at.p(16)).abs() >= 1.0
    }
}
