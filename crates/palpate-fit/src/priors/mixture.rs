//! What is known of a field when its prior is not known for sure: the posteriors of all priors that were tried, each with the weight of its evidence.
//!
//! Where a recording does not decide over which length values are alike, the best of the lengths would state too small errors. The variance of a
//! value is `Σ w (v + (m − m₀)²)` with v and m those under each prior, from the same quadratic as the evidence, around what was found, m₀.

use super::evidence::{Quadratic, Tried};
use super::lowrank::Reduced;
use super::{Hyper, Placed, Precision};
use crate::dense::{dot, solve};

/// Priors of less weight change no digit that anybody reads.
const LEAST: f64 = 1e-3;

/// Of every value of a field `[N]`.
pub(super) struct Mixture {
    /// Variance of the logarithm around what was found.
    pub after: Vec<f64>,
    /// Variance around the field's mean before the recording was looked at.
    pub before: Vec<f64>,
}

/// Over the priors of one field that were tried; m₀ is `found` `[N]`.
///
/// # Errors
/// A prior's matrix cannot be factorised.
pub(super) fn mixture(
    quadratic: &Quadratic,
    (placed, reduced): (&[Placed], &Reduced),
    field: usize,
    tried: &[Tried],
    found: &[f64],
) -> Result<Mixture, String> {
    let own = &placed[field];
    let candidates: Vec<&Tried> = tried.iter().filter(|t| t.hyper.deviation > 0.0).collect();
    let top = candidates.iter().map(|t| t.evidence).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = candidates.iter().map(|t| (t.evidence - top).exp()).collect();
    let all: f64 = weights.iter().sum();
    let rest = quadratic.rest(reduced, field);
    let n = found.len();
    let mut out = Mixture { after: vec![0.0; n], before: vec![0.0; n] };
    let mut used = 0.0;
    let mut last: Option<(Hyper, Parts)> = None;
    for (t, w) in candidates.iter().zip(&weights).map(|(t, w)| (t, w / all)).filter(|(_, w)| *w >= LEAST) {
        // Of another deviation alone only the size differs.
        let parts = match last.take() {
            Some((hyper, parts)) if own.is_matern() && hyper.length == t.hyper.length => {
                parts.scaled((t.hyper.deviation / hyper.deviation).powi(2))
            }
            _ => Parts::new(quadratic, field, &Precision::new(&own.prior, t.hyper, found)?),
        };
        let (mean, variance) = parts.posterior(quadratic, field, &rest);
        for i in 0..n {
            out.after[i] += w * (variance[i].max(0.0) + (mean[i] - found[i]).powi(2));
            out.before[i] += w * parts.marginal[i];
        }
        used += w;
        last = Some((t.hyper, parts));
    }
    out.after.iter_mut().chain(&mut out.before).for_each(|v| *v /= used);
    Ok(out)
}

/// What a prior of one field is to the quadratic.
struct Parts {
    /// Marginal variances around the mean `[N]`.
    marginal: Vec<f64>,
    /// S (PX) without the mean `[r][N]`.
    along: Vec<Vec<f64>>,
    /// Variance of the mean.
    mean: f64,
}

impl Parts {
    fn new(quadratic: &Quadratic, field: usize, p: &Precision) -> Parts {
        Parts { marginal: p.marginal(), along: p.deviations(quadratic.against(field)), mean: p.mean_deviation().powi(2) }
    }

    fn scaled(mut self, by: f64) -> Parts {
        self.marginal.iter_mut().chain(self.along.iter_mut().flatten()).for_each(|x| *x *= by);
        self
    }

    /// Mean and variances `[N]` of the field's posterior, `rest` the part of W that the prior leaves alone.
    fn posterior(&self, quadratic: &Quadratic, field: usize, rest: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (px, mu) = (quadratic.against(field), quadratic.values());
        let (r, n) = (mu.len(), self.marginal.len());
        let w: Vec<f64> = (0..r * r)
            .map(|k| rest[k] + 0.5 * (dot(&px[k / r], &self.along[k % r]) + dot(&px[k % r], &self.along[k / r])))
            .collect();
        let root: Vec<f64> = mu.iter().map(|m| m.sqrt()).collect();
        let one: Vec<f64> =
            (0..r * r).map(|k| root[k / r] * w[k] * root[k % r] + if k / r == k % r { 1.0 } else { 0.0 }).collect();
        // D^½ (1 + G)⁻¹ D^½, symmetric.
        let row = |a: usize| {
            let unit: Vec<f64> = (0..r).map(|b| if a == b { root[a] } else { 0.0 }).collect();
            solve(&one, &unit).unwrap_or_else(|| vec![0.0; r]).iter().zip(&root).map(|(x, s)| x * s).collect::<Vec<f64>>()
        };
        let taken: Vec<Vec<f64>> = (0..r).map(row).collect();
        let wd: Vec<f64> = (0..r).map(|a| dot(&w[a * r..(a + 1) * r], quadratic.d())).collect();
        let along: Vec<f64> = quadratic.d().iter().zip(&taken).map(|(d, row)| d - dot(row, &wd)).collect();
        let sums: Vec<f64> = px.iter().map(|px| self.mean * px.iter().sum::<f64>()).collect();
        let (mut mean, mut variance) = (vec![0.0; n], vec![0.0; n]);
        for i in 0..n {
            let y: Vec<f64> = (0..r).map(|k| self.along[k][i] + sums[k]).collect();
            mean[i] = dot(&y, &along);
            variance[i] = self.marginal[i] + self.mean - y.iter().zip(&taken).map(|(y_k, row)| y_k * dot(row, &y)).sum::<f64>();
        }
        (mean, variance)
    }
}
