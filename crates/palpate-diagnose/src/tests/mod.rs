//! The workflow on a laboratory whose physics is linear and known.

pub mod bench;
mod still;
mod workflow;
