//! Studies of the whole chain: recovery of known parameters ([`paper`]), what a diagnosis finds of what was hidden ([`suite`]), fits of
//! measured recordings ([`real`]), the equations against theory ([`verify`]), time and memory
//! ([`bench`]), bits that stay ([`same`]), changes that tests notice ([`mutants`]), order in the house ([`tidy`]) and in its pages ([`pages`], [`figures`]).
//!
//! Invariant: nothing here is used by the product; tests and developer verbs use it.

pub mod bench;
pub mod coverage;
pub mod dawn;
pub mod figures;
pub mod fuzz;
pub mod mutants;
pub mod pages;
pub mod paper;
pub mod real;
pub mod rows;
pub mod same;
pub mod suite;
pub mod table;
pub mod test;
pub mod tetrahedra;
pub mod tidy;
pub mod verify;
