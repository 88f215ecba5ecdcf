//! Finds the parameters that explain a measurement: charts, optimisers, many starts in one batch, uncertainty.
//!
//! Invariant: this room does not know what is simulated, nor how. Of physics it sees [`palpate_engine::Evaluate`] (θ in, cost
//! and derivatives out) and the transform and typical size of a parameter.

mod chart;
mod dense;
mod fit;
mod journal;
mod known;
mod multistart;
mod optimise;
mod problem;
mod settings;
mod uncertainty;

pub use chart::{AtBound, Chart};
pub use fit::{FitError, FitResult, FittedField, FittedParameter, Hooks, Lead, Progress, Run, Worth, fit};
pub use journal::{JournalError, JournalFile};
pub use known::KnownRow;
pub use optimise::{Outcome, Sample, Search, Status, Stop, want};
pub use problem::{FitScene, FreeParameter, Problem, Slot, Want};
pub use settings::{ErrorModel, RpropSteps, Settings, Tolerance, Walk};

#[cfg(test)]
mod tests;
