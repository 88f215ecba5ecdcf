//! Which of the fitted candidates is named, and which others are as good: by the score of [`crate::judgement`] alone.

use super::{Fitted, Session, State};

/// Scores that differ by less [nats] are one: of what predicts the same with as many numbers, the table's order names the plainer cause.
const SAME: f64 = 1.0;

impl Session<'_> {
    /// True if a candidate surely predicts better than the model before, and a pair clearly better than each of its halves.
    pub(super) fn helps(&self, f: &Fitted, before: &State, fitted: &[Fitted]) -> bool {
        let over = |other: &State| f.state.judged.over(&other.judged);
        let halves = fitted.iter().filter(|h| h.effects < f.effects && h.is_within(f));
        over(before).is_sure() && halves.map(|h| over(&h.state)).all(|d| d.is_clear())
    }

    /// The candidate to be named and those that the data cannot tell from it, itself among them. `None` when none helps.
    pub(super) fn choose(&self, before: &State, fitted: &[Fitted]) -> Option<(usize, Vec<usize>)> {
        let able: Vec<usize> = (0..fitted.len()).filter(|i| self.helps(&fitted[*i], before, fitted)).collect();
        let judged = |i: usize| &fitted[i].state.judged;
        let best = able.iter().copied().max_by(|a, b| judged(*a).score().total_cmp(&judged(*b).score()))?;
        let same = |i: &usize| {
            (fitted[*i].needed, fitted[*i].effects) == (fitted[best].needed, fitted[best].effects)
                && judged(best).over(judged(*i)).nats < SAME
        };
        let winner = able.iter().copied().filter(same).min_by_key(|i| fitted[*i].candidate).unwrap_or(best);
        let equal = able.into_iter().filter(|i| judged(*i).over(judged(winner)).is_as_good()).collect();
        Some((winner, equal))
    }
}
