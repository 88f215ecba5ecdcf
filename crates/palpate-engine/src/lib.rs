//! The seam between physics and everything that uses it: [`Backend`] (whole time steps and their adjoints on resident
//! state, batch outermost) and [`Evaluate`] (parameters in, cost and derivatives out). [`Rollout`] joins the two and is
//! written once for all backends.
//!
//! Invariant: this room does not know how a step is computed, nor what the parameters are for.

mod backend;
mod evaluate;
mod failure;
mod part;
mod product;
mod residuals;
mod rollout;
mod rows;
mod stop;
mod stress_free;
mod tape;
pub mod tracking;

pub use backend::{Backend, BuildError};
pub use evaluate::{Curvature, Direction, Evaluate, Evaluation, MOST_SENSITIVITIES, ParamBatch, Request, Wanted};
pub use failure::{Failure, FailureKind, number};
pub use part::{Part, Share};
pub use residuals::{FrameResiduals, Misfit, ReadingResidual};
pub use rollout::{Rollout, Snapshot, Visitor};
pub use rows::{Linearised, ResidualRow, Rows, Source, Stream};
pub use stop::Stop;
pub use stress_free::{StressFree, StressFreeShapes};
