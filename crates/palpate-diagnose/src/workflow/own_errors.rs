//! Errors of grid and step are those of a model: where its body goes elsewhere, or is ten times softer on one side, they are others than the
//! baseline's. Where these matter, candidates are compared beside their own.

use super::{Fitted, Session, State};
use crate::laboratory::Field;

/// Candidates that are measured beside errors of their own.
const RIVALS: usize = 4;
/// Iterations of fits that there must be time for to measure one: it takes about as long.
pub(super) const MEASURED: usize = 10;
/// Share of what the best takes away by which others may lag behind and still be rivals: with errors of their own they may be the better ones.
const LAG: f64 = 0.05;

impl Session<'_> {
    /// Of the candidates from `old` on, those to be measured beside errors of their own: the best of all, unless it leaves little
    /// more than noise, and those within reach of it.
    pub(super) fn rivals(&self, state: &State, fitted: &[Fitted], old: usize) -> Vec<usize> {
        let loss = |k: &usize| fitted[*k].state.predicted[0].loss();
        let mut all: Vec<usize> = (0..fitted.len()).collect();
        all.sort_by(|a, b| loss(a).total_cmp(&loss(b)));
        let whole = state.predicted[0].loss();
        let Some(best) = all.first().filter(|k| loss(k) < whole && !self.is_noise(&fitted[**k].state, &[])) else {
            return Vec::new();
        };
        let worst = loss(best) + LAG * (whole - loss(best));
        all.into_iter().take(RIVALS).filter(|k| *k >= old && loss(k) <= worst).collect()
    }

    /// A candidate beside its own errors of the discretisation.
    pub(super) fn beside_its_own(&mut self, new: &State) -> State {
        let fields = self.finer(&new.model);
        let frame = self.frame(&new.table, &fields);
        let predicted = self.predict(&new.readings, &new.table, &frame);
        State { fields, frame, predicted, ..new.clone() }
    }

    /// True if the best of the candidates leaves little more than noise, or than noise and its errors of the discretisation: an
    /// effect that makes up for these is none.
    pub(super) fn explained(&self, state: &State, fitted: &[Fitted]) -> bool {
        let loss = |s: &State| s.predicted[0].loss();
        let best = fitted.iter().map(|f| &f.state).min_by(|a, b| loss(a).total_cmp(&loss(b)));
        best.is_some_and(|s| loss(s) <= loss(state) && (self.is_noise(s, &[]) || self.is_noise(s, &s.fields)))
    }

    /// True if a model leaves little more than noise, or than noise and these errors of the discretisation, and nothing with structure.
    fn is_noise(&self, state: &State, finer: &[Field]) -> bool {
        self.level_of(&state.readings, 0.0, finer).is_close() && !self.is_missing(&self.adequacy(state), state)
    }
}
