//! What a body is made of for everybody else: nodes, masses, surface, and who touches whom.

pub mod body;
pub mod carrier;
pub mod pattern;
pub mod points;
pub mod stencil;
