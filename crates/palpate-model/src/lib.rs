//! Nouns and laws of palpate, in f64: a body cut out of a grid, its element matrices, contact and
//! cost laws, the list of parameters, and the [`plan::Plan`] that carries all of them to a backend.
//!
//! Invariant: this room knows no files, no device and no solver. Everything in it is either plain
//! data in SI units or a small function whose derivative is tested beside it.

pub mod body;
pub mod changes;
pub mod clamp_edge;
pub mod contact;
pub mod corotation;
pub mod cut;
pub mod distances;
pub mod effects;
pub mod element;
pub mod elements;
pub mod extension;
pub mod front;
pub mod grid;
pub mod grips;
pub mod held;
pub mod instant;
pub mod kernel;
pub mod material;
pub mod motion;
pub mod observation;
pub mod params;
pub mod pattern;
pub mod plan;
pub mod plan_build;
pub mod plane;
pub mod pullback;
pub mod rotation;
pub mod scene;
pub mod shape;

pub use glam::{DAffine3, DMat3, DQuat, DVec3};
