//! The stress-free shape differs from the one given: X + W(X), with W a few smooth modes about the place where the body is held.
//!
//! With ξ = X − anchor (the middle of the first clamp; the centre of mass of a free body): stretch W_a = s_a ξ_a; bend along axis a
//! towards axis d: W_d = ½ κ ξ_a², W_a = −κ ξ_a ξ_d, to first order the pure bending of a bar by curvature κ. Every cell's
//! stress-free state is its own deformation at W, rotation removed, so X + W is free of stress whatever the size
//! of W; that the bend keeps lengths holds for small κ·length. Mass and contact area stay those of the given shape. Clamps hold the stress-free
//! shape. A free body starts at rest in the shape X + W.
//!
//! Elastic points of tetrahedra have X + W as the shape that deformations are counted from, volumes included
//! (`palpate-cpu/src/terms/unstrained.rs`); for small W both are the same.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};

const STRETCH: &str = "the stress-free shape is longer by this part";
const BEND: &str = "curvature of the stress-free shape: by ½ curvature · distance² from where the body is held (the middle of its first \
                    clamp, else its centre of mass)";

pub(super) const LAW: Law = Law {
    kind: "rest-shape",
    family: Family::Shape,
    sentence: "the unloaded body is stretched or bent compared with the shape given",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Rest(&Modes),
};

const fn bend(key: &'static str) -> EffectParam {
    number(key, "1/m", [-1e3, 1e3, 0.5], Unstated::Absent(0.0), BEND)
}

const PARAMS: [EffectParam; 9] = [
    component("stretch", 0, "1", 0.02, STRETCH),
    component("stretch", 1, "1", 0.02, STRETCH),
    component("stretch", 2, "1", 0.02, STRETCH),
    bend("bend_x_to_y"),
    bend("bend_x_to_z"),
    bend("bend_y_to_z"),
    bend("bend_y_to_x"),
    bend("bend_z_to_x"),
    bend("bend_z_to_y"),
];

struct Modes;

impl FieldLaw<3> for Modes {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 3] {
        let x = (spot.rest - spot.anchor).to_array();
        let mut w = [p[0] * x[0], p[1] * x[1], p[2] * x[2]];
        for a in 0..3 {
            for k in 0..2 {
                let (d, curvature) = ((a + 1 + k) % 3, p[3 + 2 * a + k]);
                w[d] += curvature * (0.5 * x[a] * x[a]);
                w[a] -= curvature * (x[a] * x[d]);
            }
        }
        w
    }
}
