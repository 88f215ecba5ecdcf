//! Tests on cheap physics.

mod blocks;
mod broken;
mod errors;
mod fits;
mod models;
mod resume;
