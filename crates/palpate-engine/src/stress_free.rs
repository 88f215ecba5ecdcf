//! Stress-free shapes of bodies whose given shape is their equilibrium (`InitialShape::Given`), found on the host for a backend that takes them as
//! an input of its batch.
//!
//! The shape X + W follows from all other numbers. It is one static problem a member and batch, with an unsymmetric matrix in double precision; what a
//! device does with W, step by step, is what it does with a rest shape that effects give.

use crate::{Failure, ParamBatch};
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::Plan;
use std::fmt::Debug;

/// Finds stress-free shapes.
pub trait StressFree: Debug + Send + Sync {
    /// For the members of one plan after another batch.
    fn open(&self, plan: &Plan) -> Box<dyn StressFreeShapes>;
}

/// Stress-free shapes of one plan's members, and how they follow from the parameters.
pub trait StressFreeShapes: Debug + Send + Sync {
    /// W `[B][N]` [m] of a batch, or why a member has none.
    fn find(&mut self, theta: &ParamBatch) -> Vec<Result<Vec<DVec3>, Failure>>;

    /// Adds dW to the derivatives of a member's coefficients along directions.
    ///
    /// # Errors
    /// A linear solve fails.
    fn along(&self, member: usize, rates: &mut [Coefficients]) -> Result<(), Failure>;

    /// Turns the derivative of a cost by a member's W, which `gradient` brings, into derivatives by what W follows from.
    ///
    /// # Errors
    /// A linear solve fails.
    fn pull(&self, member: usize, sought: &Sought, gradient: &mut Coefficients) -> Result<(), Failure>;
}
