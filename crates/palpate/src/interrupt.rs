//! Asking a long computation to stop in good order.

use palpate_engine::Stop;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time since something began. Clones share the beginning.
#[derive(Clone)]
pub struct Clock(Arc<dyn Fn() -> Duration + Send + Sync>);

impl Clock {
    /// A clock that begins now.
    pub fn start() -> Clock {
        let began = Instant::now();
        Clock::new(move || began.elapsed())
    }

    /// A clock that shows what this says.
    pub fn new(elapsed: impl Fn() -> Duration + Send + Sync + 'static) -> Clock {
        Clock(Arc::new(elapsed))
    }

    /// Time since the beginning.
    pub fn elapsed(&self) -> Duration {
        (self.0)()
    }
}

impl Default for Clock {
    fn default() -> Clock {
        Clock::start()
    }
}

/// A request to stop: a running evaluation ends at its next stage; a budget of evaluations ends between them. Clones share it.
#[derive(Clone)]
pub struct Interrupt {
    raised: Arc<AtomicBool>,
    /// Set by [`Interrupt::raise`] alone: the last round of a budget is finished.
    now: Arc<AtomicBool>,
    remaining: Arc<AtomicU64>,
    /// Whether anything would be lost by ending at once.
    phase: Arc<Mutex<Phase>>,
    /// From when on it counts as raised; each clone may have its own.
    deadline: Option<(Clock, Duration)>,
}

/// What a command is at.
#[derive(Default)]
enum Phase {
    /// It computes or writes, and looks at its interrupt.
    #[default]
    Working,
    /// It only reads and prepares, in calls that cannot be interrupted: to end the process loses nothing but files that must not outlive it.
    Reading { remove: Option<PathBuf>, said: &'static str },
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
        Interrupt {
            raised,
            now: Arc::default(),
            remaining: Arc::new(AtomicU64::new(rounds)),
            phase: Arc::default(),
            deadline: None,
        }
    }

    /// The same request, which raises itself at a time of a clock as well; running evaluations end then.
    #[must_use]
    pub fn until(&self, clock: &Clock, end: Duration) -> Interrupt {
        Interrupt { deadline: Some((clock.clone(), end)), ..self.clone() }
    }

    fn enter(&self, phase: Phase) {
        *self.phase.lock().unwrap_or_else(PoisonError::into_inner) = phase;
    }

    /// From now on the process may be ended at once: nothing is written. A file that must not outlive it is removed then; `said` is for people.
    pub(crate) fn read(&self, remove: Option<PathBuf>, said: &'static str) {
        self.enter(Phase::Reading { remove, said });
    }

    /// From now on this interrupt is looked at.
    pub(crate) fn serve(&self) {
        self.enter(Phase::Working);
    }

    /// Ends the process with what is to be said, if that loses nothing: while files are read, nobody looks at an interrupt. `end` is not expected
    /// to come back; until it does, the command cannot begin to write.
    pub fn abandon(&self, end: impl FnOnce(&str)) {
        let phase = self.phase.lock().unwrap_or_else(PoisonError::into_inner);
        if let Phase::Reading { remove, said } = &*phase {
            // One that stays is taken for dead once this process has ended.
            remove.iter().for_each(|file| drop(std::fs::remove_file(file)));
            end(said);
        }
    }

    /// Asks to stop.
    pub fn raise(&self) {
        self.now.store(true, Ordering::SeqCst);
        self.raised.store(true, Ordering::SeqCst);
    }

    /// True once it has been raised.
    pub fn is_raised(&self) -> bool {
        self.raised.load(Ordering::SeqCst) || self.is_late()
    }

    /// What running evaluations look at.
    pub(crate) fn at_once(&self) -> Stop {
        let own = self.clone();
        Stop::when(move || own.is_urgent())
    }

    /// What searches look at between evaluations.
    pub(crate) fn in_turn(&self) -> Stop {
        let own = self.clone();
        Stop::when(move || own.is_raised())
    }

    /// True from the moment that somebody asked to stop, or that the time is over: what only adds to the answer is left out then.
    pub(crate) fn is_urgent(&self) -> bool {
        self.now.load(Ordering::SeqCst) || self.is_late()
    }

    /// True once its time is over.
    pub(crate) fn is_late(&self) -> bool {
        self.deadline.as_ref().is_some_and(|(clock, end)| clock.elapsed() >= *end)
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

impl std::fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Interrupt").field("raised", &self.is_raised()).finish_non_exhaustive()
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
        assert!(a.clone().is_raised() && !a.at_once().is_over(), "its last round is finished");
        a.raise();
        assert!(a.clone().at_once().is_over());
        assert!(!Interrupt::default().is_raised() && Interrupt::after(0).is_raised());
    }

    #[test]
    fn who_only_reads_may_be_ended_at_once_and_who_writes_may_not() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let lock = folder.path().join("lock");
        std::fs::write(&lock, "").unwrap_or_else(|e| panic!("{e}"));
        let (a, said) = (Interrupt::default(), |a: &Interrupt| {
            let mut heard = None;
            a.abandon(|text| heard = Some(text.to_string()));
            heard
        });
        assert_eq!(said(&a), None);
        a.clone().read(Some(lock.clone()), "nothing was written");
        assert_eq!(said(&a).as_deref(), Some("nothing was written"));
        assert!(!lock.exists() && !a.is_raised());
        a.serve();
        assert_eq!(said(&a.clone()), None);
    }

    #[test]
    fn a_deadline_ends_the_clone_that_has_it_and_whoever_asks_ends_all() {
        let time = Arc::new(AtomicU64::new(0));
        let shown = time.clone();
        let clock = Clock::new(move || Duration::from_secs(shown.load(Ordering::SeqCst)));
        let whole = Interrupt::default();
        let (part, all) = (whole.until(&clock, Duration::from_secs(3)), whole.until(&clock, Duration::from_secs(5)));
        time.store(2, Ordering::SeqCst);
        assert!(!part.at_once().is_over());
        time.store(3, Ordering::SeqCst);
        assert!(part.at_once().is_over() && part.is_raised() && !all.is_raised() && !whole.is_raised());
        whole.raise();
        assert!(all.at_once().is_over() && all.in_turn().is_over() && !all.is_late());
    }
}
