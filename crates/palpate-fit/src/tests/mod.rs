//! Tests on cheap physics.

mod errors;
mod fits;
mod models;
mod resume;
