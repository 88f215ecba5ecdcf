//! Backtracking along a direction.

use super::{Sample, Search, Status, Stop};
use crate::dense::dot;

/// Share of the promised decrease that must be met (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Shortest try, relative to the first.
const SHORTEST: f64 = 1e-8;
/// A promised decrease below this share of the cost drowns in the accuracy of a simulation.
const COST_NOISE: f64 = 1e-7;

/// First point `z + t d`, t = 1 or shorter, whose cost lies sufficiently below `ceiling`. Failed points shorten t by 4,
/// others by the minimiser of the parabola through both costs and the slope. The inner error is the status of a search that
/// found none: converged if no measurable decrease was in sight, else stalled.
pub fn backtrack(
    search: &mut Search,
    z: &[f64],
    at: &Sample,
    d: &[f64],
    ceiling: f64,
) -> Result<Result<(Vec<f64>, Sample), Status>, Stop> {
    let slope = dot(&at.gradient, d);
    let mut t = 1.0;
    while t >= SHORTEST {
        let next = search.project(&z.iter().zip(d).map(|(z, d)| z + t * d).collect::<Vec<_>>());
        if next == z {
            break;
        }
        let trial = search.evaluate(&next)?;
        if trial.cost <= ceiling + SUFFICIENT * t * slope {
            return Ok(Ok((next, trial)));
        }
        t *= if trial.failure.is_some() {
            0.25
        } else {
            let parabola = -slope * t / (2.0 * (trial.cost - at.cost - slope * t));
            if parabola.is_finite() { parabola.clamp(0.1, 0.5) } else { 0.5 }
        };
    }
    let hopeless = -slope <= COST_NOISE * at.cost;
    Ok(Err(if hopeless { Status::Converged } else { Status::Stalled }))
}
