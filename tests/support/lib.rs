//! What the tests share: small scenes built in code, runs, energies.

pub mod data;
pub mod energy;
pub mod run;
pub mod scenes;
pub mod swing;
pub mod tracks;
