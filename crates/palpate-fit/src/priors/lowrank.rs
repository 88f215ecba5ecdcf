//! What the data say of fields, as a matrix of low rank: the largest eigenvalues μ of the Gauss–Newton matrix A against the prior's
//! precision P, `A x = μ P x` (Bui-Thanh, Ghattas, Martin & Stadler, SIAM J. Sci. Comput. 35, 2013), by Lanczos' method in the product of P.
//!
//! All is in units of the log-likelihood: A = (n/t) H. Numbers y without a prior are taken out of A first: what they can explain as well is not
//! said of the field, `A = A_ff − A_fy A_yy⁻¹ A_yf`.

use super::{Blocks, Priors};
use crate::dense::{dot, eigen, solve};
use crate::optimise::Stop;
use crate::problem::Problem;
use palpate_engine::FailureKind;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Most directions.
const MOST: usize = 96;
/// The search ends where what is left of A beside the directions found is below this, in the product of P. The noise hides all below one; priors that are
/// rougher than P count more of it, and their evidence would be too good without.
const LEFT: f64 = 1e-3;
/// Smaller eigenvalues are what is left of the search.
const FAINT: f64 = 1e-4;
/// Most numbers beside fields.
pub(super) const MOST_NUMBERS: usize = 64;
/// Precision of a number without a prior: a standard deviation of 5 of what an optimiser sees, next to nothing.
const LOOSE: f64 = 1.0 / 25.0;

/// A with the numbers taken out, at one point.
pub(super) struct Reduced<'s> {
    z: Vec<f64>,
    /// n/t.
    weight: f64,
    /// Places of the numbers.
    pub numbers: Vec<usize>,
    /// A_yy⁻¹ `[y, y]`.
    pub inverse: Vec<f64>,
    /// Columns of A by numbers `[y][q]`.
    columns: Vec<Vec<f64>>,
    pub blocks: Blocks,
    /// Asks whether the fit is to end.
    over: &'s dyn Fn() -> bool,
}

/// The largest eigenvalues with their directions.
#[derive(Clone, Debug, Default)]
pub(super) struct LowRank {
    /// μ, the largest first.
    pub values: Vec<f64>,
    /// x with xᵀPx = 1, `[rank][q]`; zero for numbers.
    pub along: Vec<Vec<f64>>,
    /// P x.
    pub against: Vec<Vec<f64>>,
}

impl Reduced<'_> {
    /// At z `[q]`, with these numbers (not those that a bound holds).
    ///
    /// # Errors
    /// The fit is to end, or what computes broke.
    pub fn new<'s>(
        problem: &mut Problem,
        priors: &Priors,
        z: &[f64],
        numbers: Vec<usize>,
        over: &'s dyn Fn() -> bool,
    ) -> Result<Reduced<'s>, Stop> {
        let blocks = priors.at(z).map_err(Stop::Broken)?;
        let weight = problem.residual_count() / priors.temper;
        let mut r = Reduced { z: z.to_vec(), weight, numbers, inverse: Vec::new(), columns: Vec::new(), blocks, over };
        for k in 0..r.numbers.len() {
            let mut unit = vec![0.0; z.len()];
            unit[r.numbers[k]] = 1.0;
            let column = r.full(problem, &unit)?;
            r.columns.push(column);
        }
        let y = r.numbers.len();
        let at = |a: usize, b: usize| 0.5 * (r.columns[a][r.numbers[b]] + r.columns[b][r.numbers[a]]);
        let own: Vec<f64> = (0..y * y).map(|k| at(k / y, k % y) + if k / y == k % y { LOOSE } else { 0.0 }).collect();
        let unit = |k: usize| (0..y).map(|i| if i == k { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let columns: Option<Vec<Vec<f64>>> = (0..y).map(|k| solve(&own, &unit(k))).collect();
        r.inverse =
            columns.ok_or_else(|| Stop::Broken("the curvature by the numbers beside a field is not positive".into()))?.concat();
        Ok(r)
    }

    /// Where it is taken `[q]`.
    pub fn point(&self) -> &[f64] {
        &self.z
    }

    /// A v of all values.
    fn full(&self, problem: &mut Problem, v: &[f64]) -> Result<Vec<f64>, Stop> {
        if (self.over)() {
            return Err(Stop::Interrupted);
        }
        let product = problem.data_product(&self.z, v).map_err(|f| match f.kind {
            FailureKind::Stopped => Stop::Interrupted,
            _ => Stop::Broken(f.to_string()),
        })?;
        Ok(product.iter().map(|p| self.weight * p).collect())
    }

    /// A_yy⁻¹ y.
    fn by_numbers(&self, y: &[f64]) -> Vec<f64> {
        let n = y.len();
        (0..n).map(|a| dot(&self.inverse[a * n..(a + 1) * n], y)).collect()
    }

    /// A_yy⁻¹ A_yf `[y][q]`: how far each number follows the field's values; zero for numbers.
    pub fn follow(&self) -> Vec<Vec<f64>> {
        let y = self.numbers.len();
        let q = self.z.len();
        let row = |a: usize| {
            let mut row = vec![0.0; q];
            for b in 0..y {
                self.fields().for_each(|i| row[i] += self.inverse[a * y + b] * self.columns[b][i]);
            }
            row
        };
        (0..y).map(row).collect()
    }

    fn fields(&self) -> impl Iterator<Item = usize> + '_ {
        self.blocks.iter().flat_map(|b| b.0.clone())
    }

    /// What a gradient or product `[q]` says of fields once the numbers are taken out; zero for all else.
    pub fn without_numbers(&self, g: &[f64]) -> Vec<f64> {
        let y: Vec<f64> = self.numbers.iter().map(|k| g[*k]).collect();
        let y = self.by_numbers(&y);
        let mut out = vec![0.0; g.len()];
        for i in self.fields() {
            out[i] = g[i] - self.columns.iter().zip(&y).map(|(c, y)| c[i] * y).sum::<f64>();
        }
        out
    }

    /// A v, for v `[q]` of fields alone.
    pub fn times(&self, problem: &mut Problem, v: &[f64]) -> Result<Vec<f64>, Stop> {
        Ok(self.without_numbers(&self.full(problem, v)?))
    }

    /// P v or P⁻¹ v `[q]`, field by field; zero for all else.
    fn by_block(&self, v: &[f64], act: impl Fn(&super::Precision, &[f64]) -> Vec<f64>) -> Vec<f64> {
        let mut out = vec![0.0; v.len()];
        self.blocks.iter().for_each(|(range, p)| out[range.clone()].copy_from_slice(&act(p, &v[range.clone()])));
        out
    }

    /// P v `[q]`.
    pub fn prior_times(&self, v: &[f64]) -> Vec<f64> {
        self.by_block(v, |p, v| p.times(v))
    }

    /// P⁻¹ v `[q]`.
    pub fn prior_solve(&self, v: &[f64]) -> Vec<f64> {
        self.by_block(v, |p, v| p.solve(&[v.to_vec()]).swap_remove(0))
    }

    /// Lanczos' method from a fixed draw, with every direction made orthogonal to all before.
    ///
    /// # Errors
    /// The fit is to end, or what computes broke.
    pub fn low_rank(&self, problem: &mut Problem) -> Result<LowRank, Stop> {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut draw = vec![0.0; self.z.len()];
        for (range, p) in &self.blocks {
            draw[range.clone()].copy_from_slice(&p.draw(1, &mut rng)[0]);
            // The mean as well.
            draw[range.clone()].iter_mut().for_each(|d| *d += p.mean_deviation());
        }
        let (mut v, mut pv): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let most = MOST.min(self.fields().count());
        let mut next = draw;
        for _ in 0..most {
            // Twice is enough (Parlett, The Symmetric Eigenvalue Problem, 1980, § 6.9).
            for _ in 0..2 {
                for (v, pv) in v.iter().zip(&pv) {
                    let along = dot(&next, pv);
                    next.iter_mut().zip(v).for_each(|(n, v)| *n -= along * v);
                }
            }
            let against = self.prior_times(&next);
            let length = dot(&next, &against).max(0.0).sqrt();
            if !v.is_empty() {
                if length <= LEFT {
                    break;
                }
                beside.push(length);
            }
            v.push(next.iter().map(|n| n / length).collect());
            pv.push(against.iter().map(|n| n / length).collect());
            let last = v.last().expect("one was just pushed");
            let a = self.times(problem, last)?;
            diagonal.push(dot(&a, last));
            next = self.prior_solve(&a);
        }
        Ok(ritz(&diagonal, &beside, &v, &pv))
    }
}

/// Eigenvalues of the tridiagonal matrix, and directions by them.
fn ritz(diagonal: &[f64], beside: &[f64], v: &[Vec<f64>], pv: &[Vec<f64>]) -> LowRank {
    let k = diagonal.len();
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    };
    let t: Vec<f64> = (0..k * k).map(|e| entry(e / k, e % k)).collect();
    let Some((values, vectors)) = eigen(&t, k) else { return LowRank::default() };
    let mut out = LowRank::default();
    for (value, s) in values.into_iter().zip(vectors).rev().filter(|(value, _)| *value > FAINT) {
        let combine = |of: &[Vec<f64>]| {
            let mut sum = vec![0.0; of.first().map_or(0, Vec::len)];
            of.iter().zip(&s).for_each(|(v, s)| sum.iter_mut().zip(v).for_each(|(o, v)| *o += s * v));
            sum
        };
        out.values.push(value);
        out.along.push(combine(v));
        out.against.push(combine(pv));
    }
    out
}

impl LowRank {
    /// Σ μ/(1+μ): how many numbers the data tell of the field.
    pub fn effective(&self) -> f64 {
        self.values.iter().map(|m| m / (1.0 + m)).sum()
    }

    /// C v `[q]` with the posterior's covariance C = P⁻¹ − Σ μ/(1+μ) x xᵀ, from P⁻¹ v.
    pub fn posterior(&self, solved: Vec<f64>, v: &[f64]) -> Vec<f64> {
        let mut out = solved;
        for (m, x) in self.values.iter().zip(&self.along) {
            let by = m / (1.0 + m) * dot(x, v);
            out.iter_mut().zip(x).for_each(|(o, x)| *o -= by * x);
        }
        out
    }
}
