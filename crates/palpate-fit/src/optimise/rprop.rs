//! Rprop: steps from the signs of the gradient only (Riedmiller & Braun 1993), in the variant iRprop⁻ that forgets a
//! derivative whose sign has just changed (Igel & Hüsken 2003, algorithm 4).

use super::{Sample, Search, Status, Stop};
use crate::dense::max_abs;

/// Iterations without a better cost, with short steps, after which a run has converged.
const PATIENCE: usize = 10;
/// Short in that sense, in z.
const SHORT: f64 = 1e-3;

pub fn minimise(search: &mut Search, mut z: Vec<f64>, mut at: Sample) -> Result<Status, Stop> {
    let q = z.len();
    let rule = search.settings.rprop.clone();
    let tolerance = search.settings.tolerance.clone();
    let largest = rule.max.min(search.settings.max_step);
    let mut steps = vec![rule.initial.min(largest); q];
    let mut before = vec![0.0; q];
    let mut reference = at.cost;
    let mut idle = 0;
    loop {
        if search.is_flat(&z, &at) {
            return Ok(Status::Converged);
        }
        if search.out_of_iterations() {
            return Ok(Status::IterationLimit);
        }
        let mut g = search.projected_gradient(&z, &at.gradient);
        for i in 0..q {
            let agreement = g[i] * before[i];
            if agreement > 0.0 {
                steps[i] = (steps[i] * rule.growth).min(largest);
            } else if agreement < 0.0 {
                steps[i] = (steps[i] * rule.shrink).max(rule.min);
                g[i] = 0.0;
            }
        }
        let moved = |steps: &[f64]| -> Vec<f64> {
            (0..q).map(|i| if g[i] == 0.0 { z[i] } else { z[i] - g[i].signum() * steps[i] }).collect()
        };
        let mut next = search.project(&moved(&steps));
        let mut trial = search.evaluate(&next)?;
        while trial.failure.is_some() && max_abs(&steps) > rule.min {
            // A point without a cost has no gradient to turn back on: halve all steps until the model holds again.
            steps.iter_mut().for_each(|s| *s = (*s * rule.shrink).max(rule.min));
            next = search.project(&moved(&steps));
            trial = search.evaluate(&next)?;
        }
        if trial.failure.is_some() {
            return Ok(Status::Stalled);
        }
        z = next;
        at = trial;
        before = g;
        search.iterated(at.cost, &z);
        if max_abs(&steps) <= rule.min {
            return Ok(Status::Converged);
        }
        if at.cost < reference * (1.0 - tolerance.cost) {
            reference = at.cost;
            idle = 0;
        } else {
            idle += 1;
            if idle >= PATIENCE && max_abs(&steps) < SHORT {
                return Ok(Status::Converged);
            }
        }
    }
}
