//! What the tests share: small scenes built in code, runs, energies, command lines, measured recordings.

pub mod command;
pub mod data;
pub mod energy;
pub mod gpu;
pub mod measured;
pub mod modes;
pub mod run;
pub mod scenes;
pub mod tets;
