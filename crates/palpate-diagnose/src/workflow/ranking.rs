//! The ranking of candidates by their sensitivities: what there is to say from the first minute on, before anything is fitted.

use super::race::linear_moves;
use super::variants::{Variant, most_promising};
use super::{CandidateId, Session, State, keep_first};
use crate::change::{Change, candidates};
use crate::diagnosis::{NOT_SCORED, Tried};
use crate::judgement::prior::Prior;
use crate::laboratory::{LabError, Model};
use crate::movement::{Movement, largest};
use std::collections::BTreeSet;

/// Candidates of which it is said what they would do to the answer where they were not fitted.
const TOLD: usize = 5;

/// A candidate by what its sensitivities promise.
#[derive(Clone)]
pub(super) struct Ranked {
    /// Round of the search: 0 where the baseline's fit began.
    round: usize,
    pub kind: String,
    /// Share of the squared residual.
    pub share: f64,
    /// True where it may be as good as the model without it.
    pub open: bool,
    /// What it would do to the free numbers.
    pub movement: Option<Movement>,
}

/// Candidates that were scored beside one model before anything else was asked of it.
#[derive(Default)]
pub(super) struct Early {
    model: Option<Model>,
    pub variants: Vec<Variant>,
}

impl Early {
    /// The columns of a change beside a model.
    pub fn find(&self, model: &Model, change: &Change) -> Option<&Vec<Vec<f64>>> {
        let same = |m: &Model| (&m.changes, &m.values) == (&model.changes, &model.values);
        self.model.as_ref().filter(|m| same(m))?;
        self.variants.iter().find(|v| v.changes[0] == *change).map(|v| &v.columns)
    }
}

impl Session<'_> {
    /// Scores candidates at a state before anything else is asked of it, and ranks them; of effects at an unknown place one start, or the few of a
    /// `whole` look. False where there was no time for all.
    pub(super) fn look(&mut self, state: &State, round: usize, whole: bool) -> Result<bool, LabError> {
        self.lab.say("scoring candidates");
        let all = candidates(self.lab.setting());
        let mut wanted = Vec::new();
        for (n, c) in all.iter().enumerate() {
            let by = if whole { self.stride(c) } else { c.variants.len().max(1) };
            // What must be tried at its size is a matter of its own.
            let plain = c.variants.iter().filter(|v| !v.is_tried(palpate_model::effects::Trial::Walls));
            wanted.extend(plain.step_by(by).map(|v| (CandidateId::Single(n), v.clone())));
        }
        // What is read of a motion costs least, of what is not ranked yet least is known, and what promised most before may again.
        let share = |c: &Change| self.ranked.iter().find(|r| r.kind == c.kind()).map_or(f64::INFINITY, |r| r.share);
        let order = |a: &Change, b: &Change| b.is_read().cmp(&a.is_read()).then(share(b).total_cmp(&share(a)));
        wanted.sort_by(|(_, a): &(CandidateId, Change), (_, b)| order(a, b));
        let (scored, missed) = self.columns(state, wanted)?;
        self.rank(state, round, &scored);
        self.early = Early { model: Some(state.model.clone()), variants: scored };
        Ok(missed.is_empty())
    }

    /// Ranks what was scored, before what was ranked elsewhere and is not among it.
    pub(super) fn rank(&mut self, state: &State, round: usize, scored: &[Variant]) {
        let mut best: Vec<&Variant> = scored.iter().collect();
        best.sort_by(|a, b| most_promising(a, b));
        keep_first(&mut best, |v| v.candidate);
        let price = Prior { candidates: self.candidates, readings: self.cells.len() };
        let ranked = best.into_iter().map(|v| {
            let promise = 0.5 * v.score.gain + price.log(&[v.score.freedom.max(1)], &[]);
            let after = linear_moves(state, v);
            Ranked {
                round,
                kind: v.kind(),
                share: v.score.share,
                open: promise > -Prior::odds(),
                movement: largest(&v.kind(), &state.model, &after, &[], false),
            }
        });
        let ranked: Vec<Ranked> = ranked.collect();
        let new: BTreeSet<String> = ranked.iter().map(|r| r.kind.clone()).collect();
        let before = std::mem::replace(&mut self.ranked, ranked);
        self.ranked.extend(before.into_iter().filter(|r| !new.contains(&r.kind)));
    }

    /// Adds what the search did not come to to what was tried, and says what was not even scored.
    pub(super) fn note_open(&mut self, why: &LabError) {
        for t in self.tried.iter_mut() {
            t.open = t.held_out_gain.is_none();
        }
        let mut known: BTreeSet<String> = self.tried.iter().map(|t| t.kind.clone()).collect();
        for r in &self.ranked {
            if known.insert(r.kind.clone()) {
                let (round, kind, promised) = (r.round, r.kind.clone(), r.share);
                self.tried.push(Tried { round, kind, promised, held_out_gain: None, open: true });
            }
        }
        for c in candidates(self.lab.setting()) {
            if known.insert(c.kind().into()) {
                self.not_tried.push(format!("{}: {NOT_SCORED}: {why}", c.kind()));
            }
        }
    }

    /// What the most promising of those that were not fitted would do to the answer.
    pub(super) fn open_movements(&self) -> Vec<Movement> {
        let open = |kind: &str| self.tried.iter().any(|t| t.open && t.kind == kind);
        let mut all: Vec<&Ranked> = self.ranked.iter().filter(|r| open(&r.kind)).collect();
        all.sort_by(|a, b| b.share.total_cmp(&a.share));
        all.into_iter().take(TOLD).filter_map(|r| r.movement.clone()).collect()
    }

    /// The largest movement by a candidate that a model without anything missing does not exclude.
    pub(super) fn not_excluded(&self) -> Option<Movement> {
        let fitted = self.rivals.iter().map(|m| &m.candidate);
        let fitted: BTreeSet<&String> = fitted.collect();
        let scored = self.ranked.iter().filter(|r| r.open && !fitted.contains(&r.kind)).filter_map(|r| r.movement.as_ref());
        let tried = |kind: &str| self.tried.iter().any(|t| t.kind == kind && t.held_out_gain.is_some());
        // Of what was fitted the fit says it.
        let all = scored.filter(|m| !tried(&m.candidate)).chain(&self.rivals);
        all.filter(|m| m.is_beyond_error()).max_by(|a, b| a.size().total_cmp(&b.size())).cloned()
    }
}
