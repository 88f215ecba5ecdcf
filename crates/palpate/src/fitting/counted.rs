//! How an interrupt hears of evaluations.

use crate::interrupt::Interrupt;
use palpate_engine::{Evaluate, Evaluation, Failure, ParamBatch, Request, Share, Wanted};

/// Counts evaluations against an interrupt's budget.
pub(super) struct Counted {
    pub inner: Box<dyn Evaluate>,
    pub interrupt: Interrupt,
    /// Only the first scene counts, so that a joint evaluation counts once.
    pub first: bool,
}

impl Evaluate for Counted {
    fn parameters(&self) -> usize {
        self.inner.parameters()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        if self.first {
            self.interrupt.count();
        }
        self.inner.evaluate(theta, request)
    }

    fn has_products(&self) -> bool {
        self.inner.has_products()
    }

    fn share(&self) -> Option<Share> {
        self.inner.share()
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        if self.first {
            self.interrupt.count();
        }
        self.inner.product(at, v, wanted)
    }
}
