//! Depth readings that are too large by a constant share: a wrong unit step, a baseline or focal length that is off.

use super::law::Number;
use super::reading::{ReadingLaw, Seen};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "depth-scale",
    family: Family::Measurement,
    sentence: "the cameras stretch every distance by the same share",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Readings(&DepthScale),
};

const PARAMS: [EffectParam; 1] =
    [number("error", "1", [-0.5, 1.0, 0.01], Unstated::Absent(0.0), "share of its depth that a reading is too large by")];

struct DepthScale;

impl ReadingLaw for DepthScale {
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D> {
        reading.scaled((p[0] + 1.0).recip())
    }

    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        truth.scaled(1.0 + p[0])
    }
}
