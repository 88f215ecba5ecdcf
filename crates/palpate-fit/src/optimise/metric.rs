//! The inner product in which a step by products is measured and conjugate gradients run: plain, or that of the priors of fields. With a prior the
//! matrix differs from it by what the data say, which is of low rank: conjugate gradients take as many products as there are directions
//! that data speak of, whatever the number of cells.

use super::{Sample, Search, Stop};
use crate::dense::dot;
use crate::priors::Blocks;

/// Most numbers beside fields whose curvature is asked for one by one.
const ASKED: usize = 64;
/// Least precision of a number in units of the log-likelihood.
const LEAST: f64 = 0.04;

/// An inner product dᵀMd.
pub(super) enum Metric {
    /// M = 1.
    Plain,
    /// Precisions of fields times `weight`, and curvatures of numbers.
    Prior { weight: f64, blocks: Blocks, numbers: Vec<(usize, f64)> },
}

/// Curvatures by numbers beside the fields with priors, at the start of a search; none without such fields.
pub(super) fn numbers(search: &mut Search, z: &[f64], at: &Sample) -> Result<Vec<(usize, f64)>, Stop> {
    let Some(priors) = search.priors else { return Ok(Vec::new()) };
    let of_field = |i: &usize| priors.placed.iter().any(|p| p.range.contains(i));
    let places: Vec<usize> = (0..z.len()).filter(|i| !of_field(i)).collect();
    let least = LEAST * priors.temper / at.residuals.max(1) as f64;
    let mut out = Vec::new();
    for i in places.iter().copied().take(ASKED) {
        let mut unit = vec![0.0; z.len()];
        unit[i] = 1.0;
        out.push((i, search.product(z, &unit)?[i].max(least)));
    }
    let last = out.last().map_or(1.0, |l| l.1);
    out.extend(places.into_iter().skip(ASKED).map(|i| (i, last)));
    Ok(out)
}

impl Metric {
    /// At z `[q]`.
    pub fn new(search: &Search, z: &[f64], at: &Sample, numbers: &[(usize, f64)]) -> Result<Metric, Stop> {
        let Some(priors) = search.priors else { return Ok(Metric::Plain) };
        let blocks = priors.at(z).map_err(Stop::Broken)?;
        Ok(Metric::Prior { weight: priors.temper / at.residuals.max(1) as f64, blocks, numbers: numbers.to_vec() })
    }

    /// M d `[q]`.
    pub fn times(&self, d: &[f64]) -> Vec<f64> {
        let Metric::Prior { weight, blocks, numbers } = self else { return d.to_vec() };
        let mut out = vec![0.0; d.len()];
        numbers.iter().for_each(|(i, h)| out[*i] = h * d[*i]);
        for (range, p) in blocks {
            out[range.clone()].iter_mut().zip(p.times(&d[range.clone()])).for_each(|(o, x)| *o = weight * x);
        }
        out
    }

    /// M⁻¹ r `[q]`.
    pub fn solve(&self, r: &[f64]) -> Vec<f64> {
        let Metric::Prior { weight, blocks, numbers } = self else { return r.to_vec() };
        let mut out = vec![0.0; r.len()];
        numbers.iter().for_each(|(i, h)| out[*i] = r[*i] / h);
        for (range, p) in blocks {
            let solved = p.solve(&[r[range.clone()].to_vec()]).swap_remove(0);
            out[range.clone()].iter_mut().zip(solved).for_each(|(o, x)| *o = x / weight);
        }
        out
    }

    /// Length of a gradient `[q]`, √(gᵀM⁻¹g).
    pub fn steepness(&self, g: &[f64]) -> f64 {
        dot(g, &self.solve(g)).max(0.0).sqrt()
    }
}
