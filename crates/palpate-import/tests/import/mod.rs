//! One file a kind of source.

mod realsense;
mod truth;
