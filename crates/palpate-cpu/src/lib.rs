//! Reference backend in f64: plain loops and faer, the oracle of every other backend. Clear before fast, but fast.
//!
//! Invariant: this room does not know where a plan comes from nor what gradients are for.

mod ahead;
mod back;
mod backend;
#[cfg(test)]
mod collapse_tests;
pub mod costs;
mod kept;
#[cfg(test)]
mod kink_tests;
pub mod linear;
#[cfg(test)]
mod local_bodies;
#[cfg(test)]
mod local_tests;
mod memory;
pub mod modes;
mod newton;
#[cfg(test)]
mod product_tests;
mod quasi_static;
#[cfg(test)]
mod sequence_tests;
mod simulate;
#[cfg(test)]
mod solver_choice_tests;
#[cfg(test)]
mod star_tests;
mod stress_free;
#[cfg(test)]
mod stress_free_tests;
pub mod terms;
mod tracking;
#[cfg(test)]
mod view_tests;
mod world;

pub use backend::CpuBackend;
pub use linear::dense::settle;
pub use memory::{Memory, Sizes};
pub use newton::Effort;
pub use tracking::{Correspondence, Tracker};
pub use world::{Adjoint, State, Tally, Tangent, World};
