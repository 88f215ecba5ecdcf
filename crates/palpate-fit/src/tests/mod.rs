//! Tests on cheap physics.

mod broken;
mod errors;
mod fits;
mod models;
mod resume;
