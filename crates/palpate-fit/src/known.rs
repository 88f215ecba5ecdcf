//! What is known of a number before the recording is looked at: a Gaussian prior (x − value)/sd, one more residual of unit noise.
//!
//! A problem of scenes with n_s residuals and costs J_s has the cost `[Σ n_s J_s + Σ ½ ((x − value)/sd)²] / Σ n_s`: for residuals that are
//! independent and as noisy as stated, n times it is the negative logarithm of the posterior density. Beside priors of fields, t residuals count
//! as one ([`crate::priors`]), and what is known beforehand weighs t times as much.

use crate::optimise::Sample;
use crate::problem::Problem;

/// A Gaussian prior of one free value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownRow {
    /// Place among the free values `[q]`.
    pub index: usize,
    /// (x − value)/sd.
    pub residual: f64,
    /// Its derivative by x: 1/sd.
    pub slope: f64,
}

/// What is wrong with a prior, if anything.
pub(crate) fn check((value, sd): (f64, f64), (low, high): (f64, f64)) -> Result<(), String> {
    if !(sd.is_finite() && sd > 0.0) {
        return Err(format!("known to ± {sd}: the standard deviation must be a finite number > 0"));
    }
    if !(value >= low && value <= high) {
        return Err(format!("known value {value} lies outside the bounds [{low}, {high}]"));
    }
    Ok(())
}

impl Problem<'_> {
    /// The priors at values `[q]`, as rows of residuals.
    pub fn known_rows(&self, values: &[f64]) -> Vec<KnownRow> {
        let of = self.blocks().filter_map(|(f, range)| Some((f.known?, range)));
        let row = |i: usize, (value, sd): (f64, f64)| KnownRow { index: i, residual: (values[i] - value) / sd, slope: 1.0 / sd };
        of.flat_map(|(known, range)| range.map(move |i| row(i, known))).collect()
    }

    /// Number of priors.
    pub(crate) fn known_count(&self) -> usize {
        self.blocks().filter(|(f, _)| f.known.is_some()).map(|(_, range)| range.len()).sum()
    }

    /// Adds the priors to a sum over scenes of n_s times cost and derivatives by values, as far as it has them.
    pub(crate) fn add_known(&self, sum: &mut Sample, values: &[f64]) {
        let q = values.len();
        let temper = self.priors().temper;
        for KnownRow { index: i, residual, slope } in self.known_rows(values) {
            sum.cost += temper * 0.5 * residual * residual;
            sum.gradient.iter_mut().skip(i).take(1).for_each(|g| *g += temper * residual * slope);
            sum.curvature.iter_mut().skip(i * q + i).take(1).for_each(|h| *h += temper * slope * slope);
        }
    }

    /// Share of the priors in the diagonal of the Gauss–Newton matrix by z `[q]`, at z `[q]`, for n residuals.
    pub(crate) fn known_curvature(&self, z: &[f64], n: f64) -> Vec<f64> {
        let mut out = vec![0.0; z.len()];
        for row in self.known_rows(&self.values(z)) {
            out[row.index] = self.priors().temper * (row.slope * self.charts()[row.index].slope(z[row.index])).powi(2) / n;
        }
        out
    }
}
