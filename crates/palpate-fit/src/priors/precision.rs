//! A Gaussian prior as a precision P: products, solves, draws, marginal variances.
//!
//! A field m is its mean over the body, m̄ = Σ V_i m_i / V, and deviations from it, which are independent a priori. Deviations have the
//! covariance S of their kind with its part along the constant taken out:
//!
//! - *Matérn*: s² ν K⁻¹ M K⁻¹ with K = κ²M + G, M the volumes and G = Σ (A/d)(e_a − e_b)(e_a − e_b)ᵀ over links (Lindgren, Rue & Lindström,
//!   J. R. Stat. Soc. B 73, 2011, α = 2, natural boundary). In three dimensions that is the exponential covariance exp(−κr), with correlation
//!   0.14 at the length 2/κ. ν makes a fifth of the body have marginal variances below s²: its middle. In a large body on fine cells it is 8πκ.
//! - *Edge-preserving*: the Gaussian that touches exp(−E) at a field, E = Σ (A/Ā) (√(Δ² + ε²) − ε)/s over links with Δ = m_a − m_b,
//!   Ā = V^⅔ and ε = s/10: K⁻¹ with weights (A/Ā)/(s √(Δ² + ε²)) and a δ that is of no account.
//!
//! The mean has the deviation of [`Mean`]. As K 1 = δ M 1, both parts have closed forms.

use super::factor::Factor;
use super::{FieldPrior, Hyper};
use crate::dense::dot;
use palpate_model::params::fields::PriorKind;
use palpate_model::space::neighbours::{Link, Neighbours};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;

/// Values up to which marginal variances are computed one by one; beyond, from draws.
const EXACT: usize = 2000;
/// The same for their size alone, which needs less.
const EXACT_SIZE: usize = 500;
/// Draws for the size, and for every variance: the error of a variance is √(2/draws) of it, 9 and 6 %.
const DRAWS: [usize; 2] = [256, 512];
/// Share of the body, from the least variance on, that lies in its middle: at its surface variances are up to eight times as large.
const MIDDLE: f64 = 0.2;
/// Columns that are solved for at once.
const BLOCK: usize = 64;
/// ε over s.
const ROUNDED: f64 = 0.1;
/// Variance along the constant that δ of an edge-preserving prior would give, over s².
const LOOSE: f64 = 100.0;

/// The mean of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mean {
    /// Free: a priori within a factor of twenty up or down, which data easily overrule.
    Free,
    /// Zero: another number that is free holds it.
    Zero,
}

impl Mean {
    /// Standard deviation.
    fn deviation(self) -> f64 {
        match self {
            Mean::Free => 3.0,
            Mean::Zero => 1e-2,
        }
    }
}

/// The precision of one field.
#[derive(Clone, Debug)]
pub(crate) struct Precision {
    around: Arc<Neighbours>,
    whole: f64,
    /// Variance of the mean.
    mean: f64,
    kind: PriorKind,
    /// s²ν of Matérn, 1 else.
    scale: f64,
    /// ν.
    unit: f64,
    factor: Arc<Factor>,
}

/// E of an edge-preserving prior's link, its derivative by Δ over Δ, for s.
fn edge(share: f64, step: f64, s: f64) -> (f64, f64) {
    let soft = ROUNDED * s;
    let size = step.hypot(soft);
    // √(Δ² + ε²) − ε without cancellation.
    (share * step * step / ((size + soft) * s), share / (s * size))
}

impl Precision {
    /// At hyperparameters; of an edge-preserving prior the one that touches it at m `[N]`.
    ///
    /// # Errors
    /// The matrix cannot be factorised.
    pub fn new(prior: &FieldPrior, hyper: Hyper, m: &[f64]) -> Result<Precision, String> {
        let around = &prior.around;
        let whole = around.whole();
        let (kind, s) = (prior.kind, hyper.deviation);
        let (shift, weights) = match kind {
            PriorKind::Matern => ((2.0 / hyper.length).powi(2), around.links.iter().map(|l| l.area / l.distance).collect()),
            PriorKind::EdgePreserving => {
                let weight = |l: &Link| edge(l.area / whole.powf(2.0 / 3.0), m[l.a as usize] - m[l.b as usize], s).1;
                (1.0 / (LOOSE * s * s * whole), around.links.iter().map(weight).collect())
            }
        };
        let factor = Arc::new(Factor::new(around, shift, weights)?);
        let mean = prior.mean.deviation().powi(2);
        let mut p = Precision { around: around.clone(), whole, mean, kind, scale: 1.0, unit: 1.0, factor };
        if kind == PriorKind::Matern {
            p.unit = 1.0 / p.middle(&p.variances(EXACT_SIZE, DRAWS[0]));
            p.scale = p.unit * s * s;
        }
        Ok(p)
    }

    /// The same with another deviation, of a Matérn prior.
    pub fn with_deviation(&self, s: f64) -> Precision {
        Precision { scale: self.unit * s * s, ..self.clone() }
    }

    /// Number of values N.
    pub fn len(&self) -> usize {
        self.around.volume.len()
    }

    /// Standard deviation of the mean.
    pub fn mean_deviation(&self) -> f64 {
        self.mean.sqrt()
    }

    /// m̄.
    pub fn mean_of(&self, m: &[f64]) -> f64 {
        dot(&self.around.volume, m) / self.whole
    }

    /// P v `[N]`.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mean = self.mean_of(v);
        let away: Vec<f64> = v.iter().map(|v| v - mean).collect();
        let mut out = self.factor.times(&away);
        if self.kind == PriorKind::Matern {
            out.iter_mut().zip(&self.around.volume).for_each(|(o, m)| *o /= m);
            out = self.factor.times(&out);
        }
        let by_mean = mean / (self.mean * self.whole);
        out.iter_mut().zip(&self.around.volume).for_each(|(o, m)| *o = *o / self.scale + m * by_mean);
        out
    }

    /// P⁻¹ u for several columns `[N]`.
    pub fn solve(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let mut out = self.deviations(columns);
        for (o, u) in out.iter_mut().zip(columns) {
            let by_mean = self.mean * u.iter().sum::<f64>();
            o.iter_mut().for_each(|o| *o += by_mean);
        }
        out
    }

    /// S u, the part of P⁻¹ u without the mean, for several columns `[N]`.
    pub fn deviations(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let volume = &self.around.volume;
        let without = |u: &Vec<f64>| {
            let sum = u.iter().sum::<f64>() / self.whole;
            u.iter().zip(volume).map(|(u, m)| u - m * sum).collect()
        };
        let mut out = self.factor.solve(&columns.iter().map(without).collect::<Vec<Vec<f64>>>());
        if self.kind == PriorKind::Matern {
            out.iter_mut().for_each(|o| o.iter_mut().zip(volume).for_each(|(o, m)| *o *= m));
            out = self.factor.solve(&out);
        }
        for o in &mut out {
            let mean = self.mean_of(o);
            o.iter_mut().for_each(|o| *o = self.scale * (*o - mean));
        }
        out
    }

    /// Draws of deviations from the mean `[count][N]`.
    pub fn draw(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let volume = &self.around.volume;
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut sources = Vec::new();
        for _ in 0..count {
            let mut x: Vec<f64> = volume.iter().map(|m| m.sqrt() * normal()).collect();
            if self.kind == PriorKind::EdgePreserving {
                x.iter_mut().for_each(|x| *x *= self.factor.shift.sqrt());
                for (l, w) in self.around.links.iter().zip(&self.factor.weights) {
                    let flow = w.sqrt() * normal();
                    x[l.a as usize] += flow;
                    x[l.b as usize] -= flow;
                }
            }
            sources.push(x);
        }
        let mut out = self.factor.solve(&sources);
        for o in &mut out {
            let mean = self.mean_of(o);
            o.iter_mut().for_each(|o| *o = self.scale.sqrt() * (*o - mean));
        }
        out
    }

    /// Marginal variances of deviations from the mean `[N]`.
    pub fn marginal(&self) -> Vec<f64> {
        self.variances(EXACT, DRAWS[1])
    }

    fn variances(&self, exact: usize, draws: usize) -> Vec<f64> {
        use rand::SeedableRng;
        let n = self.len();
        let mut out = vec![0.0; n];
        if n <= exact {
            for first in (0..n).step_by(BLOCK) {
                let some: Vec<usize> = (first..n.min(first + BLOCK)).collect();
                let unit = |k: &usize| (0..n).map(|i| if i == *k { 1.0 } else { 0.0 }).collect();
                let columns = self.deviations(&some.iter().map(unit).collect::<Vec<_>>());
                some.iter().zip(columns).for_each(|(k, column)| out[*k] = column[*k]);
            }
            return out;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for first in (0..draws).step_by(BLOCK) {
            for x in self.draw(BLOCK.min(draws - first), &mut rng) {
                out.iter_mut().zip(x).for_each(|(o, x)| *o += x * x / draws as f64);
            }
        }
        out
    }

    /// What [`MIDDLE`] of the volume lies below.
    fn middle(&self, of: &[f64]) -> f64 {
        let mut order: Vec<usize> = (0..of.len()).collect();
        order.sort_by(|a, b| of[*a].total_cmp(&of[*b]));
        let mut below = 0.0;
        for k in &order {
            below += self.around.volume[*k];
            if below >= MIDDLE * self.whole {
                return of[*k];
            }
        }
        1.0
    }

    /// Energy E(m), minus the logarithm of the prior's density but for a constant, and its gradient `[N]`.
    pub fn energy(&self, prior: &FieldPrior, hyper: Hyper, m: &[f64]) -> (f64, Vec<f64>) {
        if self.kind == PriorKind::Matern {
            let gradient = self.times(m);
            return (0.5 * dot(&gradient, m), gradient);
        }
        let (area, mean) = (self.whole.powf(2.0 / 3.0), self.mean_of(m));
        let by_mean = mean / (self.mean * self.whole);
        let mut gradient: Vec<f64> = self.around.volume.iter().map(|v| v * by_mean).collect();
        let mut energy = 0.5 * mean * mean / self.mean;
        for l in &prior.around.links {
            let step = m[l.a as usize] - m[l.b as usize];
            let (e, slope) = edge(l.area / area, step, hyper.deviation);
            energy += e;
            gradient[l.a as usize] += slope * step;
            gradient[l.b as usize] -= slope * step;
        }
        (energy, gradient)
    }

    /// Product of the curvature at m `[N]` with v `[N]`; see [`super::Priors::product`].
    pub fn curvature(&self, prior: &FieldPrior, hyper: Hyper, m: &[f64], v: &[f64]) -> Vec<f64> {
        if self.kind == PriorKind::Matern {
            return self.times(v);
        }
        let (area, by_mean) = (self.whole.powf(2.0 / 3.0), self.mean_of(v) / (self.mean * self.whole));
        let mut out: Vec<f64> = self.around.volume.iter().map(|v| v * by_mean).collect();
        for l in &prior.around.links {
            let (a, b) = (l.a as usize, l.b as usize);
            let flow = edge(l.area / area, m[a] - m[b], hyper.deviation).1 * (v[a] - v[b]);
            out[a] += flow;
            out[b] -= flow;
        }
        out
    }
}
