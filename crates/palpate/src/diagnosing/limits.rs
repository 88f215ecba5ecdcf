//! When a search ends before its end.

use crate::interrupt::Interrupt;
use palpate_diagnose::LabError;
use std::sync::OnceLock;
use std::time::Instant;

/// When to stop: asked to, without a device, or out of time.
#[derive(Clone, Copy)]
pub(super) struct Limits<'a> {
    pub interrupt: &'a Interrupt,
    pub broken: &'a OnceLock<String>,
    pub deadline: Option<Instant>,
}

impl Limits<'_> {
    pub fn check(&self) -> Result<(), LabError> {
        match self {
            l if l.is_over() => Err(LabError::Interrupted),
            l if l.deadline.is_some_and(|d| Instant::now() > d) => Err(LabError::NoTime),
            _ => Ok(()),
        }
    }

    pub fn is_over(&self) -> bool {
        self.interrupt.is_raised() || self.broken.get().is_some()
    }

    /// The device failed: nothing more can be computed with it. The first reason counts; what follows is its consequence.
    pub fn break_off(&self, why: String) -> LabError {
        self.broken.get_or_init(|| why);
        LabError::Interrupted
    }
}
