//! Which of the fitted candidates is named, and which others are as good.

use super::{Fitted, Session, State, met};
use crate::crossval::{Predicted, worse_by};

/// The share of the gap that one more number must close to be worth it; candidates that differ by less than twice as much count as equal.
const PRICE: f64 = 5e-5;
/// The same where no candidate explains the recording.
const PRICE_OF_MISFIT: f64 = 5e-3;
/// How many times what noise and discretisation explain the best candidate may leave to be an explanation.
const MISFIT: f64 = 3.0;

/// What a number must gain to be worth it, between a model `best` and one without it that leaves `whole`: what it gains by chance (Schwarz,
/// Ann. Stat. 6, 1978; in units of what the best leaves), and a share of the gap, because a freer effect also fits what no model gets right.
pub(super) fn price(readings: usize, best: &Predicted, whole: &Predicted) -> f64 {
    (misfit(best).max(1.0) * (readings.max(1) as f64).ln()).max(share(best, whole))
}

/// What the best leaves, over what noise and discretisation explain.
fn misfit(best: &Predicted) -> f64 {
    best.loss() / best.floor.max(1.0)
}

/// The least part of the gap that counts. Where even the best leaves much more than noise, something else is wrong as well, and small
/// shares decide nothing.
fn share(best: &Predicted, whole: &Predicted) -> f64 {
    whole.excess() * if misfit(best) <= MISFIT { PRICE } else { PRICE_OF_MISFIT }
}

impl Session<'_> {
    /// True if each effect of a pair closes as much of the gap that the other one leaves as an effect that is added later must.
    fn both_help(&self, pair: &Fitted, fitted: &[Fitted]) -> bool {
        let half = |f: &&Fitted| f.effects < pair.effects && f.is_within(pair);
        fitted.iter().filter(half).all(|f| self.gain(&f.state, &pair.state) >= self.options.least_gain)
    }

    /// The candidate to be named and those that the data cannot tell from the best, itself among them; candidates come best prediction
    /// first. `None` when none passes.
    pub(super) fn choose(&self, state: &State, fitted: &[Fitted], count: f64) -> Option<(usize, Vec<usize>)> {
        let (significance, least) = (self.options.significance, self.options.least_gain);
        let pass = |f: &Fitted| f.p_value < significance && f.gain >= least && self.both_help(f, fitted);
        let passing: Vec<bool> = fitted.iter().map(pass).collect();
        let passes = |i: usize| passing[i];
        let best = (0..fitted.len()).find(|i| passes(*i))?;
        let predicted = |i: usize| -> &Predicted { &fitted[i].state.predicted[0] };
        let share = share(predicted(best), &state.predicted[0]);
        // Frames that follow each other are not independent: a clear misfit that the best does not have is no matter of chance.
        let as_close = |i: usize, to: usize| predicted(i).excess() < 2.0 * predicted(to).excess() + 0.5 * predicted(to).floor;
        // Fewer numbers that follow the readings more closely are no worse, whatever the grid's error does to the prediction of either.
        let cost = |i: usize| fitted[i].state.readings.cost;
        let fits_better = |i: usize, to: usize| fitted[i].needed < fitted[to].needed && cost(i) <= cost(to);
        let small = PRICE_OF_MISFIT * state.predicted[0].excess();
        let as_good = |i: usize, to: usize| {
            let (by, z) = worse_by(&self.cells, predicted(to), predicted(i));
            passes(i) && (by < 2.0 * share || (z < 2.0 && as_close(i, to)) || (fits_better(i, to) && by < small))
        };
        // Every number has its price.
        let price = price(met(&state.readings), predicted(best), &state.predicted[0]);
        // A second effect is chosen from as many as the first (Chen & Chen, Biometrika 95, 2008).
        let choice = 2.0 * count.max(1.0).ln() * misfit(predicted(best)).max(1.0);
        let worth =
            |i: &usize| predicted(*i).loss() + price * fitted[*i].needed as f64 + choice * (fitted[*i].effects - 1) as f64;
        let able = (0..fitted.len()).filter(|i| passes(*i));
        let leader = able.clone().min_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap_or(best);
        // Of what the data cannot tell from that, the plainest (Breiman et al., Classification and Regression Trees, 1984: one standard error).
        let plainer = |i: &usize| {
            fitted[*i].effects <= fitted[leader].effects
                && fitted[*i].needed < fitted[leader].needed
                && as_good(*i, leader)
                && as_good(*i, best)
        };
        let by_freedom = |a: &usize, b: &usize| fitted[*a].needed.cmp(&fitted[*b].needed).then(worth(a).total_cmp(&worth(b)));
        let first = able.clone().filter(plainer).min_by(by_freedom).unwrap_or(leader);
        // What predicts the same with as many numbers is named in the table's order: the plainer cause first.
        let like_first = |i: &usize| {
            (fitted[*i].needed, fitted[*i].effects) == (fitted[first].needed, fitted[first].effects)
                && predicted(*i).loss() - predicted(first).loss() < 2.0 * share
        };
        let winner = able.filter(like_first).min_by_key(|i| fitted[*i].candidate).unwrap_or(first);
        // Of what is as good as the best, or as what is named.
        let equal = (0..fitted.len()).filter(|i| as_good(*i, best) || as_good(*i, winner)).collect();
        Some((winner, equal))
    }
}
