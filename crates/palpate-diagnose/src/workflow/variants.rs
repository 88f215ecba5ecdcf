//! Candidates in all their variants, scored by what they promise.

use super::{CandidateId, Session, State};
use crate::change::{Candidate, Change, candidates};
use crate::laboratory::{LabError, Number};
use crate::null::extended;
use crate::score::{Score, score};
use palpate_model::effects::Trial;

/// A variant of a candidate with its columns where it is absent.
#[derive(Clone)]
pub(super) struct Variant {
    pub candidate: CandidateId,
    /// What it adds: one change, or two at once.
    pub changes: Vec<Change>,
    /// Of every free number of the changes, `[k][m]`.
    pub columns: Vec<Vec<f64>>,
    /// Which of them count at "absent".
    pub amplitudes: Vec<bool>,
    /// Its free numbers, where it is absent.
    pub numbers: Vec<Number>,
    /// Sizes of its numbers that it starts from, where small ones do not tell whether it helps.
    pub blunt: Option<Vec<f64>>,
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

    /// True where every number has a derivative at "absent": there is one place to start from.
    pub fn is_certain(&self) -> bool {
        self.amplitudes.iter().all(|a| *a)
    }
}

/// Variants by their columns, and kinds that are missing among them with the reason.
type Columned = (Vec<Variant>, Vec<(String, LabError)>);

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
        let reach = self.options.search.places.1;
        let (mut first, mut later) = (Vec::new(), Vec::new());
        for (n, c) in all.iter().enumerate() {
            let by = self.stride(c);
            for (i, v) in c.variants.iter().enumerate().filter(|(_, v)| wanted(v)) {
                if i % by == 0 { &mut first } else { &mut later }.push((CandidateId::Single(n), v.clone()));
            }
        }
        let mut scored = self.scored(state, first)?;
        let best = scored.iter().map(|v| v.score.gain).fold(0.0, f64::max);
        let within = |n: CandidateId| scored.iter().any(|v| v.candidate == n && v.score.gain >= reach * best);
        let more: Vec<_> = later.into_iter().filter(|(n, _)| within(*n)).collect();
        scored.extend(self.scored(state, more)?);
        let sizes = self.sized(state, &scored, Trial::Saturates, &[1.0]);
        scored.extend(sizes);
        Ok(scored)
    }

    /// Variants that are tried so, scored by what multiples of their typical size really do.
    pub(super) fn sized(&mut self, state: &State, all: &[Variant], how: Trial, times: &[f64]) -> Vec<Variant> {
        let typical = |v: &Variant, times: f64| v.changes.iter().flat_map(Change::typical).map(|x| times * x).collect();
        let sized = |v: &Variant| times.iter().map(|x| Variant { blunt: Some(typical(v, *x)), ..v.clone() }).collect::<Vec<_>>();
        let mut sizes: Vec<Variant> = all.iter().filter(|v| v.changes.iter().all(|c| c.is_tried(how))).flat_map(sized).collect();
        self.score_by_size(state, &mut sizes);
        sizes
    }

    /// Of so many starts of a candidate one is scored first.
    pub(super) fn stride(&self, c: &Candidate) -> usize {
        let places = self.options.search.places.0;
        if self.cells.few_instants() { 1 } else { c.variants.len().div_ceil(places).max(1) }
    }

    /// These variants (their candidate, change), scored where they are absent; what there was no time for is left out and noted.
    pub(super) fn scored(&mut self, state: &State, wanted: Vec<(CandidateId, Change)>) -> Result<Vec<Variant>, LabError> {
        let (mut kept, missed) = self.columns(state, wanted)?;
        let late = missed.iter().filter(|(_, why)| matches!(why, LabError::NoTime));
        late.for_each(|(kind, why)| self.missed(kind, why));
        self.score_by_size(state, &mut kept);
        Ok(kept)
    }

    /// The same by their columns alone, those that are known already among them; and kinds of which there was no time for all.
    pub(super) fn columns(&mut self, state: &State, wanted: Vec<(CandidateId, Change)>) -> Result<Columned, LabError> {
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
                blunt: change.is_tried(Trial::Walls).then(|| change.typical()),
                changes: vec![change],
                numbers,
                score: Score::default(),
            });
            tries.push((changes, values));
        }
        let known: Vec<bool> = out.iter().map(|v| self.early.find(&state.model, &v.changes[0]).is_some()).collect();
        let mut open = known.iter();
        tries.retain(|_| open.next() == Some(&false));
        let mut answers = self.lab.linearise_new(&tries, own).into_iter();
        let (mut kept, mut missed) = (Vec::new(), Vec::new());
        for (mut v, known) in out.into_iter().zip(known) {
            let answer = if known { None } else { answers.next() };
            v.columns = match answer {
                None => self.early.find(&state.model, &v.changes[0]).cloned().unwrap_or_default(),
                Some(Ok(readings)) => self.cells.table(&readings, None).columns,
                Some(Err(LabError::Failed(_))) => continue,
                Some(Err(why)) => {
                    missed.push((v.kind(), why));
                    continue;
                }
            };
            v.score = self.score(state, &v);
            kept.push(v);
        }
        Ok((kept, missed))
    }

    /// Scores variants of which small amplitudes tell nothing by what amplitudes of typical size really do: a body that has fallen deep through a
    /// wall is thrown out of it by the softest one.
    /// What there was no time for is dropped.
    fn score_by_size(&mut self, state: &State, variants: &mut Vec<Variant>) {
        let mut blunt: Vec<(&mut Variant, Vec<f64>)> = Vec::new();
        for v in variants.iter_mut() {
            if let Some(sizes) = v.blunt.clone() {
                blunt.push((v, sizes));
            }
        }
        let tries: Vec<_> = blunt
            .iter()
            .map(|(v, sizes)| {
                let mut changes = state.model.changes.clone();
                changes.extend_from_slice(&v.changes);
                let own = state.model.values.iter().copied();
                (changes, own.chain(v.numbers.iter().zip(sizes).map(|(n, size)| n.start + size)).collect::<Vec<f64>>())
            })
            .collect();
        let whole = state.squares();
        if tries.is_empty() {
            return;
        }
        let costs = self.lab.costs(&tries);
        let stopped = self.lab.interrupted() || self.lab.out_of_time();
        let mut late = Vec::new();
        for ((v, sizes), cost) in blunt.into_iter().zip(costs) {
            if stopped && !cost.is_finite() {
                late.push(v.kind());
                v.columns.clear();
                continue;
            }
            v.columns.iter_mut().flatten().for_each(|c| *c = 0.0);
            let share = (1.0 - cost / state.readings.cost).max(0.0);
            v.score = Score { gain: share * whole, share, step: sizes, ..self.score(state, v) };
        }
        variants.retain(|v| v.blunt.is_none() || !v.columns.is_empty());
        if !self.lab.interrupted() {
            late.iter().for_each(|kind| self.missed(kind, &LabError::NoTime));
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

#[cfg(test)]
mod tests {
    use super::super::prune::tests::{Step, left};
    use super::*;
    use crate::diagnosis::Found;
    use crate::tests::bench::Bench;

    /// Checks how friction is tried where the recording hides twice its typical size.
    const FRICTION: Step = |s: &mut Session, state: State, _: &mut Vec<Found>| {
        let variants = s.variants(&state).unwrap();
        let friction: Vec<&Variant> = variants.iter().filter(|v| v.kind() == "coulomb-friction").collect();
        let [slides, sticks] = &friction[..] else { panic!("{} starts", friction.len()) };
        assert!(slides.blunt.is_none() && slides.score.share > 0.99);
        assert_eq!(sticks.score.step, sticks.changes[0].typical());
        // Half of it takes less than all away: the other numbers stay where they made up for it.
        assert!((0.3..0.6).contains(&sticks.score.share), "{}", sticks.score.share);
        // Drag slows a body down however much of it there is.
        assert_eq!(variants.iter().filter(|v| v.kind() == "air-drag").count(), 1);
        state
    };

    #[test]
    fn what_saturates_is_tried_from_its_typical_size_too() {
        let hidden = Bench::first_pattern("coulomb-friction");
        left(FRICTION, ["depth-bias", "uniform-force"], &[(&hidden, -0.6)]);
    }
}
