//! The rule: which of two models predicts better, and whether that is clear.
//!
//! ```text
//! something may be missing in M S(M⁺) > S(M°), or three standard deviations from what is known: reason to search
//! something is missing in M     S(M⁺) > S(M°), by more than three standard errors, or the same deviations
//! an effect helps               S(M_j⁺) > S(M₀⁺), by more than three standard errors of elpd(M_j⁺) − elpd(M₀⁺)
//! the one that is named         the largest S(M_j⁺) of those that help, of those that stay if any do, where something may be missing in M₀
//! as good as that               S lower by no more than two standard errors, or than ln O
//! an effect stays               S(M_j⁺) − S(M₀⁺) > S*(M_j) − S(M_j⁺): it explains more than it leaves
//! an explanation                effects that stay, and beside which nothing is missing
//!
//! S* is what the model would score in the mean, were it the whole truth.
//! ```

use super::prior::Prior;

/// Standard errors of a difference between two models from which on it is clear.
const CLEAR: f64 = 2.0;

/// Standard errors, or standard deviations from what is known beforehand, from which on a scene is said to be wrong. Of fifty candidates the
/// luckiest is two ahead by chance; three one in fifteen times.
const SURE: f64 = 3.0;

/// What a model predicts of every block that was left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judged {
    /// ln p of every block, the model being the whole truth.
    pub alone: Vec<f64>,
    /// Mean of these over recordings of that truth, of all blocks together.
    pub expected: f64,
    /// ln p of every block beside a discrepancy of mixed size.
    pub beside: Vec<f64>,
    /// ln p of the model.
    pub log_prior: f64,
    /// What the discrepancy costs, which is one thing more with one number, its size [nats].
    pub price: f64,
    /// Standard deviations by which readings contradict most what is known beforehand of numbers, or of errors of grid and step.
    pub conflict: f64,
}

/// How much better one model predicts than another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Difference of the scores [nats].
    pub nats: f64,
    /// Standard error of the part that data decide [nats].
    pub error: f64,
}

impl Difference {
    /// Difference and standard error.
    pub fn parts(self) -> (f64, f64) {
        (self.nats, self.error)
    }

    /// True if the first is better beyond what chance among blocks may do.
    pub fn is_clear(self) -> bool {
        self.nats > 0.0 && self.nats > CLEAR * self.error
    }

    /// True if the first is better beyond what chance among blocks does even for the luckiest of many.
    pub fn is_sure(self) -> bool {
        self.nats > 0.0 && self.nats > SURE * self.error
    }

    /// True if the first is better, or no worse than chance, or than what one thing more costs, allows.
    pub fn is_as_good(self) -> bool {
        -self.nats <= (CLEAR * self.error).max(Prior::odds())
    }
}

/// Σ (a − b) over blocks and its standard error, blocks being independent (Vehtari, Gelman & Gabry, *Stat. Comput.* 27, 2017, eq. 24).
fn difference(a: &[f64], b: &[f64]) -> Difference {
    let each: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let n = each.len() as f64;
    let nats: f64 = each.iter().sum();
    let variance = each.iter().map(|d| (d - nats / n).powi(2)).sum::<f64>() * n / (n - 1.0).max(1.0);
    Difference { nats, error: variance.sqrt() }
}

impl Judged {
    /// ln p of every block as the better of both ways says it, and the score.
    fn best(&self) -> (&[f64], f64) {
        let (alone, beside) = (self.alone.iter().sum::<f64>(), self.beside.iter().sum::<f64>() - self.price);
        if beside > alone { (&self.beside, beside + self.log_prior) } else { (&self.alone, alone + self.log_prior) }
    }

    /// S(M⁺), where it is better, or S(M°).
    pub fn score(&self) -> f64 {
        self.best().1
    }

    /// S(M⁺) − S(M°): positive where something is missing.
    pub fn missing(&self) -> Difference {
        let d = difference(&self.beside, &self.alone);
        Difference { nats: d.nats - self.price, ..d }
    }

    /// True where something may be missing: a discrepancy predicts better, or readings contradict what is known beforehand. What is
    /// missing must not hide behind an error of the grid that would have to be many times what finer cells show.
    pub fn may_be_missing(&self) -> bool {
        self.missing().nats > 0.0 || self.conflict > SURE
    }

    /// True where something is missing, beyond what a few blocks do by chance.
    pub fn is_missing(&self) -> bool {
        self.missing().is_sure() || self.conflict > SURE
    }

    /// What is said where something may be missing and nothing surely is.
    pub fn chance(&self) -> Option<String> {
        let Difference { nats, error } = self.missing();
        let said = || {
            format!(
                "A discrepancy would predict better by {nats:.0} ± {error:.0} nats, which {SURE} standard errors of chance can do."
            )
        };
        (self.may_be_missing() && !self.is_missing()).then(said)
    }

    /// By how much this model predicts better than another.
    pub fn over(&self, other: &Judged) -> Difference {
        let ((mine, score), (theirs, against)) = (self.best(), other.best());
        Difference { nats: score - against, ..difference(mine, theirs) }
    }

    /// What would be gained by whatever is missing beside this model: S* − S, of a right model near zero [nats].
    pub fn left(&self) -> f64 {
        self.expected + self.log_prior - self.score()
    }

    /// True if this model explains more of what another lacks than it leaves.
    pub fn explains(&self, other: &Judged) -> bool {
        self.over(other).nats > self.left()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(alone: &[f64], beside: &[f64], log_prior: f64) -> Judged {
        let expected = -(alone.len() as f64);
        Judged { alone: alone.to_vec(), expected, beside: beside.to_vec(), log_prior, price: Prior::odds(), conflict: 0.0 }
    }

    #[test]
    fn a_difference_has_the_spread_of_its_blocks_as_error() {
        let d = difference(&[1.0, 2.0, 4.0], &[0.0, 1.0, 0.0]);
        // Differences 1, 1, 4: mean 2, variance 3, of the sum three times that.
        assert!((d.nats - 6.0).abs() < 1e-12 && (d.error - 3.0).abs() < 1e-12, "{d:?}");
        assert!(!d.is_clear() && Difference { nats: 6.1, error: 3.0 }.is_clear());
        assert!(!Difference { nats: 8.9, error: 3.0 }.is_sure() && Difference { nats: 9.1, error: 3.0 }.is_sure());
        assert!(Difference { nats: -5.9, error: 3.0 }.is_as_good() && !Difference { nats: -6.1, error: 3.0 }.is_as_good());
    }

    #[test]
    fn a_model_is_judged_by_the_better_of_both_ways_and_pays_for_a_discrepancy() {
        let odds = Prior::odds();
        let right = judged(&[-1.0; 10], &[-1.1; 10], 0.0);
        let wrong = judged(&[-9.0; 10], &[-2.0; 10], 0.0);
        assert!(right.missing().nats < 0.0 && wrong.missing().nats > 0.0);
        assert!((right.over(&wrong).nats - (10.0 + odds)).abs() < 1e-12);
        // Of what a recording of the truth would score, −1 a block, the first leaves ½ and its price, and gains 1.5; the second the other way round.
        let (most, some) = (judged(&[-9.0; 10], &[-1.5; 10], -1.0), judged(&[-9.0; 10], &[-2.5; 10], -1.0));
        let far = judged(&[-9.0; 10], &[-3.0; 10], 0.0);
        assert!(most.over(&far).is_clear() && most.explains(&far));
        assert!(some.over(&far).is_clear() && !some.explains(&far));
    }

    #[test]
    fn one_block_that_is_not_met_is_reason_to_search_and_not_to_say_that_something_is_missing() {
        let one = |y: f64, far: usize| (0..50).map(|b| if b < far { y } else { -1.0 }).collect::<Vec<f64>>();
        let lucky = judged(&one(-40.0, 1), &one(-5.0, 1), 0.0);
        assert!(lucky.may_be_missing() && !lucky.is_missing());
        assert!(lucky.chance().is_some_and(|said| said.contains("32 ± 35 nats")), "{:?}", lucky.chance());
        let many = judged(&one(-40.0, 12), &one(-5.0, 12), 0.0);
        assert!(many.is_missing() && many.chance().is_none());
        // What is known beforehand is contradicted by one reading as well.
        assert!(Judged { conflict: 3.1, ..lucky }.is_missing());
    }
}
