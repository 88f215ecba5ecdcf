//! One round: candidates are fitted, judged on data left out, and one of them is chosen, or none.

use super::{Fitted, Session, State, Variant, one};
use crate::change::Change;
use crate::crossval::worse_by;
use crate::diagnosis::{Found, Level, Tried};
use crate::laboratory::{LabError, Model, Readings};
use crate::linear::dot;
use crate::score::f_tail;

/// Share of the gap by which candidates may differ and still count as equal.
const TIE: f64 = 0.003;
/// Share of the gap that an effect with fewer parameters may leave open and still be preferred.
const SIMPLER: f64 = 0.03;

impl Session<'_> {
    /// One round: the accepted effect with its state, or the candidates that came closest.
    #[expect(clippy::type_complexity, reason = "one caller, which takes it apart at once")]
    pub(super) fn round(&mut self, state: &State, round: usize) -> Result<(Option<(Found, State)>, Vec<Found>), LabError> {
        let mut variants = match self.scored.take() {
            Some(v) => v,
            None => self.variants(state)?,
        };
        let count = variants.iter().map(|v| v.candidate).collect::<std::collections::BTreeSet<_>>().len() as f64;
        variants.sort_by(|a, b| b.score.gain.total_cmp(&a.score.gain));
        let mut seen: Vec<usize> = Vec::new();
        let mut tries = Vec::new();
        let fits = if self.cells.few_instants() { 2 * self.options.fits } else { self.options.fits };
        for v in &variants {
            let before = seen.iter().filter(|c| **c == v.candidate).count();
            seen.push(v.candidate);
            if before == 0 {
                let (kind, promised, p_value) = (v.change.kind().to_string(), v.score.share, v.score.p_value);
                self.tried.push(Tried { round, kind, promised, held_out_gain: None, p_value });
            }
            // The best start of a candidate, and a second one where it acts at an unknown place.
            let starts = if v.amplitudes.iter().all(|a| *a) { 1 } else { 2 };
            if before < starts && v.score.p_value * count < 0.05 && tries.len() < fits + fits / 2 {
                tries.push(v);
            }
        }
        self.lab.say(&format!("fitting {} candidates", tries.len()));
        let jobs: Vec<(Vec<Change>, Vec<f64>)> = tries
            .iter()
            .map(|v| {
                let mut changes = state.model.changes.clone();
                changes.push(v.change.clone());
                let moved = |k: usize| v.start[k] + v.score.step[k].clamp(v.bounds[k].0, v.bounds[k].1);
                (changes, state.model.values.iter().copied().chain((0..v.start.len()).map(moved)).collect())
            })
            .collect();
        let models = self.lab.fit(&jobs);
        let mut fitted: Vec<Fitted> = Vec::new();
        for (v, model) in tries.iter().zip(models) {
            let model = match model {
                Ok(m) => m,
                Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                Err(LabError::Failed(why)) => {
                    self.not_tried.push(format!("{}: {why}", v.change.kind()));
                    continue;
                }
            };
            let readings = match one(self.lab.linearise(&[(model.changes.clone(), model.values.clone())])) {
                Ok(r) => r,
                Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                Err(LabError::Failed(_)) => continue,
            };
            let f = self.judge(state, v, model, readings, count)?;
            match fitted.iter_mut().find(|o| o.candidate == f.candidate) {
                Some(o) if o.state.predicted[0].loss() > f.state.predicted[0].loss() => *o = f,
                Some(_) => {}
                None => fitted.push(f),
            }
        }
        fitted.sort_by(|a, b| a.state.predicted[0].loss().total_cmp(&b.state.predicted[0].loss()));
        for f in &fitted {
            let kind = f.state.model.changes.last().map_or("", Change::kind);
            let mine = self.tried.iter_mut().find(|t| t.round == round && t.kind == kind && t.held_out_gain.is_none());
            mine.into_iter().for_each(|t| t.held_out_gain = Some(f.gain));
        }
        self.decide(state, fitted)
    }

    /// What a fitted candidate is worth.
    fn judge(&mut self, state: &State, v: &Variant, model: Model, readings: Readings, count: f64) -> Result<Fitted, LabError> {
        let new = self.state(model, readings, Some(state.fields.clone()), Some(&state.table))?;
        let squares = |s: &State| {
            let left = s.frame.left();
            dot(&left, &left)
        };
        let (with, without) = (squares(&new), squares(state));
        let freedom = v.columns.len();
        let rest = self.cells.len() as f64 - (state.frame.absorbed.rank() + freedom) as f64;
        let p_value = (f_tail((without - with).max(0.0), freedom, with, rest) * count).min(1.0);
        let gains = state.predicted.iter().zip(&new.predicted);
        let gains = gains.map(|(b, a)| (b.loss() - a.loss()) / (b.loss() - b.floor).max(0.02 * b.floor));
        let mut gain = gains.fold(1.0, f64::min);
        if let (Some(b), Some(a)) = (self.held_out(&state.model)?, self.held_out(&new.model)?) {
            gain = gain.min((b.rms * b.rms - a.rms * a.rms) / b.gap().max(0.02 * b.noise * b.noise));
        }
        Ok(Fitted { candidate: v.candidate, state: new, p_value, gain, freedom })
    }

    pub(super) fn held_out(&mut self, model: &Model) -> Result<Option<Level>, LabError> {
        match self.lab.held_out(model) {
            Ok(readings) => Ok(readings.map(|r| self.level_of(&r, 0.0))),
            Err(LabError::Interrupted) => Err(LabError::Interrupted),
            Err(LabError::Failed(_)) => Ok(None),
        }
    }

    /// Chooses among fitted candidates, best prediction first.
    #[expect(clippy::type_complexity, reason = "as `round`")]
    fn decide(&mut self, state: &State, fitted: Vec<Fitted>) -> Result<(Option<(Found, State)>, Vec<Found>), LabError> {
        let passes = |f: &Fitted| f.p_value < self.options.significance && f.gain >= self.options.least_gain;
        let whole = (state.predicted[0].loss() - state.predicted[0].floor).max(0.0);
        let Some(best) = fitted.iter().position(passes) else {
            return Ok((None, fitted.iter().take(3).map(|f| self.found(f, false)).collect()));
        };
        let excess = |i: usize| {
            let p = &fitted[i].state.predicted[0];
            ((p.loss() - p.floor).max(0.0), p.floor)
        };
        // Frames that follow each other are not independent: a clear misfit that the best does not have is no matter of chance.
        let as_close = |i: usize| excess(i).0 < 2.0 * excess(best).0 + 0.5 * excess(best).1;
        // Candidates that predict as well as the best, up to noise or up to a share of the gap.
        let near = |i: usize, share: f64| {
            let (by, z) = worse_by(&self.cells, &fitted[best].state.predicted[0], &fitted[i].state.predicted[0]);
            passes(&fitted[i]) && (by < share * whole || (z < 2.0 && as_close(i)))
        };
        let equal: Vec<usize> = (0..fitted.len()).filter(|i| near(*i, TIE)).collect();
        // The simplest explanation wins unless it is clearly worse: a freer one also fits what no model gets right.
        let simplest = (0..fitted.len()).filter(|i| near(*i, SIMPLER)).min_by_key(|i| (fitted[*i].freedom, *i));
        let winner = simplest.unwrap_or(best);
        let mut found = self.found(&fitted[winner], true);
        for &other in equal.iter().filter(|i| **i != winner) {
            let change = fitted[other].state.model.changes.last();
            found.indistinguishable_from.extend(change.map(|c| c.kind().to_string()));
        }
        if let Some(&other) = equal.iter().find(|i| **i != winner) {
            self.lab.say("looking for a measurement that separates candidates");
            let mut ways = self.lab.separations(&fitted[winner].state.model, &fitted[other].state.model);
            ways.sort_by(|a, b| b.1.total_cmp(&a.1));
            found.separated_by = ways.into_iter().next();
        }
        let mut fitted = fitted;
        let won = fitted.swap_remove(winner).state;
        let next = self.state(won.model, won.readings, None, None)?;
        Ok((Some((found, next)), Vec::new()))
    }

    fn found(&self, f: &Fitted, accepted: bool) -> Found {
        let model = &f.state.model;
        let change = model.changes.last();
        let own = model.values.len() - f.freedom;
        let number = |k: usize| (model.numbers[k].path.clone(), model.values[k], model.errors[k], model.numbers[k].unit.clone());
        Found {
            kind: change.map_or("", Change::kind).into(),
            sentence: change.map_or("", Change::sentence).into(),
            parameters: (own..model.values.len()).map(number).collect(),
            p_value: f.p_value,
            held_out_gain: f.gain.clamp(0.0, 1.0),
            accepted,
            indistinguishable_from: Vec::new(),
            separated_by: None,
        }
    }
}
