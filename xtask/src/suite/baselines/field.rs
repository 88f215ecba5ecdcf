//! A free force field that is affine over the body and piecewise linear in time (the library's `slack`): what any smooth load could explain.
//! It is fitted to the linearised residuals beside the free numbers, held back a little, and says that something is missing where an F-test says
//! so.

use super::dense::{Factor, dot};
use super::{Linear, linearise};
use crate::suite::answer::Answer;
use palpate::{Error, Experiment};
use palpate_model::effects::{Effect, Unstated, find};
use palpate_model::scene::Scene;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Stretches of time.
const WINDOWS: usize = 5;
/// What holds the field back, over the square of its column's length.
const RIDGE: f64 = 1e-3;
/// Standard deviations from which on what the field explains of a cell is called missing.
const SEEN: f64 = 3.0;

/// Its answer.
///
/// # Errors
/// The experiment cannot be fitted, or the library has no such law.
pub fn answer(case: &str, e: &Experiment) -> Result<Answer, Error> {
    let law = find("slack").ok_or_else(|| Error::Failed("the library has no free force field".into()))?;
    let (from, to) = (e.scene().time.start, e.end_time());
    let l = linearise(e, |scene| add(scene, law, from, to))?;
    let (columns, y) = l.in_noise();
    let none = || Error::Failed("the field's columns are dependent".into());
    let (plain, _) = solved(&columns[..l.free], &y, l.free).ok_or_else(none)?;
    let (full, x) = solved(&columns, &y, l.free).ok_or_else(none)?;
    let (n, q, more) = (y.len() as f64, l.free as f64, (columns.len() - l.free) as f64);
    let f = ((plain - full) / more) / (full / (n - q - more).max(1.0)).max(1e-300);
    let p = if n > q + more { FisherSnedecor::new(more, n - q - more).map_or(1.0, |d| d.sf(f.max(0.0))) } else { 1.0 };
    let explains = |i: usize| (l.free..columns.len()).map(|k| columns[k][i] * x[k]).sum::<f64>();
    let missing: Vec<bool> = (0..y.len()).map(|i| explains(i).abs() > SEEN).collect();
    let mut answer = l.answer(case, p, &x, &missing);
    answer.pull = Some(pull(&l, &x));
    answer.sentence =
        format!("A free force field takes {:.0} % of the sum of squares away; F = {f:.1}", 100.0 * (1.0 - full / plain));
    Ok(answer)
}

/// Mean force at the centre over the windows [N/m³].
fn pull(l: &Linear, x: &[f64]) -> [f64; 3] {
    let per = (x.len() - l.free) / WINDOWS;
    std::array::from_fn(|a| (0..WINDOWS).map(|w| x[l.free + w * per + a]).sum::<f64>() / WINDOWS as f64)
}

/// Adds hats over time where they are absent; paths of their numbers.
fn add(scene: &mut Scene, law: usize, from: f64, to: f64) -> Vec<String> {
    let spacing = (to - from) / (WINDOWS - 1) as f64;
    let mut paths = Vec::new();
    for w in 0..WINDOWS {
        let mut effect = Effect::absent(law);
        for (slot, p) in effect.law().params.iter().enumerate() {
            match p.key {
                "time" => effect.values[slot] = Some(from + w as f64 * spacing),
                "width" => effect.values[slot] = Some(spacing),
                _ => {
                    if let Unstated::Absent(v) = p.default {
                        effect.values[slot] = Some(v);
                    }
                }
            }
        }
        let number = scene.effects.len();
        paths.extend(["force", "by_x", "by_y", "by_z"].map(|key| format!("effect.{number}.{key}")));
        scene.effects.push(effect);
    }
    paths
}

/// Least squares with what is beyond the free numbers held back: what is left, and the solution.
fn solved(columns: &[Vec<f64>], y: &[f64], free: usize) -> Option<(f64, Vec<f64>)> {
    let size: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt().max(1e-300)).collect();
    let ridge = |i: usize| if i < free { 1e-12 } else { RIDGE };
    let entry = |i: usize, j: usize| dot(&columns[i], &columns[j]) / (size[i] * size[j]) + if i == j { ridge(i) } else { 0.0 };
    let factor = Factor::new(columns.len(), entry)?;
    let right: Vec<f64> = columns.iter().zip(&size).map(|(c, s)| -dot(c, y) / s).collect();
    let x: Vec<f64> = factor.solve(&right).iter().zip(&size).map(|(x, s)| x / s).collect();
    let left: f64 = (0..y.len()).map(|i| (y[i] + columns.iter().zip(&x).map(|(c, x)| c[i] * x).sum::<f64>()).powi(2)).sum();
    Some((left, x))
}
