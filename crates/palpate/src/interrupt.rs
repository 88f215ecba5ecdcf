//! Asking a long computation to stop in good order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A request to stop: a running evaluation ends at its next time step; a budget ends between evaluations. Clones share it.
#[derive(Clone, Debug)]
pub struct Interrupt {
    raised: Arc<AtomicBool>,
    /// Set by [`Interrupt::raise`] alone: the last round of a budget is finished.
    now: Arc<AtomicBool>,
    remaining: Arc<AtomicU64>,
}

impl Default for Interrupt {
    fn default() -> Interrupt {
        Interrupt::after(u64::MAX)
    }
}

impl Interrupt {
    /// An interrupt that raises itself after so many rounds of evaluations: a budget.
    pub fn after(rounds: u64) -> Interrupt {
        let raised = Arc::new(AtomicBool::new(rounds == 0));
        Interrupt { raised, now: Arc::default(), remaining: Arc::new(AtomicU64::new(rounds)) }
    }

    /// Asks to stop.
    pub fn raise(&self) {
        self.now.store(true, Ordering::SeqCst);
        self.raised.store(true, Ordering::SeqCst);
    }

    /// True once it has been raised.
    pub fn is_raised(&self) -> bool {
        self.raised.load(Ordering::SeqCst)
    }

    /// The flag that running evaluations look at.
    pub(crate) fn at_once(&self) -> Arc<AtomicBool> {
        self.now.clone()
    }

    /// True from the moment that somebody asked to stop: what only adds to the answer is left out then.
    pub(crate) fn is_urgent(&self) -> bool {
        self.now.load(Ordering::SeqCst)
    }

    /// The flag itself.
    pub(crate) fn flag(&self) -> &AtomicBool {
        &self.raised
    }

    /// Counts a round of evaluations that begins; the last one of the budget raises the flag, and is still finished.
    pub(crate) fn count(&self) {
        let left = self.remaining.load(Ordering::SeqCst).saturating_sub(1);
        self.remaining.store(left, Ordering::SeqCst);
        if left == 0 {
            self.raised.store(true, Ordering::SeqCst);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_raised_by_its_last_round_and_shared_by_clones() {
        let a = Interrupt::after(2);
        a.clone().count();
        assert!(!a.is_raised());
        a.count();
        assert!(a.clone().is_raised() && !a.at_once().load(Ordering::SeqCst), "its last round is finished");
        a.raise();
        assert!(a.clone().at_once().load(Ordering::SeqCst));
        assert!(!Interrupt::default().is_raised() && Interrupt::after(0).is_raised());
    }
}
