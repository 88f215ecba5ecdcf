//! A simulator that shares nothing with palpate's own physics: quadratic tetrahedra instead of cut cells, a neo-Hookean material instead of
//! corotated linear elasticity, two-step backward differentiation instead of the θ-scheme, clamps that hold nodes, a contact law of its own,
//! sharp boundaries between materials. What a fit recovers or a diagnosis calls right here is no artefact of the simulator that it searches with.
//!
//! It takes the body, material, clamps and ground that a scene states (`solid`), whatever else acts on it (`change`), moves it
//! ([`motion`]) and records it as cameras and markers would ([`watch`]).

mod body;
pub mod change;
mod element;
mod integrator;
mod loads;
mod material;
mod matrix;
pub mod mesh;
pub mod motion;
pub mod outside;
mod solid;
#[cfg(test)]
mod tests;
pub mod watch;
