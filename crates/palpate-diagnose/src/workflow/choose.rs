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
        let mut able: Vec<usize> = (0..fitted.len()).filter(|i| self.helps(&fitted[*i], before, fitted)).collect();
        let judged = |i: usize| &fitted[i].state.judged;
        // What leaves more than it explains would be taken back in the end: it does not stand before what would stay.
        let stays = |i: &usize| judged(*i).explains(&before.judged);
        if able.iter().any(stays) {
            able.retain(stays);
        }
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

#[cfg(test)]
mod tests {
    use super::super::prune::tests::{Step, left};
    use super::super::{CandidateId, Fitted, State};
    use crate::tests::bench::{Bench, NOISE};

    /// A candidate that is this much better than a state [nats], and would still gain so much were it the whole truth.
    fn candidate(k: usize, before: &State, better: f64, left: f64) -> Fitted {
        let mut state = before.clone();
        state.judged.log_prior += better;
        state.judged.expected += left - state.judged.left();
        let lent = state.judged.clone();
        Fitted {
            candidate: CandidateId::Single(k),
            state,
            lent,
            nats: (better, 0.0),
            gain: 0.5,
            freedom: 1,
            needed: 1,
            effects: 1,
        }
    }

    #[test]
    fn what_would_stay_is_named_before_what_leaves_more_than_it_explains() {
        const STEP: Step = |s, state, _| {
            let named = |of: &[(f64, f64)]| {
                let all: Vec<Fitted> =
                    of.iter().enumerate().map(|(k, (better, left))| candidate(k, &state, *better, *left)).collect();
                s.choose(&state, &all)
            };
            // The first is better, and leaves more than it explains.
            assert_eq!(named(&[(570.0, 825.0), (518.0, 285.0), (517.5, 285.0)]), Some((1, vec![1, 2])));
            // Where none would stay, the best is where the search goes on.
            assert_eq!(named(&[(116.0, 440.0), (68.0, 474.0)]), Some((0, vec![0])));
            assert_eq!(named(&[(-5.0, 0.0)]), None);
            state
        };
        let bias = Bench::first_pattern("depth-bias");
        left(STEP, ["depth-bias", "air-drag"], &[(&bias, 1.5 * NOISE)]);
    }
}
