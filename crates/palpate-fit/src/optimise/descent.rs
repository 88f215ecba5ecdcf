//! Gradient descent with Barzilai–Borwein steps and a nonmonotone safeguard: the spectral projected gradient method
//! (Birgin, Martínez & Raydan 2000, algorithm 2.2).

use super::{Sample, Search, Status, Stop, line};
use crate::dense::{dot, max_abs};
use std::collections::VecDeque;

/// A step must improve on the worst of so many costs.
const MEMORY: usize = 8;
/// First step in z.
const FIRST: f64 = 0.3;

pub fn minimise(search: &mut Search, mut z: Vec<f64>, mut at: Sample) -> Result<Status, Stop> {
    loop {
        let (status, cost) = descend(search, z, at)?;
        let Some((best, Sample { cost: best_cost, .. })) = search.best.clone() else { return Ok(status) };
        if !matches!(status, Status::Converged | Status::Stalled) || best_cost >= cost {
            return Ok(status);
        }
        // Costs may rise on the way, and the path ended in a worse place: once more from the best point. Costs never exceed
        // the one a descent begins with, so that each ends lower than the one before.
        at = search.evaluate(&best)?;
        z = best;
    }
}

/// Descends until a criterion is met. Returns the last cost too.
fn descend(search: &mut Search, mut z: Vec<f64>, mut at: Sample) -> Result<(Status, f64), Stop> {
    let q = z.len();
    let mut recent = VecDeque::from([at.cost]);
    let mut length = FIRST / max_abs(&search.projected_gradient(&z, &at.gradient)).max(f64::MIN_POSITIVE);
    loop {
        if search.is_flat(&z, &at) {
            return Ok((Status::Converged, at.cost));
        }
        if search.out_of_iterations() {
            return Ok((Status::IterationLimit, at.cost));
        }
        let g = search.projected_gradient(&z, &at.gradient);
        length = length.min(search.settings.max_step / max_abs(&g));
        let target = search.project(&(0..q).map(|i| z[i] - length * g[i]).collect::<Vec<_>>());
        let d: Vec<f64> = (0..q).map(|i| target[i] - z[i]).collect();
        let ceiling = recent.iter().fold(f64::NEG_INFINITY, |m, &c| m.max(c));
        let (next, trial) = match line::backtrack(search, &z, &at, &d, ceiling)? {
            Ok(step) => step,
            Err(status) => return Ok((status, at.cost)),
        };
        let s: Vec<f64> = (0..q).map(|i| next[i] - z[i]).collect();
        let y: Vec<f64> = (0..q).map(|i| trial.gradient[i] - at.gradient[i]).collect();
        let (ss, sy) = (dot(&s, &s), dot(&s, &y));
        // Along a concave stretch there is no quadratic to fit: go further.
        length = if sy > 0.0 { ss / sy } else { 4.0 * length };
        z = next;
        at = trial;
        recent.push_back(at.cost);
        if recent.len() > MEMORY {
            recent.pop_front();
        }
        search.iterated(at.cost, &z);
        // Costs may rise for a while, so only a whole memory of equal ones means that nothing is left to gain.
        let (best, worst) = recent.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), &c| (a.min(c), b.max(c)));
        let level = recent.len() == MEMORY && worst - best <= search.settings.tolerance.cost * best;
        if max_abs(&s) <= search.settings.tolerance.step || level {
            return Ok((Status::Converged, at.cost));
        }
    }
}
