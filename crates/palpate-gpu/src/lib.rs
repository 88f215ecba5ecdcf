//! GPU backend in f32: every pass is a WGSL kernel of `shaders/`, driven through wgpu; the state stays on the device from the
//! first step to the last.
//!
//! Invariant: between `set_params` and `read` nothing waits for the device, and nothing here knows where a plan comes from. Whatever waits does
//! so in `device/wait.rs`; clock and files are the [`Host`]'s.

// wgpu's handles hash and compare by identity; what changes behind them is no part of a key.
#![allow(clippy::mutable_key_type)]

mod asynchronous;
mod backend;
mod costs;
pub mod device;
pub mod layout;
mod memory;
mod passes;
mod read;
mod skinning;
mod solve;
mod stencils;
mod terms;
#[cfg(test)]
mod tests;
mod trace;
mod tracking;
mod world;

pub use backend::GpuBackend;
pub use device::{AdapterReport, Bare, Choice, Dispatches, Gpu, GpuError, Host, Lanes, PciAddress, adapters, adapters_async};
pub use memory::{Load, Memory, memory, memory_of_product};
pub use skinning::Skinning;
pub use solve::{CgSpeed, Traffic};
pub use trace::{TracedStep, trace_step};
pub use tracking::Correspondence;
pub use world::{Adjoint, Product, State, Tally, Tangent, Tuning, World};
