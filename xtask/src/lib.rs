//! Studies of the whole chain: recovery of known parameters ([`paper`]), time and memory ([`bench`]), order in the house
//! ([`tidy`]).
//!
//! Invariant: nothing here is used by the product; tests and developer verbs use it.

pub mod bench;
pub mod paper;
pub mod table;
pub mod test;
pub mod tidy;
