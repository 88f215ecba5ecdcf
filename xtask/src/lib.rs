//! Studies of the whole chain: recovery of known parameters ([`paper`]), what a diagnosis finds of what was hidden ([`blind`]), fits of
//! measured recordings ([`real`]), time and memory ([`bench`]), bits that stay ([`same`]), order in the house ([`tidy`]).
//!
//! Invariant: nothing here is used by the product; tests and developer verbs use it.

pub mod bench;
pub mod blind;
pub mod paper;
pub mod real;
pub mod same;
pub mod table;
pub mod test;
pub mod tidy;
