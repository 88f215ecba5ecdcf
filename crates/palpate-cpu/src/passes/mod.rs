//! The passes of a simulation, one idea a file.

pub mod altered;
pub mod assembly;
pub mod balance;
pub mod cells;
pub mod clamps;
pub mod columns;
pub mod frames;
pub mod markers;
pub mod matching;
pub mod materials;
pub mod points;
pub mod posed;
pub mod supports;
