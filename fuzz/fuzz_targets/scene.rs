//! Damaged bytes as a file of the reader `scene`, by cargo-fuzz.

#![no_main]

#[path = "../src/guided.rs"]
mod guided;
