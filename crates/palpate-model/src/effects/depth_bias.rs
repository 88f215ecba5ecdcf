//! A constant added to every depth reading, along the camera's axis: a zero point that is off, light that enters the material before it
//! returns (Microsoft Kinect and Intel RealSense on translucent silicone read centimetres too far).

use super::law::Number;
use super::reading::{ReadingLaw, Seen};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "depth-bias",
    family: Family::Measurement,
    sentence: "the cameras read the same distance too far everywhere",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Readings(&DepthBias),
};

const PARAMS: [EffectParam; 1] = [number(
    "bias",
    "m",
    [f64::NEG_INFINITY, f64::INFINITY, 0.01],
    Unstated::Absent(0.0),
    "depth that readings are too large by",
)];

struct DepthBias;

impl ReadingLaw for DepthBias {
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D> {
        reading.scaled(D::one() - p[0] / reading.depth())
    }

    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        truth.scaled(1.0 + p[0] / truth.depth())
    }
}
