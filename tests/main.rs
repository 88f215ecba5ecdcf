//! The ladder of tests: each rung trusts only the rungs above it in this list.
