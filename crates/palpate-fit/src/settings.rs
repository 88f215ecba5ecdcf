//! Knobs of a fit.

use palpate_model::scene::Optimizer;

/// How a fit is run.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Which optimiser.
    pub optimizer: Optimizer,
    /// Most iterations per start.
    pub iterations: usize,
    /// Number of starts, at least 1.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Stopping criteria.
    pub tolerance: Tolerance,
    /// Longest step of any optimiser along one axis of z; 1.5 is a factor 4.5 in a parameter fitted as its logarithm.
    pub max_step: f64,
    /// Where Gauss–Newton goes on from: how it stood when an earlier search ended.
    pub walk: Walk,
    /// Steps of Rprop.
    pub rprop: RpropSteps,
    /// What is known about the measurement's errors.
    pub errors: ErrorModel,
}

impl Settings {
    /// Defaults for an optimiser.
    pub fn new(optimizer: Optimizer) -> Settings {
        Settings {
            optimizer,
            iterations: 50,
            starts: 1,
            seed: 1,
            tolerance: Tolerance::default(),
            max_step: 1.5,
            walk: Walk::default(),
            rprop: RpropSteps::default(),
            errors: ErrorModel::default(),
        }
    }
}

/// How Gauss–Newton's damping stands between two iterations. A search that goes on with it where another ended is one with that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Longest step that it would try next; infinite before the first.
    pub reach: f64,
    /// Damping: relative to each number's curvature, but absolute where that is known by products; `None` before the first step.
    pub damping: Option<f64>,
    /// Rejected steps in a row that changed nothing.
    pub level: u32,
}

impl Default for Walk {
    fn default() -> Walk {
        Walk { reach: f64::INFINITY, damping: None, level: 0 }
    }
}

/// Stopping criteria; a run that meets one of them has converged.
#[derive(Clone, Debug, PartialEq)]
pub struct Tolerance {
    /// Distance to the optimum in standard errors, as the curvature promises it: √(2 n ΔJ/s²) for the decrease ΔJ that is left to gain,
    /// n residuals and s² = max(1, 2 n J/(n − q)). Of optimisers that know a curvature; 0 for digits that no data have.
    pub decrement: f64,
    /// Decrease of the cost, relative to the cost.
    pub cost: f64,
    /// Largest entry of the projected gradient by z, relative to the cost.
    pub gradient: f64,
    /// Longest step along one axis of z.
    pub step: f64,
}

impl Default for Tolerance {
    fn default() -> Tolerance {
        Tolerance { decrement: 0.01, cost: 1e-9, gradient: 1e-8, step: 1e-7 }
    }
}

/// Step sizes of Rprop in z.
#[derive(Clone, Debug, PartialEq)]
pub struct RpropSteps {
    /// First step along every axis.
    pub initial: f64,
    /// Factor while the sign of a partial derivative stays.
    pub growth: f64,
    /// Factor when it changes.
    pub shrink: f64,
    /// Smallest step; a run whose steps are all this small has converged.
    pub min: f64,
    /// Largest step.
    pub max: f64,
}

impl Default for RpropSteps {
    /// Factors of Riedmiller & Braun (1993).
    fn default() -> RpropSteps {
        RpropSteps { initial: 0.3, growth: 1.2, shrink: 0.5, min: 1e-6, max: 1.5 }
    }
}

/// Errors of the measurement for standard errors of the result.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorModel {
    /// Size of the error that residuals of a group share, over the noise σ that the cost divides by.
    pub systematic: f64,
    /// Number of groups (frames, markers) whose systematic errors are independent; at least 1.
    pub groups: usize,
    /// How many residuals count as one independent reading; at least 1.
    pub design_effect: f64,
}

impl Default for ErrorModel {
    fn default() -> ErrorModel {
        ErrorModel { systematic: 0.0, groups: 1, design_effect: 1.0 }
    }
}
