//! The published experiments of Weiss et al., Sparse Surface Constraints (CVPR 2020), repeated: synthetic recordings give
//! their parameters back.

pub mod acceptance;
pub mod capture;
pub mod cases;
pub mod finer;
pub mod gradient;
pub mod real2sim;
pub mod scenes;
pub mod several;
pub mod study;
pub mod tables;
pub mod veo;

/// Studies of other papers' methods.
pub const SETS: [&cases::Set; 3] = [&real2sim::SET, &capture::SET, &veo::SET];
