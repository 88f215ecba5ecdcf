//! Two plain effects at once as one candidate: what a freer one follows, because with enough numbers anything is followed, may be two plain
//! ones, neither of which explains much by itself.

use super::variants::{Variant, most_promising};
use super::{CandidateId, Fitted, Session, State, keep_first};
use crate::laboratory::{LabError, Model, Number};
use crate::score::Score;
use std::rc::Rc;

/// A range of numbers of numbers: pairs of each are ranked on their own, because those with more always promise more.
type Class = std::ops::RangeInclusive<usize>;

impl Session<'_> {
    /// Pairs of plain effects with fewer than so many numbers that are worth a fit, each with the state that it starts from.
    pub(super) fn pairs(
        &mut self,
        state: &State,
        fitted: &[Fitted],
        variants: &[Variant],
        fewer_than: usize,
    ) -> Result<Vec<(Rc<State>, Variant)>, LabError> {
        // The smallest pair has two.
        if fewer_than <= 2 {
            return Ok(Vec::new());
        }
        let policy = &self.options.search;
        let most = policy.plain.0;
        let plain = with_at_most(most, variants);
        let mut out = self.partners(state, fitted, &plain, fewer_than)?;
        out.extend(self.promising(state, &plain, (&[2..=2, 3..=3, 4..=2 * most], policy.pairs.0), |a, b| a + b < fewer_than));
        keep_first(&mut out, |(_, v)| v.candidate);
        Ok(out)
    }

    /// Pairs of a plain effect and a freer one that are worth a fit where nothing plainer passes: what two causes do together may look like
    /// neither of them, and like no single cause.
    pub(super) fn freer_pairs(&self, state: &State, variants: &[Variant]) -> Vec<(Rc<State>, Variant)> {
        let policy = &self.options.search;
        let (plain, free) = policy.plain;
        let classes = [plain + 2..=free, free + 1..=free + plain];
        self.promising(state, &with_at_most(free, variants), (&classes, policy.pairs.1), |a, b| (a > plain) != (b > plain))
    }

    /// Those that promise most together where both are absent, of those whose numbers of numbers fit, with the state where they are.
    fn promising(
        &self,
        state: &State,
        effects: &[&Variant],
        (classes, each): (&[Class], usize),
        fits: impl Fn(usize, usize) -> bool,
    ) -> Vec<(Rc<State>, Variant)> {
        let promise = self.options.search.promise;
        let mut out: Vec<Variant> = Vec::new();
        for class in classes {
            let mut these: Vec<Variant> = Vec::new();
            for (i, a) in effects.iter().enumerate() {
                for b in &effects[i + 1..] {
                    let (first, second) = (a.columns.len(), b.columns.len());
                    if class.contains(&(first + second)) && fits(first, second) {
                        let mut both = joined(a, b);
                        both.score = self.score(state, &both);
                        let share = both.score.share;
                        these.extend((share >= promise.0 && share >= a.score.share + promise.1).then_some(both));
                    }
                }
            }
            these.sort_by(most_promising);
            these.truncate(each);
            out.extend(these);
        }
        let from = Rc::new(state.clone());
        out.into_iter().map(|v| (from.clone(), v)).collect()
    }

    /// Partners of the plain effects that were fitted, the best of those first: an effect that is there already shows better what lacks
    /// beside it.
    fn partners(
        &mut self,
        state: &State,
        fitted: &[Fitted],
        plain: &[&Variant],
        fewer_than: usize,
    ) -> Result<Vec<(Rc<State>, Variant)>, LabError> {
        let policy = self.options.search.clone();
        let mut out: Vec<(Rc<State>, Variant)> = Vec::new();
        for f in fitted.iter().filter(|f| f.effects == 1 && plain.iter().any(|v| v.candidate == f.candidate)).take(policy.pairs.2)
        {
            let fits = |v: &&&Variant| v.candidate != f.candidate && v.columns.len() + f.freedom < fewer_than;
            let wanted = plain.iter().filter(fits).map(|v| (v.candidate, v.changes[0].clone())).collect();
            let mut seconds = self.scored(&f.state, wanted)?;
            seconds.sort_by(most_promising);
            seconds.truncate(policy.pairs.0);
            seconds.retain(|v| f.state.squares() - v.score.gain <= (1.0 - policy.promise.0) * state.squares());
            let (from, half) = as_fitted(state, f);
            let from = Rc::new(from);
            out.extend(seconds.iter().map(|b| (from.clone(), joined(&half, b))));
        }
        Ok(out)
    }
}

/// The baseline with its numbers as they were fitted beside an effect, and that effect as a variant that stands there already.
fn as_fitted(state: &State, f: &Fitted) -> (State, Variant) {
    let own = state.model.values.len();
    let (mut from, fitted) = (f.state.clone(), &f.state.model);
    from.model = Model { values: fitted.values[..own].to_vec(), ..state.model.clone() };
    let columns = from.table.columns.split_off(own);
    let stands = |(n, v): (&Number, &f64)| Number { start: *v, ..n.clone() };
    let numbers: Vec<Number> = fitted.numbers[own..].iter().zip(&fitted.values[own..]).map(stands).collect();
    let half = Variant {
        candidate: f.candidate,
        changes: f.changes().to_vec(),
        amplitudes: vec![true; numbers.len()],
        score: Score { step: vec![0.0; numbers.len()], ..Score::default() },
        columns,
        numbers,
        blunt: None,
    };
    (from, half)
}

/// Both at once, each along its own step; the score is otherwise the second one's.
fn joined(a: &Variant, b: &Variant) -> Variant {
    Variant {
        candidate: CandidateId::pair(a.candidate, b.candidate),
        changes: [&a.changes[..], &b.changes].concat(),
        columns: [&a.columns[..], &b.columns].concat(),
        amplitudes: [&a.amplitudes[..], &b.amplitudes].concat(),
        numbers: [&a.numbers[..], &b.numbers].concat(),
        blunt: None,
        score: Score { step: [&a.score.step[..], &b.score.step].concat(), ..b.score.clone() },
    }
}

/// The best variants of effects with at most so many numbers, of variants sorted by what they promise.
fn with_at_most(most: usize, variants: &[Variant]) -> Vec<&Variant> {
    let mut all: Vec<&Variant> =
        variants.iter().filter(|v| v.is_certain() && v.blunt.is_none() && v.columns.len() <= most).collect();
    keep_first(&mut all, |v| v.candidate);
    all
}
