//! Nouns and laws of palpate, in f64: a body cut out of a grid, its element matrices, contact and
//! cost laws, the list of parameters, and the [`plan::Plan`] that carries all of them to a backend.
//!
//! Invariant: this room knows no files, no device and no solver of equations of motion. Everything in it is either plain
//! data in SI units or a small function whose derivative is tested beside it. Weights of stars take one sparse solve at rest.

pub mod cutcells;
pub mod effects;
pub mod materials;
pub mod mechanics;
pub mod observation;
pub mod params;
pub mod plan;
pub mod scene;
pub mod shape;
pub mod space;

pub use glam::{DAffine3, DMat3, DQuat, DVec3};
