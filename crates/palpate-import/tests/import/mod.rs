//! One file a kind of source.

mod arrays;
mod azure;
mod bag;
mod clouds;
mod mocap;
mod real;
mod realsense;
mod truth;
mod tum;
