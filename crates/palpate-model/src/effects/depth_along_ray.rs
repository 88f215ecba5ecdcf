//! Depth that was measured along each pixel's ray but read as depth along the camera's axis.
//!
//! Time-of-flight cameras and some renderers give the length of the ray, L = z √(1 + x² + y²) for a pixel at (x, y) on the
//! normalised image plane. With the blend b a reading is z (1 + b (√(1 + x² + y²) − 1)): exact at b = 0 (along the axis) and b = 1 (along
//! the ray); values between serve the search alone.

use super::law::{Number, dot};
use super::reading::{ReadingLaw, Seen};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "depth-along-ray",
    family: Family::Measurement,
    sentence: "depth was measured along each pixel's ray, not along the camera's axis",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Readings(&AlongRay),
};

// Wider than [0, 1], so that noise may put the value on either side of both.
const PARAMS: [EffectParam; 1] =
    [number("blend", "1", [-0.5, 1.5, 0.5], Unstated::Absent(0.0), "0: depth along the axis, 1: along the ray")];

struct AlongRay;

/// Reading over true depth; the same for every depth of a pixel.
fn factor<D: Number>(seen: &Seen<D>, p: &[D]) -> D {
    let ray = seen.ray();
    let slant = dot(ray, ray).sqrt() / seen.depth();
    p[0] * (slant - 1.0) + 1.0
}

impl ReadingLaw for AlongRay {
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D> {
        reading.scaled(factor(&reading, p).recip())
    }

    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        truth.scaled(factor(&truth, p))
    }
}
