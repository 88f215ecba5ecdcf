//! Kernels against the CPU backend on small bodies.

mod derivatives;
mod forward;
pub(crate) mod scenes;
