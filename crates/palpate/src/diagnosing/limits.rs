//! When a diagnosis ends before its end: one set of limits, which every simulation looks at on its way.

use super::hypothesis::lab_error;
use crate::error::Error;
use crate::interrupt::{Clock, Interrupt};
use palpate_diagnose::LabError;
use palpate_engine::{FailureKind, Stop};
use palpate_gpu::GpuError;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// When to stop: asked to, without a device, or out of time. Parts of a diagnosis get limits that end earlier.
#[derive(Clone)]
pub(super) struct Limits {
    asked: Interrupt,
    clock: Clock,
    /// Time of the clock from which on nothing is computed any more.
    end: Option<Duration>,
    broken: Arc<OnceLock<String>>,
}

impl Limits {
    pub fn new(asked: &Interrupt, clock: &Clock, end: Option<Duration>) -> Limits {
        Limits { asked: asked.clone(), clock: clock.clone(), end, broken: Arc::default() }
    }

    /// The same with this much time less.
    pub fn less(&self, time: Duration) -> Limits {
        Limits { end: self.end.map(|e| e.saturating_sub(time)), ..self.clone() }
    }

    /// The same with a share of the time that is left.
    pub fn share(&self, share: f64) -> Limits {
        Limits { end: self.left().map(|left| self.clock.elapsed() + left.mul_f64(share)), ..self.clone() }
    }

    /// As much time from now on, whether somebody asked to stop or not, as long as it lies within the end.
    pub fn grace(&self, time: Duration) -> Limits {
        let until = self.clock.elapsed() + time;
        Limits { asked: Interrupt::default(), end: Some(self.end.map_or(until, |e| e.min(until))), ..self.clone() }
    }

    /// Time that is left; `None` without an end.
    pub fn left(&self) -> Option<Duration> {
        self.end.map(|e| e.saturating_sub(self.clock.elapsed()))
    }

    /// Time since the beginning.
    pub fn elapsed(&self) -> Duration {
        self.clock.elapsed()
    }

    /// The request to stop, which the end raises as well.
    pub fn interrupt(&self) -> Interrupt {
        self.end.map_or_else(|| self.asked.clone(), |end| self.asked.until(&self.clock, end))
    }

    /// What every simulation looks at.
    pub fn stop(&self) -> Stop {
        self.interrupt().at_once()
    }

    pub fn check(&self) -> Result<(), LabError> {
        match self {
            l if l.is_over() => Err(LabError::Interrupted),
            l if l.is_late() => Err(LabError::NoTime),
            _ => Ok(()),
        }
    }

    /// True when asked to stop, or without a device.
    pub fn is_over(&self) -> bool {
        self.asked.is_raised() || self.broken.get().is_some()
    }

    /// True when the time is over.
    pub fn is_late(&self) -> bool {
        self.left().is_some_and(|left| left.is_zero())
    }

    /// Why a simulation that was cut short has no result.
    pub fn stopped(&self) -> LabError {
        if self.is_over() { LabError::Interrupted } else { LabError::NoTime }
    }

    /// An error of a simulation as the laboratory's: it may have been cut short, or its device may have broken, also before it began.
    pub fn error(&self, e: impl Into<Error>) -> LabError {
        match e.into() {
            Error::Simulation(f) if f.kind == FailureKind::Stopped => self.stopped(),
            Error::Simulation(f) if f.kind == FailureKind::Device => self.break_off(f.to_string()),
            Error::Memory(why) => self.break_off(why),
            Error::Build(e) if e.broken => self.break_off(e.to_string()),
            Error::Device(e @ GpuError::Lost { .. }) => self.break_off(e.to_string()),
            other => lab_error(other),
        }
    }

    /// What a hypothesis by itself ends with: where memory is short that is no fault of the hypothesis.
    pub fn alone(&self, e: LabError) -> LabError {
        if let LabError::Failed(cause) = &e
            && let Some(Error::Memory(why)) = cause.downcast_ref()
        {
            return self.break_off(why.clone());
        }
        e
    }

    /// The device failed, or memory is short: nothing more can be computed. The first reason counts; what follows is its consequence.
    pub fn break_off(&self, why: String) -> LabError {
        self.broken.get_or_init(|| why);
        LabError::Interrupted
    }

    /// Why the device failed, if it did.
    pub fn broken(&self) -> Option<String> {
        self.broken.get().cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_engine::{BuildError, Failure};
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn parts_end_earlier_and_say_why() {
        let time = Arc::new(AtomicU64::new(0));
        let shown = time.clone();
        let clock = Clock::new(move || Duration::from_secs(shown.load(Ordering::SeqCst)));
        let asked = Interrupt::default();
        let whole = Limits::new(&asked, &clock, Some(Duration::from_secs(100)));
        let (less, stop) = (whole.less(Duration::from_secs(20)), whole.share(0.25).stop());
        time.store(25, Ordering::SeqCst);
        assert!(stop.is_over() && whole.check().is_ok() && less.left() == Some(Duration::from_secs(55)));
        time.store(80, Ordering::SeqCst);
        let cut = || Failure::new(FailureKind::Stopped, 0.0, "cut short");
        assert!(less.stop().is_over() && matches!(less.error(cut()), LabError::NoTime) && whole.check().is_ok());
        asked.raise();
        assert!(matches!(whole.error(cut()), LabError::Interrupted) && whole.stop().is_over());
        // A last look is taken all the same.
        let grace = whole.grace(Duration::from_secs(1));
        assert!(!grace.stop().is_over() && grace.left() == Some(Duration::from_secs(1)));
        time.store(99, Ordering::SeqCst);
        assert!(whole.grace(Duration::from_secs(5)).left() == Some(Duration::from_secs(1)));
        assert!(matches!(whole.break_off("lost".into()), LabError::Interrupted) && less.broken() == Some("lost".into()));
    }

    #[test]
    fn a_broken_device_ends_all_whenever_it_is_met_and_a_refused_plan_only_itself() {
        let none = || Limits::new(&Interrupt::default(), &Clock::default(), None);
        let build = |broken| BuildError { message: "no".into(), hint: "none".into(), broken };
        let broken: [Error; 4] = [
            Error::Memory("no".into()),
            build(true).into(),
            Failure::new(FailureKind::Device, 0.0, "no").into(),
            Error::Device(GpuError::Lost { reason: "no".into() }),
        ];
        for e in broken {
            let limits = none();
            assert!(matches!(limits.error(e), LabError::Interrupted) && limits.is_over() && limits.broken().is_some());
        }
        let limits = none();
        assert!(matches!(limits.error(build(false)), LabError::Failed(_)) && !limits.is_over());
        // Several that are too much together may each have room.
        assert!(matches!(limits.alone(lab_error(build(false).into())), LabError::Failed(_)) && !limits.is_over());
        assert!(matches!(limits.alone(lab_error(Error::Memory("no".into()))), LabError::Interrupted) && limits.is_over());
    }
}
