//! Why a member of a batch stopped.

use std::fmt;

/// A member that stopped: what happened, when, and what may help.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// What happened.
    pub kind: FailureKind,
    /// Simulation time [s] since the initial state at which it happened.
    pub time: f64,
    /// Details with numbers; those of a device with the way out.
    pub detail: String,
}

/// Kinds of failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// A state or a gradient is not a number.
    NotFinite,
    /// Newton's method did not converge.
    NewtonStalled,
    /// The linear solver did not converge or the matrix is not positive definite.
    LinearSolve,
    /// The body left the world (moved more than a thousand times its size).
    FellOut,
    /// There is no equilibrium to be found (nothing holds the body).
    NoEquilibrium,
    /// A parameter lies outside the range the model is defined for.
    BadParameter,
    /// The backend cannot compute what was asked for.
    Unsupported,
    /// The device that the backend runs on broke.
    Device,
}

impl FailureKind {
    /// What a user can try.
    pub fn hint(self) -> &'static str {
        match self {
            FailureKind::NotFinite => "use a smaller [time] step, or narrower bounds for the parameters named",
            FailureKind::NewtonStalled => "use a smaller [time] step, or set solver.rotation = \"lagged\"",
            FailureKind::LinearSolve => {
                "set solver.linear = \"cholesky\", use a smaller [time] step, or poisson_ratio further below 0.5"
            }
            FailureKind::FellOut => "check gravity, planes and initial velocity, or shorten [time] duration",
            FailureKind::NoEquilibrium => "add a [[clamp]], or start from initial.state = \"rest\"",
            FailureKind::BadParameter => "set bounds for the parameter in [[fit.parameter]]",
            FailureKind::Unsupported => "use --backend cpu",
            FailureKind::Device => "run again, with a smaller batch, or with --backend cpu; results so far are kept",
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.kind {
            FailureKind::NotFinite => "a number became infinite or undefined",
            FailureKind::NewtonStalled => "the nonlinear solve of a step did not converge",
            FailureKind::LinearSolve => "the linear solve of a step failed",
            FailureKind::FellOut => "the body left the world",
            FailureKind::NoEquilibrium => "no static equilibrium was found",
            FailureKind::BadParameter => "a parameter is out of range",
            FailureKind::Unsupported => "the backend cannot do this",
            FailureKind::Device => "the device failed",
        };
        if self.kind == FailureKind::Device {
            // It has no place in the simulation, and brings its own way out.
            return write!(f, "{what}: {}", self.detail);
        }
        write!(f, "{what} at t = {:.6} s: {} (hint: {})", self.time, self.detail, self.kind.hint())
    }
}

impl std::error::Error for Failure {}
