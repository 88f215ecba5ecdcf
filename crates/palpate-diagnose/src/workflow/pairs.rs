//! Two plain effects at once as one candidate: what a freer one follows, because with enough numbers anything is followed, may be two plain
//! ones, neither of which explains much by itself.

use super::variants::Variant;
use super::{Fitted, Session, State, keep_first};
use crate::laboratory::{LabError, Model};
use crate::linear::dot;

/// Most numbers of an effect of a pair.
const PLAIN: usize = 3;
/// Pairs of so many numbers in all are ranked on their own: those with more always promise more.
const CLASSES: [std::ops::RangeInclusive<usize>; 3] = [2..=2, 3..=3, 4..=2 * PLAIN];
/// Pairs of a class, and partners of a fitted effect, that are fitted.
const EACH: usize = 2;
/// Fitted effects that partners are looked for.
const HALVES: usize = 3;
/// Share of the sum of squares that a pair must promise to take away, and how much of it beyond what its better half does alone.
const PROMISE: (f64, f64) = (0.8, 0.05);
/// Number of the first pair in the table of candidates; single ones come before.
const FIRST: usize = 1 << 20;

impl Session<'_> {
    /// Pairs of plain effects with fewer than so many numbers that are worth a fit, each with the state that it starts from.
    pub(super) fn pairs(
        &mut self,
        state: &State,
        fitted: &[Fitted],
        variants: &[Variant],
        fewer_than: usize,
    ) -> Result<Vec<(State, Variant)>, LabError> {
        // The smallest pair has two.
        if fewer_than <= 2 {
            return Ok(Vec::new());
        }
        let plain = plain(variants);
        let mut out = self.partners(state, fitted, &plain, fewer_than)?;
        out.extend(self.promising(state, &plain, fewer_than).into_iter().map(|v| (state.clone(), v)));
        keep_first(&mut out, |(_, v)| v.candidate);
        Ok(out)
    }

    /// Those that promise most together where both are absent.
    fn promising(&self, state: &State, plain: &[&Variant], fewer_than: usize) -> Vec<Variant> {
        let mut out: Vec<Variant> = Vec::new();
        for class in CLASSES {
            let mut these: Vec<Variant> = Vec::new();
            for (i, a) in plain.iter().enumerate() {
                for b in &plain[i + 1..] {
                    let numbers = a.columns.len() + b.columns.len();
                    if class.contains(&numbers) && numbers < fewer_than {
                        let both = self.both(state, a, b);
                        let share = both.score.share;
                        these.extend((share >= PROMISE.0 && share >= a.score.share + PROMISE.1).then_some(both));
                    }
                }
            }
            these.sort_by(|a, b| b.score.gain.total_cmp(&a.score.gain));
            these.truncate(EACH);
            out.extend(these);
        }
        out
    }

    /// Partners of the plain effects that were fitted, the best of those first: an effect that is there already shows better what lacks
    /// beside it.
    fn partners(
        &mut self,
        state: &State,
        fitted: &[Fitted],
        plain: &[&Variant],
        fewer_than: usize,
    ) -> Result<Vec<(State, Variant)>, LabError> {
        let own = state.model.values.len();
        let mut out: Vec<(State, Variant)> = Vec::new();
        for f in fitted.iter().filter(|f| f.effects == 1 && plain.iter().any(|v| v.candidate == f.candidate)).take(HALVES) {
            let fits = |v: &&&Variant| v.candidate != f.candidate && v.columns.len() + f.freedom < fewer_than;
            let wanted = plain.iter().filter(fits).map(|v| (true, v.candidate, v.changes[0].clone())).collect();
            let mut seconds = self.scored(&f.state, wanted)?;
            seconds.sort_by(|a, b| b.score.gain.total_cmp(&a.score.gain));
            seconds.truncate(EACH);
            seconds.retain(|v| squares(&f.state) - v.score.gain <= (1.0 - PROMISE.0) * squares(state));
            let values = f.state.model.values[..own].to_vec();
            let mut from = f.state.clone();
            from.model = Model { values, ..state.model.clone() };
            let columns = from.table.columns.split_off(own);
            for b in seconds {
                let mut step = vec![0.0; columns.len()];
                step.extend_from_slice(&b.score.step);
                let bounds = f.state.model.numbers[own..].iter().zip(&f.state.model.values[own..]);
                let pair = Variant {
                    candidate: number(f.candidate, b.candidate),
                    changes: [f.changes(), &b.changes].concat(),
                    columns: [&columns[..], &b.columns].concat(),
                    amplitudes: vec![true; step.len()],
                    start: [&f.state.model.values[own..], &b.start].concat(),
                    bounds: bounds.map(|(n, v)| (n.bounds.0 - v, n.bounds.1 - v)).chain(b.bounds).collect(),
                    score: crate::score::Score { step, ..b.score },
                };
                out.push((from.clone(), pair));
            }
        }
        Ok(out)
    }

    /// Both at once, where both are absent.
    fn both(&self, state: &State, a: &Variant, b: &Variant) -> Variant {
        let mut pair = Variant {
            candidate: number(a.candidate, b.candidate),
            changes: [&a.changes[..], &b.changes].concat(),
            columns: [&a.columns[..], &b.columns].concat(),
            amplitudes: [&a.amplitudes[..], &b.amplitudes].concat(),
            start: [&a.start[..], &b.start].concat(),
            bounds: [&a.bounds[..], &b.bounds].concat(),
            score: Default::default(),
        };
        pair.score = self.score(state, &pair);
        pair
    }
}

/// Sum of squares that a model leaves, but for what its free numbers and the discretisation explain.
fn squares(state: &State) -> f64 {
    let left = state.frame.left();
    dot(&left, &left)
}

/// The best variants of plain effects, the most promising first.
fn plain(variants: &[Variant]) -> Vec<&Variant> {
    let mut plain: Vec<&Variant> =
        variants.iter().filter(|v| v.is_certain() && v.blunt().is_none() && v.columns.len() <= PLAIN).collect();
    plain.sort_by(|a, b| b.score.gain.total_cmp(&a.score.gain));
    keep_first(&mut plain, |v| v.candidate);
    plain
}

/// Number of a pair in the table of candidates, whichever of the two came first.
fn number(a: usize, b: usize) -> usize {
    FIRST + 1000 * a.min(b) + a.max(b)
}
