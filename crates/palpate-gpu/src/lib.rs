//! GPU backend in f32: every pass is a WGSL kernel of `shaders/`, driven through wgpu; the state stays on the device from the
//! first step to the last.
//!
//! Invariant: between `set_params` and `read` nothing waits for the device, and nothing here knows where a plan comes from.

// wgpu's handles hash and compare by identity; what changes behind them is no part of a key.
#![allow(clippy::mutable_key_type)]

mod adapters;
mod backend;
mod backward;
mod choices;
mod columns;
pub mod device;
mod effects;
mod effort;
pub mod error;
mod forward;
mod geometry;
pub mod layout;
mod measure;
mod members;
mod memory;
mod observe;
pub mod pipelines;
mod probe;
mod read;
pub mod recorder;
mod solve;
#[cfg(test)]
mod tests;
mod tuning;
mod world;

pub use adapters::{AdapterReport, adapters};
pub use backend::GpuBackend;
pub use device::{Choice, Gpu, Lanes};
pub use error::GpuError;
pub use measure::{CgSpeed, Traffic};
pub use memory::{Load, Memory, memory};
pub use tuning::{Product, Tuning};
pub use world::{Adjoint, State, Tally, Tangent, World};
