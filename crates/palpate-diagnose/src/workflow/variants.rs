//! Candidates in all their variants, scored by what they promise.

use super::{Session, State};
use crate::change::{Candidate, Change, candidates};
use crate::laboratory::{LabError, Number};
use crate::null::extended;
use crate::score::{Score, score};

/// Starts of an effect at an unknown place that are scored first; the others follow where one of these comes within reach of the best.
const FIRST_STARTS: usize = 8;
/// The share of the best candidate's gain that is within reach.
const REACH: f64 = 0.25;

/// A variant of a candidate with its columns where it is absent.
pub(super) struct Variant {
    pub candidate: usize,
    /// What it adds: one change, or two at once.
    pub changes: Vec<Change>,
    /// Of every free number of the changes, `[k][m]`.
    pub columns: Vec<Vec<f64>>,
    /// Which of them count at "absent".
    pub amplitudes: Vec<bool>,
    /// Its free numbers, where it is absent.
    pub numbers: Vec<Number>,
    pub score: Score,
}

/// Order of what variants promise, the most first.
pub(super) fn most_promising(a: &Variant, b: &Variant) -> std::cmp::Ordering {
    b.score.gain.total_cmp(&a.score.gain)
}

impl Variant {
    /// Its name, of two joined by a plus.
    pub fn kind(&self) -> String {
        Change::kinds(&self.changes)
    }

    /// Sizes of its numbers that show whether it helps, where small ones do not tell ([`Change::blunt`]).
    pub fn blunt(&self) -> Option<Vec<f64>> {
        if let [change] = &self.changes[..] { change.blunt() } else { None }
    }

    /// True where every number has a derivative at "absent": there is one place to start from.
    pub fn is_certain(&self) -> bool {
        self.amplitudes.iter().all(|a| *a)
    }
}

impl Session<'_> {
    /// Variants of every candidate, scored where it is absent: of effects at an unknown place first a few, the others only of those that
    /// promise much.
    pub(super) fn variants(&mut self, state: &State) -> Result<Vec<Variant>, LabError> {
        self.variants_of(state, |_| true)
    }

    /// The same of candidates whose changes are wanted.
    pub(super) fn variants_of(&mut self, state: &State, wanted: impl Fn(&Change) -> bool) -> Result<Vec<Variant>, LabError> {
        self.lab.say("scoring candidates");
        let all = candidates(self.lab.setting());
        let stride = |c: &Candidate| if self.cells.few_instants() { 1 } else { c.variants.len().div_ceil(FIRST_STARTS).max(1) };
        let (mut first, mut later) = (Vec::new(), Vec::new());
        for (n, c) in all.iter().enumerate() {
            let by = stride(c);
            for (i, v) in c.variants.iter().enumerate().filter(|(_, v)| wanted(v)) {
                if i % by == 0 { &mut first } else { &mut later }.push((n, v.clone()));
            }
        }
        let mut scored = self.scored(state, first)?;
        let best = scored.iter().map(|v| v.score.gain).fold(0.0, f64::max);
        let within = |n: usize| scored.iter().any(|v| v.candidate == n && v.score.gain >= REACH * best);
        let more: Vec<_> = later.into_iter().filter(|(n, _)| within(*n)).collect();
        scored.extend(self.scored(state, more)?);
        Ok(scored)
    }

    /// These variants (number of their candidate, change), scored where they are absent.
    pub(super) fn scored(&mut self, state: &State, wanted: Vec<(usize, Change)>) -> Result<Vec<Variant>, LabError> {
        let mut tries = Vec::new();
        let mut out: Vec<Variant> = Vec::new();
        let own = state.model.values.len();
        for (candidate, change) in wanted {
            let same =
                |x: &Change| matches!((x, &change), (Change::Freed { name: a, .. }, Change::Freed { name: b, .. }) if a == b);
            if state.model.changes.iter().any(same) {
                continue;
            }
            let mut changes = state.model.changes.clone();
            changes.push(change.clone());
            let numbers = self.lab.numbers(&changes)?.split_off(own);
            let mut values = state.model.values.clone();
            values.extend(numbers.iter().map(|n| n.start));
            out.push(Variant {
                candidate,
                columns: Vec::new(),
                amplitudes: change.amplitudes(),
                changes: vec![change],
                numbers,
                score: Score::default(),
            });
            tries.push((changes, values));
        }
        let answers = self.lab.linearise_new(&tries, own);
        let mut kept = Vec::new();
        for (mut v, answer) in out.into_iter().zip(answers) {
            match answer {
                Ok(readings) => {
                    v.columns = self.cells.table(&readings, None).columns;
                    v.score = self.score(state, &v);
                    kept.push(v);
                }
                Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                Err(LabError::Failed(_)) => {}
                Err(LabError::NoTime) => self.missed(&v.kind(), &LabError::NoTime),
            }
        }
        self.score_walls(state, &mut kept);
        Ok(kept)
    }

    /// Scores variants of which small amplitudes tell nothing by what amplitudes of typical size really do: a body that has fallen deep through a
    /// wall is thrown out of it by the softest one.
    fn score_walls(&mut self, state: &State, variants: &mut [Variant]) {
        let mut walls: Vec<(&mut Variant, Vec<f64>)> = Vec::new();
        for v in variants {
            if let Some(sizes) = v.blunt() {
                walls.push((v, sizes));
            }
        }
        let tries: Vec<_> = walls
            .iter()
            .map(|(v, sizes)| {
                let mut changes = state.model.changes.clone();
                changes.extend_from_slice(&v.changes);
                let own = state.model.values.iter().copied();
                (changes, own.chain(v.numbers.iter().zip(sizes).map(|(n, size)| n.start + size)).collect::<Vec<f64>>())
            })
            .collect();
        let whole = state.squares();
        for ((v, sizes), cost) in walls.into_iter().zip(self.lab.costs(&tries)) {
            v.columns.iter_mut().flatten().for_each(|c| *c = 0.0);
            let share = (1.0 - cost / state.readings.cost).max(0.0);
            v.score = Score { gain: share * whole, share, step: sizes, ..self.score(state, v) };
        }
    }

    pub(super) fn score(&self, state: &State, v: &Variant) -> Score {
        let n = state.frame.fields.len();
        let chosen: Vec<usize> = (0..v.columns.len()).filter(|k| v.amplitudes[*k]).collect();
        let columns: Vec<Vec<f64>> = chosen.iter().map(|k| extended(&v.columns[*k], n)).collect();
        let bounds: Vec<(f64, f64)> = chosen.iter().map(|k| v.numbers[*k].room()).collect();
        let groups: Vec<String> = v.changes.iter().flat_map(Change::groups).collect();
        let groups: Vec<String> = chosen.iter().map(|k| groups[*k].clone()).collect();
        let mut s = score(&state.frame, &columns, &bounds, &groups);
        let mut step = vec![0.0; v.columns.len()];
        chosen.iter().zip(&s.step).for_each(|(k, x)| step[*k] = *x);
        s.step = step;
        s
    }
}
