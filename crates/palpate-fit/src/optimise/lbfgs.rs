//! Limited-memory BFGS in a box (two-loop recursion: Nocedal & Wright, Numerical Optimization, 2nd ed., algorithm 7.4,
//! on the variables that no bound holds; Bertsekas 1982 for why the held ones must stay out of it).
//!
//! Own code rather than that of a crate: those looked at have no bounds, their Moré–Thuente search ends the run with an error as
//! soon as a trial cost is infinite (a failed simulation), and they keep curvature pairs that are not positive.

use super::{Sample, Search, Status, Stop, line};
use crate::dense::{dot, max_abs};
use std::collections::VecDeque;

/// Curvature pairs kept where parameters are few, and of fields: beside a simulation the recursion costs nothing.
const MEMORY: [usize; 2] = [8, 40];
/// So many parameters are few.
const FEW: usize = 256;
/// First step in z, before any curvature is known.
const FIRST: f64 = 0.3;

pub fn minimise(search: &mut Search, mut z: Vec<f64>, mut at: Sample) -> Result<Status, Stop> {
    let (q, tolerance) = (z.len(), search.settings.tolerance.decrement);
    let mut pairs: VecDeque<(Vec<f64>, Vec<f64>)> = VecDeque::new();
    loop {
        if search.is_flat(&z, &at) {
            return Ok(Status::Converged);
        }
        if search.out_of_iterations() {
            return Ok(Status::IterationLimit);
        }
        let g = search.projected_gradient(&z, &at.gradient);
        let mut d = direction(&g, &pairs);
        if dot(&d, &g) >= 0.0 {
            pairs.clear();
            d = direction(&g, &pairs);
        }
        // What the quadratic model of a whole memory promises, ½ gᵀHg.
        if pairs.len() >= q.min(MEMORY[usize::from(q > FEW)]) && search.decrement(&at, -0.5 * dot(&d, &g)) <= tolerance {
            return Ok(Status::Converged);
        }
        let limit = if pairs.is_empty() { FIRST } else { search.settings.max_step };
        let shorten = (limit / max_abs(&d)).min(1.0);
        d.iter_mut().for_each(|x| *x *= shorten);
        let (next, trial) = match line::backtrack(search, &z, &at, &d, at.cost)? {
            Ok(step) => step,
            Err(Status::Stalled) if !pairs.is_empty() => {
                // The memory misleads: once more along the gradient.
                pairs.clear();
                continue;
            }
            Err(status) => return Ok(status),
        };
        let s: Vec<f64> = (0..q).map(|i| next[i] - z[i]).collect();
        let y: Vec<f64> = (0..q).map(|i| trial.gradient[i] - at.gradient[i]).collect();
        let gained = at.cost - trial.cost;
        if dot(&s, &y) > 1e-12 * dot(&s, &s).sqrt() * dot(&y, &y).sqrt() {
            pairs.push_back((s.clone(), y));
            if pairs.len() > MEMORY[usize::from(q > FEW)] {
                pairs.pop_front();
            }
        }
        z = next;
        at = trial;
        search.iterated(at.cost, &z);
        if max_abs(&s) <= search.settings.tolerance.step || gained <= search.settings.tolerance.cost * at.cost {
            return Ok(Status::Converged);
        }
    }
}

/// `−H g` on the variables with `g ≠ 0`; `−g` scaled to length [`FIRST`] without memory.
fn direction(g: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>)>) -> Vec<f64> {
    let free: Vec<f64> = g.iter().map(|&x| if x == 0.0 { 0.0 } else { 1.0 }).collect();
    let inner = |a: &[f64], b: &[f64]| -> f64 { (0..a.len()).map(|i| free[i] * a[i] * b[i]).sum() };
    let pairs: Vec<_> = pairs.iter().filter(|(s, y)| inner(s, y) > 0.0).collect();
    let Some((s, y)) = pairs.last() else {
        let scale = FIRST / max_abs(g).max(f64::MIN_POSITIVE);
        return g.iter().map(|x| -scale * x).collect();
    };
    let gamma = inner(s, y) / inner(y, y);
    let mut r = g.to_vec();
    let mut weights = Vec::new();
    for (s, y) in pairs.iter().rev() {
        let a = inner(s, &r) / inner(s, y);
        r.iter_mut().zip(y).for_each(|(r, y)| *r -= a * y);
        weights.push(a);
    }
    r.iter_mut().for_each(|r| *r *= gamma);
    for ((s, y), a) in pairs.iter().zip(weights.iter().rev()) {
        let b = inner(y, &r) / inner(s, y);
        r.iter_mut().zip(s).for_each(|(r, s)| *r += (a - b) * s);
    }
    r.iter().zip(&free).map(|(r, f)| -r * f).collect()
}
