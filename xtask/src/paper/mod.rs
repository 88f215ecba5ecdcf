//! The published experiments of Weiss et al., Sparse Surface Constraints (CVPR 2020), repeated: synthetic recordings give
//! their parameters back.

pub mod finer;
pub mod gradient;
pub mod real2sim;
pub mod scenes;
pub mod several;
pub mod study;
pub mod tables;
