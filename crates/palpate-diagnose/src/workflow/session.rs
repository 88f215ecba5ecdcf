//! The beginning of a session: the first look at the starting model, and the cells and the noise of the baseline.

use super::ranking::Early;
use super::{Options, Session, State, noise_over_stated, one};
use crate::cells::Cells;
use crate::change::candidates;
use crate::crossval::foldings;
use crate::judgement::density::Blocks;
use crate::laboratory::{LabError, Laboratory, Model, Readings};
use crate::noise::Shapes;

/// Times that the residual map and the judgement of one model take, that are kept for the answer: what is known by then is judged again for it.
const ANSWER: f64 = 3.0;

impl<'a> Session<'a> {
    /// A session that has seen nothing yet.
    pub(super) fn new(lab: &'a mut dyn Laboratory, options: &'a Options, first: &Model) -> Session<'a> {
        Session {
            lab,
            options,
            cells: Cells::new(&Readings::default()),
            folds: Vec::new(),
            blocks: Blocks::default(),
            second: None,
            candidates: 0,
            noise_ratio: 1.0,
            design_effect: 1.0,
            noise: Shapes::default(),
            scored: None,
            early: Early::default(),
            ranked: Vec::new(),
            rivals: Vec::new(),
            base: first.clone(),
            unrefined: false,
            finer: Vec::new(),
            tried: Vec::new(),
            not_tried: Vec::new(),
            no_time: false,
        }
    }

    /// The state where the fit of the baseline starts, with the candidates that were ranked there; `None` where a fit may still find what to look
    /// at.
    pub(super) fn first_look(&mut self, start: &Model) -> Result<Option<State>, LabError> {
        let readings = match one(self.lab.linearise(&[(start.changes.clone(), start.values.clone())])) {
            Ok(readings) => readings,
            Err(LabError::Failed(_)) => return Ok(None),
            Err(why) => return Err(why),
        };
        if self.begin(start, &readings).is_err() {
            return Ok(None);
        }
        let began = self.lab.seconds();
        let state = self.alone(start.clone(), readings, Vec::new());
        self.keep_back(began);
        self.look(&state, 0, false)?;
        Ok(Some(state))
    }

    /// Keeps time for the answer, from when something began that takes as long.
    pub(super) fn keep_back(&mut self, began: f64) {
        let seconds = self.lab.seconds() - began;
        self.lab.keep_back(ANSWER * seconds);
    }

    /// Looks at the recordings through another model: its cells, and the noise that it shows.
    pub(super) fn begin(&mut self, base: &Model, readings: &Readings) -> Result<(), LabError> {
        self.cells = Cells::new(readings);
        if self.cells.is_empty() {
            return Err(LabError::failed("no part of the recording meets the simulated body: nothing can be diagnosed"));
        }
        self.noise_ratio = noise_over_stated(self.lab, readings);
        for (sd, k) in self.cells.sd.iter_mut().zip(&self.cells.keys) {
            *sd *= if k.stream.sensor.is_camera() { self.noise_ratio } else { 1.0 };
        }
        (self.folds, self.blocks) = (foldings(&self.cells), Blocks::new(&self.cells));
        self.candidates = candidates(self.lab.setting()).len();
        self.base = base.clone();
        Ok(())
    }
}
