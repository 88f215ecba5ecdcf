//! The privileged domain: hexahedra of a lattice, cut by the body's surface, enhanced and corotated.
//!
//! Invariant: outside this room (and its twins in the backends) nobody knows of eight corners or of a lattice spacing.

pub mod band_lookup;
pub mod build;
pub mod clamp_cell;
pub mod clamp_edge;
pub mod corotation;
pub mod cut;
pub mod distances;
pub mod domain;
pub mod element;
pub mod elements;
pub mod extension;
pub mod front;
pub mod grid;
pub mod held;
mod moments;
pub mod places;
pub mod pullback;
pub mod shadow;
