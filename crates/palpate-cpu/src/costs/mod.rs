//! Costs: how readings are compared with a displacement field, one file each.
//!
//! Frame times need not be multiples of the step: between two states the displacement is the cubic Hermite curve through both
//! displacements and velocities.

pub mod depth;
pub mod displacements;
pub mod markers;
pub mod matching;
#[cfg(test)]
pub(crate) mod tests;

use crate::linear::vector::Nodes;
use glam::DVec3;
use palpate_engine::{Direction, FrameResiduals, ReadingResidual, ResidualRow, Rows};
use palpate_model::effects::sensors::Sensors;
pub use palpate_model::observation::instant::Instant;
use palpate_model::observation::{Frame, Observation};
use palpate_model::plan::Plan;
use std::fmt::Debug;
use std::sync::Arc;

/// Every cost, ready for a recording of a plan, in the order in which residuals stand in a frame.
fn registry(plan: &Plan, observation: &Observation) -> Vec<Box<dyn Cost>> {
    vec![Box::new(depth::Depth::new(plan, observation)), Box::new(markers::Markers), Box::new(displacements::Displacements)]
}

/// A way to compare readings with a displacement field, ready for one recording.
pub trait Cost: Debug + Send + Sync {
    /// Residuals of a frame at displacement `u` `[N]`; adds to the sums of the frame.
    fn compare(&self, look: Look, u: &[DVec3], sums: &mut Sums) -> Arc<dyn Residuals>;
}

/// Scalar residuals r `[R]` of one cost in one frame at one displacement.
pub trait Residuals: Debug + Send + Sync {
    /// Every residual, reading by reading.
    fn readings(&self, look: Look) -> Vec<ReadingResidual>;
    /// ρ′(r)/σ² of every residual `[R]` [1/m]; zero where a reading met nothing.
    fn influences(&self, look: Look, scale: f64) -> Vec<f64>;
    /// Hands every residual to `visit` in order, with its derivatives along the tangents `[Q]` (Jacobian-vector products): by the
    /// displacement, and by what measurement effects change beside it. Readings that met nothing have derivatives of zero.
    fn rows(&self, look: Look, u: &[DVec3], along: Along, visit: &mut dyn FnMut(ResidualRow, &[f64]));
    /// Adds Σ f ∂r/∂u to `out` `[N]` and Σ f ∂r/∂θ at fixed displacement to `theta` `[P]`, for `factors` f `[R]` (vector-Jacobian
    /// product).
    fn pull(&self, look: Look, u: &[DVec3], factors: &[f64], out: &mut [DVec3], theta: &mut [f64]);
}

/// A frame of the recording as the measurement effects of one member understand it.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// Body.
    pub plan: &'a Plan,
    /// Recording.
    pub observation: &'a Observation,
    /// The member's measurement effects.
    pub sensors: &'a Sensors,
    /// Number of the frame.
    pub frame: usize,
}

impl<'a> Look<'a> {
    /// The frame.
    pub fn seen(&self) -> &'a Frame {
        &self.observation.frames[self.frame]
    }
}

/// Tangents at a frame.
#[derive(Clone, Copy, Debug)]
pub struct Along<'a> {
    /// Directions in θ `[Q]`.
    pub directions: &'a [Direction],
    /// Derivatives of the displacement along them `[Q][N]`.
    pub du: &'a [Nodes],
}

impl Along<'_> {
    /// True when a direction has a component at a place in θ.
    pub fn moves(&self, place: usize) -> bool {
        self.directions.iter().any(|d| d.component(place) != 0.0)
    }

    /// Adds to derivatives `[Q]` of a residual what it depends on θ beside the displacement: a sparse row of (place in θ, value).
    pub fn add_direct(&self, row: &[(usize, f64)], derivatives: &mut [f64]) {
        if !row.is_empty() {
            for (d, direction) in derivatives.iter_mut().zip(self.directions) {
                *d += row.iter().map(|(place, value)| direction.component(*place) * value).sum::<f64>();
            }
        }
    }
}

/// Sums over the residuals of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σ ρ(r)/σ², not yet divided by the number of residuals.
    pub cost: f64,
    /// Scalar residuals that met something.
    pub matched: usize,
    /// Σ r² of those [m²].
    pub squares: f64,
    /// Σ φ of matched depth points [m].
    pub signed: f64,
}

impl Sums {
    /// Adds a vector of residuals [m] with noise σ [m].
    fn add_vector(&mut self, r: DVec3, noise: f64) {
        self.cost += 0.5 * r.length_squared() / (noise * noise);
        self.squares += r.length_squared();
        self.matched += 3;
    }
}

/// All costs.
#[derive(Debug)]
pub struct Costs(Vec<Box<dyn Cost>>);

impl Costs {
    /// Ready for a recording of a plan.
    pub fn new(plan: &Plan, observation: &Observation) -> Costs {
        Costs(registry(plan, observation))
    }

    /// Compares a frame with displacement `u` `[N]`.
    pub fn compare(&self, look: Look, u: Nodes) -> Compared {
        let mut sums = Sums::default();
        let parts = self.0.iter().map(|cost| cost.compare(look, &u, &mut sums)).collect();
        Compared { frame: look.frame, u, sums, parts }
    }
}

/// A frame compared with one displacement field.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Number of the frame.
    pub frame: usize,
    /// The displacement [m] `[N]`.
    pub u: Nodes,
    /// Sums over its residuals.
    pub sums: Sums,
    parts: Vec<Arc<dyn Residuals>>,
}

impl Compared {
    /// dJ/du `[N]`; `scale` is 1/n. What measurement effects change besides is added to dJ/dθ, `theta` `[P]`.
    pub fn gradient(&self, look: Look, scale: f64, theta: &mut [f64]) -> Nodes {
        let mut out = vec![DVec3::ZERO; self.u.len()];
        for part in &self.parts {
            part.pull(look, &self.u, &part.influences(look, scale), &mut out, theta);
        }
        out
    }

    /// Jᵀ W J v by the displacement `[N]`, for one tangent v; `scale` is 1/n. What measurement effects add by θ goes to `theta` `[P]`.
    pub fn product(&self, look: Look, along: Along, scale: f64, theta: &mut [f64]) -> Nodes {
        let mut out = vec![DVec3::ZERO; self.u.len()];
        for part in &self.parts {
            let mut factors = Vec::new();
            part.rows(look, &self.u, along, &mut |row, d| factors.push(curvature(&row, scale) * d[0]));
            part.pull(look, &self.u, &factors, &mut out, theta);
        }
        out
    }

    /// Adds the Gauss–Newton gradient `[Q]` and matrix `[Q, Q]`.
    pub fn gauss_newton(&self, look: Look, along: Along, scale: f64, gradient: &mut [f64], matrix: &mut [f64]) {
        let q = along.du.len();
        self.visit(look, along, &mut |row, d| {
            let Some(residual) = row.value else { return };
            let weight = curvature(&row, scale);
            for a in 0..q {
                gradient[a] += weight * residual * d[a];
                for b in 0..q {
                    matrix[a * q + b] += weight * d[a] * d[b];
                }
            }
        });
    }

    /// Every scalar residual with its derivatives.
    pub fn rows(&self, look: Look, along: Along) -> Rows {
        let mut out = Rows::default();
        self.visit(look, along, &mut |row, d| {
            out.residuals.push(row);
            out.sensitivity.extend_from_slice(d);
        });
        out
    }

    /// Every residual, for reports.
    pub fn residuals(&self, look: Look) -> FrameResiduals {
        FrameResiduals { frame: self.frame, readings: self.parts.iter().flat_map(|part| part.readings(look)).collect() }
    }

    fn visit(&self, look: Look, along: Along, visit: &mut dyn FnMut(ResidualRow, &[f64])) {
        self.parts.iter().for_each(|part| part.rows(look, &self.u, along, visit));
    }
}

/// Gauss–Newton weight of a residual in the cost.
fn curvature(row: &ResidualRow, scale: f64) -> f64 {
    scale * row.weight / (row.noise * row.noise)
}

/// Σ factor · vector over u₀, v₀, u₁, v₁.
pub fn blend(factors: &[f64; 4], vectors: [&[DVec3]; 4]) -> Nodes {
    (0..vectors[0].len()).map(|i| (0..4).map(|c| factors[c] * vectors[c][i]).sum()).collect()
}
