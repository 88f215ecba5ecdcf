//! The machine that tests run on: it has a clock, and remembers what was measured as long as the test runs.

use crate::Host;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

#[derive(Debug)]
pub struct Desk {
    begun: Instant,
    notes: Mutex<HashMap<String, String>>,
}

impl Default for Desk {
    fn default() -> Desk {
        Desk { begun: Instant::now(), notes: Mutex::default() }
    }
}

impl Desk {
    /// All keys with what is written for them.
    pub fn notes(&self) -> HashMap<String, String> {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes something else for a key.
    pub fn rewrite(&self, key: &str, what: &str) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).insert(key.into(), what.into());
    }
}

impl Host for Desk {
    fn seconds(&self) -> Option<f64> {
        Some(self.begun.elapsed().as_secs_f64())
    }

    fn written(&self, key: &str) -> Option<String> {
        self.notes().remove(key)
    }

    fn write(&self, key: &str, what: &str) -> String {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        notes.entry(key.into()).or_insert_with(|| what.into()).clone()
    }
}
