//! Measured data: read, placed, fitted.

mod fits;
mod reading;
mod tracking;
