//! How far a fit has come towards convergence, told from how its costs fall. The limit of iterations says nothing of that.

use palpate_fit::{Progress, Tolerance};
use std::collections::BTreeMap;
use std::time::Instant;

/// What the progress of a whole fit is counted in.
pub(crate) const UNITS: u64 = 1000;

/// Share of a start that has not said that it ended.
const ALMOST: f64 = 0.98;

/// How far each start has come.
pub(crate) struct Convergence {
    starts: usize,
    tolerance: f64,
    /// Last cost and share by start.
    known: BTreeMap<usize, (f64, f64)>,
    best: f64,
    iterations: usize,
    begun: Instant,
}

impl Convergence {
    /// Of a fit from so many starts.
    pub fn new(starts: usize) -> Convergence {
        Convergence {
            starts: starts.max(1),
            tolerance: Tolerance::default().cost.clamp(1e-15, 0.1),
            known: BTreeMap::new(),
            best: f64::INFINITY,
            iterations: 0,
            begun: Instant::now(),
        }
    }

    /// Hears of an iteration. A start has come as far as the digits of its cost have: it begins where an iteration changes the cost by itself, and
    /// has arrived where the change is the tolerance.
    pub fn hear(&mut self, p: &Progress) {
        self.best = self.best.min(p.cost);
        self.iterations = self.iterations.max(p.iteration);
        let share = match self.known.get(&p.start) {
            Some((last, share)) => {
                let change = ((last - p.cost) / p.cost.abs().max(f64::MIN_POSITIVE)).clamp(self.tolerance, 1.0);
                share.max((change.ln() / self.tolerance.ln()).min(ALMOST))
            }
            None => 0.0,
        };
        self.known.insert(p.start, (p.cost, share));
    }

    /// How far it is, in [`UNITS`].
    pub fn units(&self) -> u64 {
        let sum: f64 = self.known.values().map(|(_, share)| share).sum();
        (sum / self.starts as f64 * UNITS as f64) as u64
    }

    /// The same in words.
    pub fn text(&self) -> String {
        let starts = if self.starts == 1 { String::new() } else { format!(", {} of {} starts", self.known.len(), self.starts) };
        // Until convergence takes as long again as what is left of the way: a guess, since costs fall faster near the end.
        let (share, passed) = (self.units() as f64 / UNITS as f64, self.begun.elapsed().as_secs_f64());
        let left = if share > 0.05 && passed > 2.0 {
            format!(", about {:.0} s left", passed * (1.0 / share - 1.0))
        } else {
            String::new()
        };
        format!("to convergence: iteration {}{starts}, best cost {:.4}{left}", self.iterations, self.best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_that_converges_in_few_iterations_is_far_before_its_limit() {
        let mut c = Convergence::new(1);
        let mut seen = Vec::new();
        // Quadratic convergence: the distance from a cost of 1 is squared in every iteration.
        for (iteration, cost) in [11.0, 2.0, 1.1, 1.001, 1.000_000_1, 1.000_000_1].into_iter().enumerate() {
            c.hear(&Progress { start: 0, iteration, cost, values: Vec::new() });
            seen.push(c.units());
        }
        assert!(seen.windows(2).all(|w| w[0] <= w[1]), "{seen:?}");
        assert!(seen[0] == 0 && seen[3] > 50 && seen[5] == 980, "{seen:?}");
        // A second start that has not begun is half of the way.
        let mut two = Convergence::new(2);
        two.known = c.known.clone();
        assert_eq!(two.units(), 490);
        assert!(two.text().contains("1 of 2 starts"));
    }
}
