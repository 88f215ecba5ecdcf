//! Finds what a fitted model lacks: residuals against their null, hypotheses from the table of effects, verdicts on data left out.
//!
//! Invariant: statistics and workflow only. This room knows the fit's numbers and the law table; what a hypothesis predicts it asks of a
//! [`Laboratory`], and it never computes physics, nor names a backend, a file or an effect.

mod cells;
mod change;
mod crossval;
mod diagnosis;
mod judgement;
mod laboratory;
mod linear;
mod locate;
mod movement;
mod noise;
mod null;
mod quantity;
mod score;
mod separation;
mod still;
mod workflow;

pub use cells::Regions;
pub use change::{Candidate, Change, can_be_freed, candidates};
pub use diagnosis::{Diagnosis, Found, FoundNumber, Instant, Level, MapEntry, Slack, SlackWindow, Tried, Verdict, in_words};
pub use judgement::prior::Strange;
pub use laboratory::{Baseline, Field, Fit, LabError, Laboratory, Model, Number, Reading, Readings, Setting, Start, Wall};
pub use linear::least_squares;
pub use locate::{Place, direction};
pub use movement::Movement;
pub use quantity::{millimetres, stated};
pub use separation::{Separated, Separation, Way};
pub use workflow::{Options, Policy, diagnose};

#[cfg(test)]
mod tests;
