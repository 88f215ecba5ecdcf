//! Measured data: read, placed, fitted.

mod reading;
