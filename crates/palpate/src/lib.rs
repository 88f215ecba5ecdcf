//! palpate fits the physics of soft bodies to measured motion.
//!
//! An [`Experiment`] is a scene file with its recording, cut into cells and ready to be computed:
//!
//! ```
//! use palpate::{Backend, Experiment};
//!
//! let scene = r#"
//!     format = "scene/1"
//!     [object]
//!     shape = { ball = { radius = 0.05, center = [0, 0, 0.3] } }
//!     cell_size = 0.025
//!     [material]
//!     density = 1000.0
//!     youngs_modulus = 2.0e4
//!     poisson_ratio = 0.4
//!     [time]
//!     step = 0.01
//!     steps = 10
//! "#;
//! let experiment = Experiment::from_toml(scene, "ball.toml")?;
//! let simulation = experiment.simulate(Backend::Auto)?;
//! let fallen = simulation.snapshots.last().unwrap();
//! // Free fall: half g t² after a tenth of a second, up to the first-order error of the time step.
//! let drop = -fallen.displacement.iter().map(|u| u.z).sum::<f64>() / fallen.displacement.len() as f64;
//! assert!((drop - 0.049).abs() < 0.003, "{drop}");
//! # Ok::<(), palpate::Error>(())
//! ```
//!
//! With a recording in the scene, [`Experiment::fit`] finds the free parameters of its `[fit]` table, and [`fit`] does so for
//! several scenes at once. The command line is the same library behind [`cli::run`].
//!
//! Who subscribes to the crate [`tracing`](https://docs.rs/tracing) sees what takes how long, as spans: `open` with `load` and `assemble`, `fit`
//! with `start` (level info), `evaluation` (debug) and `step` (trace). Without a subscriber they cost nothing.
//!
//! Invariant: this room reads options, chooses a backend and talks to people. It computes no physics.

mod auto;
mod catalogue;
mod choose;
pub mod cli;
mod coarsen;
mod commands;
mod curves;
mod diagnosing;
mod embed;
mod engine;
mod error;
mod events;
mod experiment;
mod exporting;
mod fields;
mod fingerprint;
mod fitting;
mod folder;
mod grid;
mod host;
mod identify;
mod interrupt;
mod lock;
mod memory;
mod motions;
mod objective;
mod options;
mod placing;
mod progress;
pub mod render;
pub mod report;
mod residuals;
pub mod results;
mod scatter;
mod skin;
mod solids;
mod stress;
mod suited;
mod synthesis;
pub mod synthetic;
mod tracking;
mod viewers;

pub use coarsen::{CoarsenOptions, Coarsened, coarsen, usual_numbers};
pub use diagnosing::{DiagnoseOptions, Diagnosed, diagnose};
pub use embed::Embedding;
pub use engine::Backend;
pub use error::Error;
pub use experiment::{Experiment, Simulation};
pub use exporting::{ExportOptions, specimen};
pub use fitting::{Distances, FitOptions, Fitted, FreeNumber, FromTracks, Headline, HeldOut, Parts, fit};
pub use grid::{GridCheck, GridEffect, grid_check};
pub use host::host;
pub use interrupt::{Clock, Interrupt};
pub use objective::{Coordinates, Objective};
pub use placing::{PlaceOptions, PlaceRound, Placed, Placement, place};
pub use progress::Liveliness;
pub use residuals::{FrameResidual, ResidualSummary};
pub use tracking::{Refined, Round, RoundValue, TrackedBody, TrackedFrame, refine, track, track_on};
