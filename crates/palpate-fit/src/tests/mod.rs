//! Tests on cheap physics.

mod fits;
mod models;
