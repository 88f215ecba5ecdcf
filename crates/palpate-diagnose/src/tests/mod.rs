//! The workflow on a laboratory whose physics is linear and known.

mod bench;
mod still;
mod workflow;
