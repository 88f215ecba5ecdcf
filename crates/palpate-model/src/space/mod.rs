//! What a body is made of for everybody else: nodes, masses, surface, and who touches whom.

pub mod body;
pub mod carrier;
pub mod groups;
pub mod kept_volume;
pub mod neighbours;
pub mod pattern;
pub mod points;
pub mod stars;
pub mod stencil;
pub mod stuffing;
pub mod tet_checks;
pub mod tets;
