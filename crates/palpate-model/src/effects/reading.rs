//! What a law of depth readings is: how a reading differs from the truth, and back.
//!
//! **Sign of every measurement effect: reading = truth + effect.** A depth bias of +2 cm means that readings are 2 cm too large; a camera
//! offset means that the recording states the camera so far off its true pose; a time offset of Δ means that the recording's clock
//! is Δ ahead; a marker offset means that the marker sits so far from the place that the files state. A fit undoes the effect before
//! it compares; a synthetic recording applies it.

use super::law::{Number, dot, sub};
use glam::DVec3;
use num_dual::Dual64;

/// A depth reading as a place in the world, and the camera that it was taken with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen<D> {
    /// World position of the reading [m].
    pub point: [D; 3],
    /// The camera's centre of projection [m].
    pub center: [D; 3],
    /// The camera's unit axis, along which depth counts.
    pub axis: [D; 3],
}

impl<D: Number> Seen<D> {
    /// From the camera to the point [m].
    pub fn ray(&self) -> [D; 3] {
        sub(self.point, self.center)
    }

    /// Depth along the camera's axis [m].
    pub fn depth(&self) -> D {
        dot(self.ray(), self.axis)
    }

    /// The same pixel at `factor` times the depth.
    pub fn scaled(self, factor: D) -> Seen<D> {
        let ray = self.ray();
        Seen { point: std::array::from_fn(|a| self.center[a] + ray[a] * factor), ..self }
    }
}

impl Seen<f64> {
    /// The same numbers as a type that carries derivatives (none yet).
    pub fn lift(&self) -> Seen<Dual64> {
        let lift = |v: [f64; 3]| v.map(Dual64::from);
        Seen { point: lift(self.point), center: lift(self.center), axis: lift(self.axis) }
    }

    /// The point [m].
    pub fn position(&self) -> DVec3 {
        DVec3::from_array(self.point)
    }
}

/// A law of depth readings. `p` are the law's parameters.
pub trait ReadingLaw: Sync {
    /// What would have been read without the effect.
    fn truth<D: Number>(&self, reading: Seen<D>, p: &[D]) -> Seen<D>;

    /// What is read of the truth; the inverse of [`ReadingLaw::truth`].
    fn reading(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64>;
}

/// A [`ReadingLaw`] without its type.
pub trait Reading: Sync {
    /// As [`ReadingLaw::truth`].
    fn undo(&self, reading: Seen<f64>, p: &[f64]) -> Seen<f64>;
    /// The same with first derivatives.
    fn undo_dual(&self, reading: Seen<Dual64>, p: &[Dual64]) -> Seen<Dual64>;
    /// As [`ReadingLaw::reading`].
    fn apply(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64>;
}

impl<L: ReadingLaw> Reading for L {
    fn undo(&self, reading: Seen<f64>, p: &[f64]) -> Seen<f64> {
        self.truth(reading, p)
    }

    fn undo_dual(&self, reading: Seen<Dual64>, p: &[Dual64]) -> Seen<Dual64> {
        self.truth(reading, p)
    }

    fn apply(&self, truth: Seen<f64>, p: &[f64]) -> Seen<f64> {
        self.reading(truth, p)
    }
}
