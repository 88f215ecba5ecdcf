//! The watchdog technique (Chamberlain, Lemaréchal, Pedersen & Powell, *Math. Programming Study* 16, 1982) for costs that jump.
//!
//! A reading that changes the side of the body it is matched with lets the cost jump. Beside such a wall every step across it is refused, however
//! short, and however much lower the cost is beyond. Then a few steps are taken from the other side. If they lead below the point in front of
//! the wall, the walk goes on there, else it comes back.

use super::Sample;
use crate::settings::Walk;

/// Refusals in a row after which a rise of the cost tells a wall from a bend: steps are less than a third as long by then.
const REFUSALS: u32 = 3;
/// A rise that keeps this share while steps shorten is a jump. Where the cost is smooth it falls with the step at least.
const KEPT: f64 = 0.5;
/// Evaluations beyond a wall: Gauss–Newton halves what is left in one or two, and another wall may take three.
const BEYOND: u32 = 10;

/// Where a walk stands, and how.
#[derive(Clone, Debug)]
pub struct Stand {
    pub z: Vec<f64>,
    pub at: Sample,
    /// Reach, damping, and refusals that changed nothing.
    pub walk: Walk,
}

/// Refusals in a row.
struct Refused {
    /// The first point that was refused, and how the walk stood when it tried.
    there: Stand,
    /// By how much the cost rose there.
    rise: f64,
    times: u32,
}

/// Watches a walk from step to step.
#[derive(Default)]
pub struct Watchdog {
    refused: Option<Refused>,
    /// The lowest point, while the walk is beyond a wall, and evaluations that are left there.
    home: Option<(Stand, u32)>,
    /// True where the other side was looked at already.
    seen: bool,
}

impl Watchdog {
    /// The point that counts: the one before the wall, while the walk is beyond it.
    pub fn counts<'a>(&'a self, stand: &'a Stand) -> &'a Stand {
        self.home.as_ref().map_or(stand, |h| &h.0)
    }

    /// Where to go on after a step that was taken.
    pub fn taken(&mut self, stand: Stand) -> Stand {
        self.refused = None;
        match &self.home {
            Some((home, _)) if stand.at.cost >= home.at.cost => self.spent(stand),
            _ => {
                (self.home, self.seen) = (None, false);
                stand
            }
        }
    }

    /// Where to go on after `trial` was refused. `before` is how the walk stood when it tried; rises below `noise` of the cost come from its
    /// accuracy.
    pub fn refused(&mut self, before: &Walk, stand: Stand, trial: (Vec<f64>, Sample), noise: f64) -> Stand {
        if self.home.is_some() {
            return self.spent(stand);
        }
        let (z, at) = trial;
        let rise = at.cost - stand.at.cost;
        if self.seen || at.failure.is_some() || rise <= noise * stand.at.cost {
            self.refused = None;
            return stand;
        }
        let mut refused = self.refused.take().unwrap_or(Refused { there: Stand { z, at, walk: *before }, rise, times: 0 });
        refused.times += 1;
        if refused.times < REFUSALS || rise < KEPT * refused.rise {
            self.refused = Some(refused);
            return stand;
        }
        self.home = Some((stand, BEYOND));
        refused.there
    }

    /// The point before the wall, if the walk is beyond one; the other side is not looked at again from there.
    pub fn back(&mut self) -> Option<Stand> {
        let (home, _) = self.home.take()?;
        (self.refused, self.seen) = (None, true);
        Some(home)
    }

    /// Counts an evaluation beyond a wall that did not lead below the point before it.
    fn spent(&mut self, stand: Stand) -> Stand {
        match &mut self.home {
            Some((_, left)) if *left > 1 => {
                *left -= 1;
                stand
            }
            _ => self.back().unwrap_or(stand),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Outcome, Search, Status};
    use super::*;
    use crate::settings::Settings;
    use palpate_model::scene::Optimizer;

    /// Gauss–Newton from 0 on (z − 3)², with a wall of this height at 1.
    fn over(wall: f64) -> Outcome {
        let mut evaluate = |z: &[f64]| {
            let r = z[0] - 3.0;
            let cost = r * r + if z[0] > 1.0 { wall } else { 0.0 } + 0.1;
            Ok(Sample { cost, gradient: vec![2.0 * r], curvature: vec![2.0], residuals: 100, ..Sample::default() })
        };
        let mut progress = |_: usize, _: f64, _: &[f64]| {};
        let settings = Settings { max_step: 1.0, ..Settings::new(Optimizer::GaussNewton) };
        Search::new(&mut evaluate, &mut progress, &[-10.0], &[10.0], &settings).run(Optimizer::GaussNewton, &[0.0])
    }

    #[test]
    fn a_walk_goes_over_a_wall_where_the_cost_is_lower_beyond() {
        // In front of the wall the cost is 4.1.
        let beyond = over(3.8);
        assert_eq!(beyond.status, Status::Converged);
        assert!((beyond.z[0] - 3.0).abs() < 1e-2 && beyond.cost < 3.9 + 1e-4, "{beyond:?}");
        // A wall that is no wall takes no detour.
        assert!(over(0.0).evaluations < beyond.evaluations);
    }

    #[test]
    fn a_walk_comes_back_where_it_is_not_and_says_that_it_did_not_converge() {
        let back = over(6.0);
        assert_eq!(back.status, Status::Stalled);
        assert!(back.z[0] <= 1.0 && back.z[0] > 0.99, "{back:?}");
        // What was seen beyond is looked at once from there.
        assert!(back.evaluations < 80, "{}", back.evaluations);
    }

    #[test]
    fn a_rise_that_falls_with_the_step_is_a_bend() {
        let walk = Walk::default();
        let stand = |cost: f64| Stand { z: vec![0.0], at: Sample { cost, ..Sample::default() }, walk };
        let goes_beyond = |rises: [f64; 3]| {
            let mut watchdog = Watchdog::default();
            let mut at = stand(1.0);
            for rise in rises {
                at = watchdog.refused(&walk, at, (vec![1.0], stand(1.0 + rise).at), 1e-5);
            }
            watchdog.home.is_some()
        };
        assert!(goes_beyond([0.5, 0.5, 0.5]) && goes_beyond([0.5, 0.4, 0.3]));
        assert!(!goes_beyond([0.5, 0.25, 0.125]) && !goes_beyond([1e-6, 1e-6, 1e-6]));
    }
}
