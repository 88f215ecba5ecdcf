//! One evaluator for several recordings of a body: each has a part of it, and what asks through several parts at once may ask once.

use crate::evaluate::{Evaluate, Evaluation, ParamBatch, Request, Wanted};
use crate::failure::Failure;
use palpate_model::observation::View;
use std::sync::{Arc, Mutex, PoisonError};

/// What a part is part of.
#[derive(Clone, Debug, PartialEq)]
pub struct Share {
    /// The same number for all parts of one evaluator.
    pub of: usize,
    /// What members see that are evaluated through the part.
    pub view: View,
}

/// An evaluator whose members see this of its plan, unless the batch says what they see.
pub struct Part {
    whole: Arc<Mutex<Box<dyn Evaluate>>>,
    view: View,
}

impl Part {
    /// A part of an evaluator for each of these views.
    pub fn all(whole: Box<dyn Evaluate>, views: impl IntoIterator<Item = View>) -> Vec<Part> {
        let whole = Arc::new(Mutex::new(whole));
        views.into_iter().map(|view| Part { whole: whole.clone(), view }).collect()
    }

    fn with<T>(&self, work: impl FnOnce(&mut dyn Evaluate) -> T) -> T {
        work(&mut **self.whole.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn seen(&self, batch: &ParamBatch) -> ParamBatch {
        let own = || vec![self.view.clone(); batch.members()];
        if batch.views.is_empty() { batch.clone().seeing(own()) } else { batch.clone() }
    }
}

impl Evaluate for Part {
    fn parameters(&self) -> usize {
        self.with(|e| e.parameters())
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let batch = self.seen(theta);
        self.with(|e| e.evaluate(&batch, request))
    }

    fn has_products(&self) -> bool {
        self.with(|e| e.has_products())
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        let at = self.seen(at);
        self.with(|e| e.product(&at, v, wanted))
    }

    fn share(&self) -> Option<Share> {
        Some(Share { of: Arc::as_ptr(&self.whole).cast::<()>() as usize, view: self.view.clone() })
    }
}
