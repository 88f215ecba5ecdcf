//! One file a kind of source.

mod arrays;
mod azure;
mod bag;
mod clouds;
mod mocap;
mod plush;
mod real;
mod realsense;
mod torch;
mod truth;
mod tum;
