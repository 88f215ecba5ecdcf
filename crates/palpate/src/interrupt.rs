//! Asking a long computation to stop in good order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A request to stop that is looked at between evaluations; clones share it.
#[derive(Clone, Debug)]
pub struct Interrupt {
    raised: Arc<AtomicBool>,
    remaining: Arc<AtomicU64>,
}

impl Default for Interrupt {
    fn default() -> Interrupt {
        Interrupt { raised: Arc::default(), remaining: Arc::new(AtomicU64::new(u64::MAX)) }
    }
}

impl Interrupt {
    /// An interrupt that raises itself after it has been looked at so many times: a budget of evaluations.
    pub fn after(evaluations: u64) -> Interrupt {
        Interrupt { remaining: Arc::new(AtomicU64::new(evaluations)), ..Interrupt::default() }
    }

    /// Asks to stop.
    pub fn raise(&self) {
        self.raised.store(true, Ordering::SeqCst);
    }

    /// True once it has been raised. Does not use up the budget.
    pub fn is_raised(&self) -> bool {
        self.raised.load(Ordering::SeqCst)
    }

    /// Looks at the request before one more evaluation: true when the computation should stop. Uses up one of the budget.
    pub fn should_stop(&self) -> bool {
        let spent = self.remaining.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1)).is_err();
        if spent {
            self.raise();
        }
        self.is_raised()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_stops_after_so_many_looks_and_clones_share_it() {
        let a = Interrupt::after(2);
        let b = a.clone();
        assert!(!a.should_stop() && !b.should_stop() && a.should_stop() && b.is_raised());
        let c = Interrupt::default();
        assert!(!c.should_stop());
        c.clone().raise();
        assert!(c.should_stop());
    }
}
