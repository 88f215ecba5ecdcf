//! One file a command.

pub mod batch;
pub mod coarsen;
pub mod devices;
pub mod diagnose;
pub mod export;
pub mod fit;
pub mod frames;
pub mod import;
pub mod inspect;
pub mod observe;
pub mod pictures;
pub mod place;
pub mod simulate;
pub mod synthesize;
pub mod track;
