//! Tests on cheap physics.

mod blocks;
mod broken;
mod ending;
mod errors;
mod fits;
mod known;
pub(crate) mod models;
mod parts;
mod resume;
