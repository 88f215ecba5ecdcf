//! GPU backend in f32: every pass is a WGSL kernel of `shaders/`, driven through wgpu; the state stays on the device from the
//! first step to the last.
//!
//! Invariant: between `set_params` and `read` nothing waits for the device, and nothing here knows where a plan comes from.

pub mod device;
pub mod error;
pub mod layout;
pub mod pipelines;
mod probe;
pub mod recorder;

pub use device::{AdapterReport, Choice, Gpu, Lanes, adapters};
pub use error::GpuError;
