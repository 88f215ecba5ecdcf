//! What a candidate could explain, from sensitivities where it is absent: a generalised score.
//!
//! With the fitted numbers and the discretisation projected out of residuals y and of the candidate's columns C, the sum of squares falls by
//! |P_C y|² when the candidate's amplitudes are set free (Rao, *Proc. Camb. Phil. Soc.* 44, 1948, for small changes).

use crate::linear::{Basis, dot, least_squares, least_squares_in};
use crate::null::Frame;

/// Ridge on columns of unit length: directions that the fitted numbers absorb up to a thousandth are not told apart from them.
const RIDGE: f64 = 1e-6;

/// Ridges of the step from which a fit starts, the shortest step first.
const STEP_RIDGES: [f64; 6] = [0.3, 0.1, 0.03, 0.01, 1e-3, RIDGE];
/// The shortest step with this share of the whole gain is taken: what gains little more may lead far away, where nothing is linear.
const STEP_GAIN: f64 = 0.9;

/// A candidate's score.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Decrease of the sum of squares.
    pub gain: f64,
    /// The same over the whole sum of squares.
    pub share: f64,
    /// Free amplitudes that it takes.
    pub freedom: usize,
    /// Best change of each number `[columns]`.
    pub step: Vec<f64>,
}

/// Scores columns `[k][m + fields]` whose changes must stay within `bounds` (smallest and largest change). Those of one of the `groups` `[k]` are
/// held back alike: a component that does next to nothing would else be taken far.
pub fn score(frame: &Frame, columns: &[Vec<f64>], bounds: &[(f64, f64)], groups: &[String]) -> Score {
    let y = frame.left();
    let total = dot(&y, &y);
    let bent: Vec<Vec<f64>> = columns.iter().map(|c| frame.absorbed.without(c)).collect();
    // A column that the fitted numbers absorb up to rounding says nothing of its own.
    let own = |k: usize| dot(&bent[k], &bent[k]) > 1e-8 * dot(&columns[k], &columns[k]);
    let mut active: Vec<usize> = (0..columns.len()).filter(|k| own(*k)).collect();
    let lengths: Vec<f64> = bent.iter().map(|b| dot(b, b).sqrt()).collect();
    let size = |k: usize| lengths.iter().zip(groups).filter(|(_, g)| **g == groups[k]).map(|(l, _)| *l).fold(0.0, f64::max);
    let mut out = Score { step: vec![0.0; columns.len()], ..Score::default() };
    // Residuals with the changes that reached a bound.
    let mut y = y;
    let mut held = Vec::new();
    loop {
        let chosen: Vec<&[f64]> = active.iter().map(|k| bent[*k].as_slice()).collect();
        let solve = |ridge: f64| if chosen.is_empty() { Some(Vec::new()) } else { least_squares(&chosen, &y, ridge) };
        let Some(x) = solve(RIDGE) else { return out };
        // A change beyond its bound stays there, and the others are fitted again.
        let outside = |i: usize| x[i] < bounds[active[i]].0 || x[i] > bounds[active[i]].1;
        if let Some(worst) = (0..active.len()).find(|i| outside(*i)) {
            let k = active.remove(worst);
            let at = x[worst].clamp(bounds[k].0, bounds[k].1);
            out.step[k] = at;
            y.iter_mut().zip(&bent[k]).for_each(|(y, c)| *y += at * c);
            held.extend((at != 0.0).then_some(k));
            continue;
        }
        let remains = |x: &[f64]| {
            let mut left = y.clone();
            x.iter().zip(&chosen).for_each(|(x, c)| left.iter_mut().zip(*c).for_each(|(l, c)| *l += x * c));
            dot(&left, &left)
        };
        out.gain = (total - remains(&x)).max(0.0);
        let near = |s: &Vec<f64>| total - remains(s) >= STEP_GAIN * out.gain;
        let sizes: Vec<f64> = active.iter().map(|k| size(*k)).collect();
        let short = |ridge: &f64| least_squares_in(&chosen, &y, *ridge, &sizes);
        let inside = |s: &Vec<f64>| active.iter().zip(s).all(|(k, x)| (bounds[*k].0..=bounds[*k].1).contains(x));
        let start = STEP_RIDGES.iter().filter_map(short).find(|s| near(s) && inside(s)).unwrap_or(x);
        active.iter().zip(&start).for_each(|(k, x)| out.step[*k] = *x);
        out.freedom = Basis::new(active.iter().chain(&held).map(|k| &bent[*k])).rank();
        break;
    }
    out.share = if total > 0.0 { out.gain / total } else { 0.0 };
    out
}
