//! The ladder of tests: each rung trusts only the rungs above it in this list.

mod bad_input;
mod cli;
mod diagnose;
mod physics;
mod real_data;
mod recovery;
mod rollouts;
