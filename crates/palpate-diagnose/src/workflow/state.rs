//! Everything known about one model: its residuals in cells, errors of grid and step, what it says of a second recording, and its score.

use super::{STRANGE, Session, State, linear};
use crate::cells::{Cells, Table};
use crate::judgement::density::Blocks;
use crate::judgement::prior::Prior;
use crate::judgement::rule::Judged;
use crate::judgement::stack::{SIZES, stacked};
use crate::laboratory::{Field, LabError, Model, Readings};

impl State {
    /// True when something may be missing in the model: a discrepancy beside it predicts better, or its numbers are not of this world.
    pub(super) fn may_lack(&self) -> bool {
        self.judged.may_be_missing() || self.is_strange()
    }

    /// The same beyond chance.
    pub(super) fn lacks(&self) -> bool {
        self.judged.is_missing() || self.is_strange()
    }

    fn is_strange(&self) -> bool {
        self.strange.iter().any(|s| s.deviations > STRANGE)
    }
}

impl Session<'_> {
    /// What a finer grid and half the step would change, and what the recording's systematic errors may have changed. A scene that is too
    /// large to be refined, or fails there, has no estimate, and neither has one whose diagnosis was asked to stop.
    pub(super) fn finer(&mut self, model: &Model) -> Vec<Field> {
        let same = |of: &Model| (&of.changes, &of.values) == (&model.changes, &model.values);
        if let Some((_, known)) = self.finer.iter().find(|(of, _)| same(of)) {
            return known.clone();
        }
        self.lab.say("discretisation error: finer grid, half step");
        let refined = self.lab.finer(&model.changes, &model.values);
        let systematic = self.lab.systematic(&model.changes, &model.values);
        let late = |e: &LabError| matches!(e, LabError::NoTime | LabError::Interrupted);
        let cut = refined.as_ref().err().is_some_and(late) || systematic.as_ref().err().is_some_and(late);
        let all: Vec<Field> = refined.into_iter().flatten().chain(systematic.into_iter().flatten()).collect();
        if cut {
            self.unrefined |= *model == self.base;
        } else {
            self.finer.push((model.clone(), all.clone()));
        }
        all
    }

    /// Brings errors of the discretisation up to date: with another effect in place they are others.
    /// Without time for that those of another model stand for its own.
    pub(super) fn refine(&mut self, state: &mut State) {
        let own = self.finer(&state.model);
        if own.is_empty() && (self.lab.interrupted() || self.lab.out_of_time()) {
            return;
        }
        state.fields = own;
        state.own = true;
        state.held_out_finer = self.held_out_finer(state);
        self.remeasure(state);
    }

    /// Everything known about a model of which finer computations have shown nothing yet.
    pub(super) fn state(&mut self, model: Model, readings: Readings) -> Result<State, LabError> {
        let mut state = self.unjudged(model, readings, Vec::new(), None)?;
        self.judge(&mut state);
        Ok(state)
    }

    /// The same without any other recording, of a model with fields of its own.
    pub(super) fn alone(&mut self, model: Model, readings: Readings, fields: Vec<Field>) -> State {
        let mut state = self.unread(model, readings, fields, None);
        self.judge(&mut state);
        state
    }

    /// A state before it is judged; means of cells that it lost are taken over from another model's.
    fn unjudged(
        &mut self,
        model: Model,
        readings: Readings,
        fields: Vec<Field>,
        fallback: Option<&Table>,
    ) -> Result<State, LabError> {
        let (held_out, elsewhere) = match self.lab.held_out(&model) {
            Ok(readings) => (readings, None),
            // Who cannot follow a recording that the baseline follows is no explanation.
            Err(e) if self.second.is_some() => return Err(e),
            Err(e) => (None, Some(e.to_string())),
        };
        Ok(State { held_out, elsewhere, ..self.unread(model, readings, fields, fallback) })
    }

    /// The same before any other recording is read.
    fn unread(&self, model: Model, readings: Readings, fields: Vec<Field>, fallback: Option<&Table>) -> State {
        let table = self.cells.table(&readings, fallback);
        let frame = self.frame(&table, &fields);
        let predicted = self.predict(&readings, &table, &frame);
        State {
            unmet: linear::unmet(&model, &readings),
            needed: Vec::new(),
            judged: Judged::default(),
            held_out_finer: Vec::new(),
            model,
            readings,
            table,
            fields,
            frame,
            predicted,
            held_out: None,
            elsewhere: None,
            own: true,
            strange: Vec::new(),
        }
    }

    /// Everything known about another model of the same recordings, with the errors that finer computations showed of this one.
    pub(super) fn beside(&mut self, state: &State, model: Model, readings: Readings) -> Result<State, LabError> {
        let borrowed = |fields: &[Field]| fields.iter().map(Field::borrowed).collect::<Vec<_>>();
        let mut new = self.unjudged(model, readings, borrowed(&state.fields), Some(&state.table))?;
        new.own = false;
        new.held_out_finer = borrowed(&state.held_out_finer);
        self.judge(&mut new);
        Ok(new)
    }

    /// How a state predicts what was left out.
    pub(super) fn judge(&self, state: &mut State) {
        state.needed = self.needed(state);
        let own = linear::around(&self.cells, &self.blocks, state);
        // The size that readings have on the whole.
        let size = own.discrepancy(&self.blocks);
        let corrected;
        (corrected, state.model.errors) = linear::stated(state, &own, &self.blocks, size);
        state.strange = self.lab.strange(&state.model, &corrected);
        let density = |tau: f64| {
            let mut all = own.left_out(&self.blocks, tau);
            all.push(own.known_left_out(&self.blocks, tau));
            if let Some((readings, (cells, blocks))) = state.held_out.as_ref().zip(self.second.as_ref()) {
                let taught = own.posterior(&self.blocks, tau);
                all.extend(linear::elsewhere(cells, blocks, readings, state, &taught).left_out(blocks, tau));
            }
            all
        };
        let prior = Prior { candidates: self.candidates, readings: self.cells.len() };
        let all = SIZES.map(density);
        let seen: Vec<Vec<f64>> = all.iter().map(|d| d.iter().map(|d| d.seen).collect()).collect();
        let (beside, _) = stacked(&seen);
        state.judged = Judged {
            expected: all[0].iter().map(|d| d.expected).sum(),
            beside,
            price: prior.discrepancy(),
            log_prior: prior.log(&state.needed, &state.strange),
            // Beside that size: numbers that were left to follow the readings contradict nothing.
            conflict: own.conflict(&self.blocks, size),
            alone: seen.into_iter().next().unwrap_or_default(),
        };
    }

    /// Cells of a second recording, as the baseline meets it.
    pub(super) fn look_elsewhere(&mut self, state: &mut State) {
        let Some(readings) = &state.held_out else { return };
        let mut cells = Cells::new(readings);
        if cells.is_empty() {
            return;
        }
        let ratio = self.noise_ratio;
        for (sd, k) in cells.sd.iter_mut().zip(&cells.keys) {
            *sd *= if k.stream.sensor.is_camera() { ratio } else { 1.0 } * self.design_effect.sqrt();
        }
        let blocks = Blocks::new(&cells);
        self.second = Some((cells, blocks));
        self.judge(state);
    }

    /// What finer computations would change in a state's residuals of data that no fit has seen.
    pub(super) fn held_out_finer(&mut self, state: &State) -> Vec<Field> {
        let Some(coarse) = &state.held_out else { return Vec::new() };
        self.lab.held_out_finer(&state.model, coarse).unwrap_or_default()
    }
}
