//! A graphics device: adapters, errors, buffers, kernels, and lists of dispatches. Nothing here knows what is simulated.

mod adapters;
mod arena;
mod buffers;
mod count;
mod error;
mod gpu;
mod host;
mod open;
pub mod pipelines;
pub(crate) mod probe;
pub mod recorder;
pub mod trace;
pub(crate) mod wait;

pub use adapters::{AdapterReport, Choice, PciAddress, adapters, adapters_async};
pub(crate) use arena::Arena;
pub(crate) use buffers::{Maker, whole};
pub(crate) use count::Counter;
pub use count::Dispatches;
pub use error::GpuError;
pub use gpu::Gpu;
pub use host::{Bare, Host};
pub use pipelines::Lanes;
pub(crate) use wait::HandedOver;

#[cfg(test)]
pub(crate) use {
    adapters::{STORAGE_BUFFERS, WIDTH, WORKGROUP_BYTES, refusal},
    buffers::{fits, no_room},
    error::translate,
    open::lanes_for,
};
