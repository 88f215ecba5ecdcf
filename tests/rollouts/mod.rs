//! Whole simulations: derivatives agree, and so do solvers, threads and batches.

mod agreement;
mod backends;
mod combinations;
mod effects;
mod fields;
mod gradients;
mod measurement;
mod moving;
mod quasi_static;
mod rows;
mod visibility;
