//! Damaged bytes as a file of the reader `c3d`, by cargo-fuzz.

#![no_main]

#[path = "../src/guided.rs"]
mod guided;
