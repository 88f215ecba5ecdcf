//! A camera whose stated pose is off: the recording states it moved by `translation` and turned by `rotation` (a rotation vector in the
//! world, about the camera's centre) from where it truly was.
//!
//! A reading p of a camera stated at c therefore truly lies at c − t + exp(−[ω]×)(p − c), by Rodrigues' formula.

use super::law::{Number, dot};
use super::reading::{ReadingLaw, Seen};
use super::{EffectParam, Family, Law, Numbered, Site, Trial, Unstated, component, number};

pub(super) const LAW: Law = Law {
    kind: "camera-pose",
    family: Family::Measurement,
    sentence: "a camera stood elsewhere than the recording says",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Readings(&CameraPose),
};

const MOVED: &str = "stated minus true place of the camera";
const TURNED: &str = "rotation vector from the true to the stated pose, in the world's axes, about the camera's centre";

const PARAMS: [EffectParam; 7] = [
    number("camera", "1", [0.0, f64::INFINITY, 1.0], Unstated::Choice(Numbered::Camera), "number of the camera, counted from 0"),
    component("translation", 0, "m", 0.01, MOVED),
    component("translation", 1, "m", 0.01, MOVED),
    component("translation", 2, "m", 0.01, MOVED),
    component("rotation", 0, "rad", 0.02, TURNED),
    component("rotation", 1, "rad", 0.02, TURNED),
    component("rotation", 2, "rad", 0.02, TURNED),
];

struct CameraPose;

/// exp([w]×) v (Rodrigues 1840), smooth at w = 0.
fn turn<D: Number>(w: [D; 3], v: [D; 3]) -> [D; 3] {
    let t = dot(w, w);
    // sin θ/θ and (1 − cos θ)/θ² as functions of θ²; below 0.01 the series leaves 1e-17.
    let (a, b) = if t.re() < 1e-2 {
        let series = |first: f64, steps: [f64; 5]| {
            // first · (1 − t/s₁ (1 − t/s₂ (…)))
            steps.iter().rev().fold(D::one(), |sum, s| D::one() - sum * t / *s) * first
        };
        (series(1.0, [6.0, 20.0, 42.0, 72.0, 110.0]), series(0.5, [12.0, 30.0, 56.0, 90.0, 132.0]))
    } else {
        let angle = t.sqrt();
        (angle.sin() / angle, (D::one() - angle.cos()) / t)
    };
    let first = cross(w, v);
    let second = cross(w, first);
    std::array::from_fn(|i| v[i] + a * first[i] + b * second[i])
}

fn cross<D: Number>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl ReadingLaw for CameraPose {
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D> {
        let w = [-p[4], -p[5], -p[6]];
        let center = std::array::from_fn(|a| reading.center[a] - p[1 + a]);
        let ray = turn(w, reading.ray());
        Seen { point: std::array::from_fn(|a| center[a] + ray[a]), center, axis: turn(w, reading.axis) }
    }

    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        let w = [p[4], p[5], p[6]];
        let center = std::array::from_fn(|a| truth.center[a] + p[1 + a]);
        let ray = turn(w, truth.ray());
        Seen { point: std::array::from_fn(|a| center[a] + ray[a]), center, axis: turn(w, truth.axis) }
    }
}
