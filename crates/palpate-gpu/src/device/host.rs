//! What the engine is lent by whoever opens a device. It has no clock and no files of its own.

use std::fmt::Debug;

/// The machine that the engine runs on. By default it has nothing: then nothing is measured, and ways to solve are those that are stated.
pub trait Host: Debug + Send + Sync {
    /// Seconds since any moment; `None` without a clock.
    fn seconds(&self) -> Option<f64> {
        None
    }

    /// What was written down for a key.
    fn written(&self, _key: &str) -> Option<String> {
        None
    }

    /// Writes something down unless there is something for the key, and returns what counts from now on: another process may have been faster.
    /// Neither holds a tab or the end of a line.
    fn write(&self, _key: &str, what: &str) -> String {
        what.to_string()
    }
}

/// A host that lends nothing.
#[derive(Clone, Copy, Debug)]
pub struct Bare;

impl Host for Bare {}
