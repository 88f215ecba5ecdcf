//! Comparison with what was measured.

pub mod frames;
pub mod markers;
pub mod matching;
