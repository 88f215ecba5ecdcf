//! Tracking: the body at every frame of a recording, without knowing what moved it (Wang et al. 2015, section 4).
//!
//! A frame's displacement u is the one of largest posterior probability. With the potential V of a prior [J], the temperature η [J] and the cost D
//! of the readings, it is the least of
//!
//! `Φ(u) = V(u)/η + D(u)`.
//!
//! The prior is a step of backward Euler from the frame before, or the equilibrium under the loads. η says how far the prior may be wrong: η is
//! that of the largest evidence, `η = 2 ΔV/γ` for γ well-determined directions (MacKay, *Neural Computation* 4, 1992).
//!
//! Far from the readings D is that of a mixture: every reading belongs to all visible parts of the surface within a reach that shrinks. Near them
//! D is the cost that a fit has, in a band that shrinks.

mod course;
mod sighting;
#[cfg(test)]
mod tests;

pub use course::track;
pub use sighting::{BEHIND, Correspond, Eye, Mixing, PIXEL, Place, REACH, Rays, Share, Sighting, THROUGH};

use crate::failure::Failure;
use glam::DVec3;

/// Displacements and velocities of all nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Displacement [m] `[N]`.
    pub displacement: Vec<DVec3>,
    /// Velocity [m/s] `[N]`.
    pub velocity: Vec<DVec3>,
}

/// What holds a body together while readings draw it.
#[derive(Clone, Copy, Debug)]
pub enum Prior<'a> {
    /// Elasticity and loads alone: the equilibrium.
    Equilibrium,
    /// A step of backward Euler from a pose, of so many seconds.
    Step(&'a Pose, f64),
    /// The same body with the same inertia, but at the pose itself: whatever acts there is balanced by something unknown.
    Held(&'a Pose, f64),
}

/// What draws it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pull {
    /// Depth points belong to visible places of the surface by a Gaussian of this standard deviation [m], or by a share of outliers to none.
    Mixture {
        /// Standard deviation [m].
        spread: f64,
        /// Share of points that belong to nothing, 0 to 1.
        outliers: f64,
    },
    /// The cost of a fit, in a band of this half width [m].
    Surface {
        /// Half width [m].
        band: f64,
    },
}

/// The problem of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Number of the frame in the plan's recording.
    pub frame: usize,
    /// What holds the body.
    pub prior: Prior<'a>,
    /// η [J].
    pub temperature: f64,
}

/// How well readings are met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Met {
    /// Scalar residuals of the frame.
    pub readings: usize,
    /// Those that met the body.
    pub matched: usize,
    /// Root mean square of these [m].
    pub rms: f64,
    /// D(u).
    pub cost: f64,
}

impl Met {
    /// Share of the readings that met the body; one without any.
    pub fn share(&self) -> f64 {
        if self.readings == 0 { 1.0 } else { self.matched as f64 / self.readings as f64 }
    }
}

/// What is known of a pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certainty {
    /// Draws of the posterior, less its mean [m] `[S, N]`; empty where the body is too large for a factor.
    pub posterior: Vec<Vec<DVec3>>,
    /// The same of the prior.
    pub prior: Vec<Vec<DVec3>>,
    /// γ: the number of directions that the readings determine.
    pub determined: f64,
    /// ΔV: potential of the prior above its least value [J], to second order.
    pub excess: f64,
    /// Elastic energy, up to a constant [J].
    pub energy: f64,
}

/// A backend that moves a body to readings.
pub trait Follow {
    /// The pose at the start.
    ///
    /// # Errors
    /// There is none.
    fn start(&mut self) -> Result<Pose, Failure>;
    /// One step of Gauss–Newton's method with a line search on Φ; returns by how much its model says that Φ falls.
    ///
    /// # Errors
    /// A solve fails.
    fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure>;
    /// How well the frame's readings are met at u, in a band of this half width [m].
    fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met;
    /// Draws of the posterior at u from standard normal draws `[S, N]`.
    ///
    /// # Errors
    /// A solve fails.
    fn certainty(&mut self, problem: &Problem, band: f64, u: &[DVec3], draws: &[Vec<DVec3>]) -> Result<Certainty, Failure>;
    /// Share of the frame's rays that pass through the body at u, and so prove that it is not there, over all rays that meet it.
    ///
    /// # Errors
    /// A device breaks.
    fn pierced(&mut self, frame: usize, u: &[DVec3]) -> Result<f64, Failure>;
    /// Which patches of the surface have a reading on their line of sight `[patches]`.
    ///
    /// # Errors
    /// A device breaks.
    fn seen(&mut self, frame: usize, u: &[DVec3]) -> Result<Vec<bool>, Failure>;
}

/// Choices of a tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The prior is a step from the frame before; else the equilibrium.
    pub dynamic: bool,
    /// η [J]; `None` = that of the largest evidence.
    pub temperature: Option<f64>,
    /// Share of points that belong to nothing.
    pub outliers: f64,
    /// Spread at which the first phase begins [m]; `None` = half the body.
    pub spread: Option<f64>,
    /// Half width of the band at its widest [m]: that of the plan.
    pub widest: f64,
    /// Distance between neighbouring places of the surface [m].
    pub spacing: f64,
    /// Noise of a reading [m].
    pub noise: f64,
    /// Size of the body [m].
    pub size: f64,
}

/// What is wrong with a tracked frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// Share of matched readings, against the median of the sequence.
    Unmatched(f64),
    /// Root mean square of the matched readings [m].
    Far(f64),
    /// Share of rays that pass through the body.
    Pierced(f64),
    /// Elastic energy over that of the frame before.
    Jumped(f64),
    /// No reading at all: the prior's own.
    Unseen,
}

/// A tracked frame.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// Number of the frame in the recording.
    pub frame: usize,
    /// Time on the recording's clock [s].
    pub time: f64,
    /// The pose.
    pub pose: Pose,
    /// How well the readings are met.
    pub met: Met,
    /// What is known of it.
    pub certainty: Certainty,
    /// Which patches of the surface have a reading on their line of sight.
    pub seen: Vec<bool>,
    /// Temperature that it was found at [J].
    pub temperature: f64,
    /// Steps of Gauss–Newton's method.
    pub steps: usize,
    /// True where the first phase was needed.
    pub cold: bool,
    /// What is wrong.
    pub doubts: Vec<Doubt>,
}
