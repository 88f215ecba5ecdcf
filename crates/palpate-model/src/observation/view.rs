//! What members of a batch are compared with: one of a plan's recordings, all of its frames or some of them.

use super::instant::{Instant, instants, instants_at};
use super::{Frame, Observation};
use std::sync::Arc;

/// A recording of the body of a plan.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What was measured.
    pub observation: Arc<Observation>,
    /// Steps that a simulation takes to compare all of it; at most those of the plan's clock. Frames after them are held against their end.
    pub steps: usize,
}

/// What one member of a batch is compared with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// Number of the recording; 0 is the plan's own.
    pub recording: usize,
    /// Which of its frames count `[F]`, so that a fold of a cross-validation leaves the others out; `None` = all.
    pub frames: Option<Arc<[bool]>>,
}

impl View {
    /// All of a recording.
    pub fn of(recording: usize) -> View {
        View { recording, frames: None }
    }

    /// The same recording without the frames for which `left_out` holds, out of so many.
    #[must_use]
    pub fn without(self, frames: usize, left_out: impl Fn(usize) -> bool) -> View {
        let counts = |f: usize| self.frames.as_ref().is_none_or(|counts| counts[f]) && !left_out(f);
        View { frames: Some((0..frames).map(counts).collect()), ..self }
    }
}

/// A view with the recording that it is of.
#[derive(Clone, Debug)]
pub struct Viewed {
    /// The recording.
    pub recording: Recording,
    /// Which part of it.
    pub view: View,
}

impl Viewed {
    /// What was measured.
    pub fn observation(&self) -> &Observation {
        &self.recording.observation
    }

    fn counts(&self, frame: usize) -> bool {
        self.view.frames.as_ref().is_none_or(|counts| counts.get(frame).copied().unwrap_or(false))
    }

    /// Number n of scalar residuals of the frames that count.
    pub fn residuals(&self) -> usize {
        let frames = self.observation().frames.iter().enumerate();
        frames.filter(|(f, _)| self.counts(*f)).map(|(_, f)| Frame::residuals(f)).sum()
    }

    /// 1/n; 0 where nothing counts.
    pub fn scale(&self) -> f64 {
        match self.residuals() {
            0 => 0.0,
            n => 1.0 / n as f64,
        }
    }

    /// Frames that count and belong to step k of a simulation in steps of `dt` [s] that starts at `start` on the recording's clock.
    pub fn instants(&self, dt: f64, start: f64, k: usize) -> Vec<Instant> {
        let mut all = instants(&self.recording, dt, start, k);
        all.retain(|at| self.counts(at.frame));
        all
    }

    /// The same of a sequence of states at given `times` on the recording's clock [s].
    pub fn instants_at(&self, times: &[f64], k: usize) -> Vec<Instant> {
        let mut all = instants_at(&self.recording, times, k);
        all.retain(|at| self.counts(at.frame));
        all
    }
}
