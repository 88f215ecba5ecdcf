//! A depth bias on one side of a plane in the world only: a part of the body that is translucent, wet or dark.
//!
//! The bias grows from 0 to its full size across the plane as ½ (1 + tanh(d/w)), d the reading's distance from the plane and w a small
//! width. The plane rests in the world, so this fits bodies that move little, or scenes seen at one instant. Only the direction of
//! `direction` counts, not its length.

use super::law::{Number, dot, sub};
use super::reading::{ReadingLaw, Seen};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};
use crate::params::Transform;

pub(super) const LAW: Law = Law {
    kind: "depth-bias-part",
    family: Family::Measurement,
    sentence: "the cameras read one part of the body too far",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Readings(&DepthBiasPart),
};

const fn direction(axis: u8, start: f64) -> EffectParam {
    EffectParam {
        key: "direction",
        axis: Some(axis),
        unit: "1",
        transform: Transform::Linear,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        typical: 1.0,
        default: Unstated::Stated(start),
        doc: "towards the side that is read wrong",
    }
}

const fn position(axis: u8) -> EffectParam {
    EffectParam {
        key: "position",
        axis: Some(axis),
        unit: "m",
        transform: Transform::Linear,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        typical: 0.05,
        default: Unstated::Center,
        doc: "a point of the plane where the bias begins",
    }
}

const PARAMS: [EffectParam; 8] = [
    number(
        "bias",
        "m",
        [f64::NEG_INFINITY, f64::INFINITY, 0.01],
        Unstated::Absent(0.0),
        "depth that readings of that part are too large by",
    ),
    direction(0, 1.0),
    direction(1, 0.0),
    direction(2, 0.0),
    position(0),
    position(1),
    position(2),
    number("width", "m", [1e-5, 1.0, 0.005], Unstated::Fixed(0.005), "half width of the blend at the plane"),
];

struct DepthBiasPart;

/// Bias at a reading [m].
fn bias<D: Number>(reading: &Seen<D>, p: &[D]) -> D {
    let direction = [p[1], p[2], p[3]];
    let d = dot(sub(reading.point, [p[4], p[5], p[6]]), direction) / dot(direction, direction).sqrt();
    p[0] * ((d / p[7]).tanh() + 1.0) * 0.5
}

impl ReadingLaw for DepthBiasPart {
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D> {
        reading.scaled(D::one() - bias(&reading, p) / reading.depth())
    }

    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        // reading − bias(reading) = truth has a solution between no bias and all of it; halved down to rounding.
        let z = truth.depth();
        let at = |b: f64| truth.scaled(1.0 + b / z);
        let (mut low, mut high) = (p[0].min(0.0), p[0].max(0.0));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle > bias(&at(middle), p) { high = middle } else { low = middle }
        }
        at(0.5 * (low + high))
    }
}
