//! Finds the parameters that explain a measurement: charts, optimisers, many starts in one batch, uncertainty.
//!
//! Invariant: this room does not know what is simulated, nor how. Of physics it sees [`palpate_engine::Evaluate`] (θ in, cost
//! and derivatives out), the transform and typical size of a parameter and, of a field with a prior, which values lie beside each other.

mod chart;
mod controls;
mod dense;
mod expected;
mod fit;
mod journal;
mod known;
mod multistart;
mod optimise;
mod priors;
mod problem;
mod settings;
mod uncertainty;
mod vibrations;

pub use chart::{AtBound, Chart};
pub use controls::{Controls, Zones};
pub use expected::{Expected, expected};
pub use fit::{FitError, FitResult, FittedField, FittedParameter, Hooks, Lead, Progress, Run, Worth, fit};
pub use journal::{JournalError, JournalFile};
pub use known::KnownRow;
pub use optimise::{Outcome, Sample, Search, Status, Stop, want};
pub use priors::{FieldPosterior, FieldPrior, Hyper, Mean, Tried};
pub use problem::{FitScene, FreeParameter, Problem, Slot, Want};
pub use settings::{ErrorModel, RpropSteps, Settings, Tolerance, Walk};
pub use vibrations::{Vibration, vibrations};

#[cfg(test)]
mod tests;
