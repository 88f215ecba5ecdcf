//! When a computation ends before its end.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Says when a computation is to end: somebody asked, or the time is over. Clones share the question.
#[derive(Clone, Default)]
pub struct Stop(Option<Arc<dyn Fn() -> bool + Send + Sync>>);

impl Stop {
    /// To end once this holds. It is asked at every stage of every rollout, from any thread, and must keep holding.
    pub fn when(over: impl Fn() -> bool + Send + Sync + 'static) -> Stop {
        Stop(Some(Arc::new(over)))
    }

    /// True once the computation is to end.
    pub fn is_over(&self) -> bool {
        self.0.as_ref().is_some_and(|over| over())
    }

    /// False where nothing can ever end it.
    pub fn can_end(&self) -> bool {
        self.0.is_some()
    }
}

impl From<Arc<AtomicBool>> for Stop {
    fn from(flag: Arc<AtomicBool>) -> Stop {
        Stop::when(move || flag.load(Ordering::SeqCst))
    }
}

impl fmt::Debug for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Stop").field(&self.is_over()).finish()
    }
}
