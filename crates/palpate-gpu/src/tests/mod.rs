//! Kernels against the CPU backend on small bodies.

mod cell_laws;
mod clocks;
mod collapse;
mod columns;
mod derivative_passes;
mod derivatives;
mod effects;
mod efforts;
mod elastic;
mod extremes;
pub(crate) mod faults;
mod forward;
mod labels;
mod lanes;
mod limits;
mod loops;
mod material_passes;
mod materials;
mod memory;
mod passes;
mod products;
pub(crate) mod scenes;
mod schemes;
mod sizes;
mod tet_effects;
mod twins;
mod wgsl;
