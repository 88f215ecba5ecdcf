//! How well the data determine the parameters, and which of them they cannot tell apart.
//!
//! With n scalar residuals r of noise σ the cost is `J = (1/n) Σ r²/(2σ²)`, and its Gauss–Newton matrix
//! `H = (1/n) Σ ∇r ∇rᵀ/σ²`. Then
//!
//! - `s² = max(1, 2 n J/(n − q))`: the reduced χ², so that residuals larger than the stated noise widen the errors, while
//!   residuals that happen to be smaller do not narrow them;
//! - independent errors give the covariance `s² H⁻¹/n`; where D residuals count as one, because their errors go together,
//!   `s² D H⁻¹/n`;
//! - an error of `systematic · σ` that all residuals of a group share does not average out within the group. As a bound, each
//!   group counts like one residual with the average sensitivity: `systematic² H⁻¹/groups`.
//!
//! Altogether `cov = τ H⁻¹`, `τ = s² D/n + systematic²/groups`.
//!
//! What is known beforehand is one more residual, `H = H_data + H_known`, which neither s² nor D widens, as it does not come from the
//! recording: `cov = H⁻¹ (τ H_data + H_known/n) H⁻¹`, the covariance of the estimate under the errors that both have (White,
//! Econometrica 50, 1982). With τ = 1/n that is H⁻¹/n, the covariance of the Gaussian posterior. In s² it counts among n. All of this is done in z (relative errors for logarithms);
//! standard errors in units of the parameter follow by the slope of its chart.

use crate::chart::AtBound;
use crate::dense::eigen;
use crate::multistart::StartRun;
use crate::optimise::Sample;
use crate::problem::Problem;
use crate::settings::ErrorModel;
use palpate_engine::number;
use palpate_model::params::{Transform, unit_behind};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Correlation beyond which two parameters are reported together.
const CORRELATED: f64 = 0.95;
/// Standard error in z beyond which a direction counts as undetermined (a factor 1.6 for logarithms).
pub(crate) const UNDETERMINED: f64 = 0.5;
/// Correlated parameters whose standard errors in z are all smaller are known well enough to be told apart.
const KNOWN: f64 = 0.02;
/// Confidence with which costs are called equal.
const CONFIDENCE: f64 = 0.95;
/// Eigenvalues below this share of the largest are rounding errors.
const RANK: f64 = 1e-12;
/// Components of a unit vector below this share of the largest are not named.
const NAMED: f64 = 0.3;
/// Correlations are kept of no more values.
const MOST_CORRELATED: usize = 256;
/// Other optima closer than this in z are not worth a sentence.
const CLOSE: f64 = 0.1;

/// What the curvature at the optimum says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Uncertainty {
    /// Standard error of every parameter in its unit `[q]`; `None` at a bound or without curvature.
    pub standard_errors: Vec<Option<f64>>,
    /// The same of what averages out, without errors that residuals of a group share `[q]`.
    pub noise_errors: Vec<Option<f64>>,
    /// Correlation matrix `[q][q]` in z; rows of parameters without standard error are those of the identity. Empty for very many.
    pub correlation: Vec<Vec<f64>>,
    /// Mean square residual over the squared noise, `2 n J/(n − q)`; NaN when there are too few residuals.
    pub reduced_chi_square: f64,
    /// How many independent readings the residuals are worth, n/D; NaN without any.
    pub independent: f64,
    /// Plain sentences about what is not determined.
    pub warnings: Vec<String>,
    /// Standard errors in z `[q]`.
    pub(crate) errors_z: Vec<Option<f64>>,
    /// τ above; 0 if it is not known.
    pub(crate) tau: f64,
    /// Its part that averages out, s² D/n.
    tau_noise: f64,
}

/// Unit vectors `[m]` along which vectors of which only the direction counts grow: that changes no residual and is no unknown.
fn lengths(problem: &Problem, inner: &[usize], z: &[f64]) -> Vec<Vec<f64>> {
    let values = problem.values(z);
    let vector = |i: usize| problem.of(i).direction.as_deref();
    let names: std::collections::BTreeSet<&str> = inner.iter().filter_map(|i| vector(*i)).collect();
    let along = |name: &str| -> Vec<f64> {
        inner.iter().map(|&i| if vector(i) == Some(name) { values[i] / problem.charts()[i].slope(z[i]) } else { 0.0 }).collect()
    };
    let unit = |v: Vec<f64>| {
        let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        (size > 0.0).then(|| v.iter().map(|x| x / size).collect())
    };
    names.into_iter().filter_map(|n| unit(along(n))).collect()
}

/// Uncertainty at z `[q]`, from a sample by z there; without curvature there are no standard errors.
pub fn assess(problem: &Problem, z: &[f64], sample: &Sample, errors: &ErrorModel) -> Uncertainty {
    let mut u = Uncertainty::unknown(z.len());
    u.count(sample, errors, problem.known_count());
    let inner = inside(problem, z, &mut u.warnings);
    if inner.is_empty() || sample.curvature.is_empty() {
        return u;
    }
    if sample.residuals == 0 {
        u.warnings.push("no standard errors: the cost counts no residuals".into());
        return u;
    }
    let averaged = Spread::new(problem, z, sample, u.tau_noise, inner.clone());
    for (a, &i) in inner.iter().enumerate() {
        u.noise_errors[i] = averaged.as_ref().ok().map(|s| s.sd[a] * problem.charts()[i].slope(z[i]));
    }
    match Spread::new(problem, z, sample, u.tau, inner) {
        Err(why) => u.warnings.push(format!("no standard errors: {why}")),
        Ok(spread) => {
            u.state(problem, z, &spread);
            let told = u.tell_undetermined(problem, z, &spread);
            u.tell_correlated(problem, &spread, &told);
        }
    }
    u
}

/// Parameters that no bound holds. One that a bound holds is a known number for the others; each has its sentence.
fn inside(problem: &Problem, z: &[f64], warnings: &mut Vec<String>) -> Vec<usize> {
    let values = problem.values(z);
    let mut inner = Vec::new();
    for (f, range) in problem.blocks() {
        let mut held = Vec::new();
        for i in range {
            match problem.charts()[i].at_bound(values[i]) {
                None => inner.push(i),
                Some(side) => held.push(side),
            }
        }
        let (side, bound) = match (held.first(), f.count) {
            (None, _) => continue,
            (Some(_), 2..) => {
                let (path, n, count) = (&f.path, held.len(), f.count);
                warnings.push(format!("{path}: {n} of {count} values ended at a bound and have no standard error"));
                continue;
            }
            (Some(AtBound::Lower), _) => ("lower", f.bounds.0),
            (Some(AtBound::Upper), _) => ("upper", f.bounds.1),
        };
        warnings.push(format!(
            "{} ended at its {side} bound {bound}: the best value may lie beyond it, and has no standard error",
            f.path
        ));
    }
    inner
}

/// Covariance of the m parameters that no bound holds, by the eigenvectors of the curvature in z.
struct Spread {
    /// Which parameters these are `[m]`.
    inner: Vec<usize>,
    /// Variance along each eigenvector `[m]`, the least determined first.
    variances: Vec<f64>,
    /// Eigenvectors `[m][m]`, one a row.
    vectors: Vec<Vec<f64>>,
    /// Standard errors in z `[m]`.
    sd: Vec<f64>,
}

impl Spread {
    fn new(problem: &Problem, z: &[f64], sample: &Sample, tau: f64, inner: Vec<usize>) -> Result<Spread, &'static str> {
        let (q, m) = (z.len(), inner.len());
        let mut h: Vec<f64> = inner.iter().flat_map(|&i| inner.iter().map(move |&j| sample.curvature[i * q + j])).collect();
        let lengths = lengths(problem, &inner, z);
        // Lengths become eigenvectors that nothing else mixes with.
        let trace: f64 = (0..m).map(|a| h[a * m + a]).sum();
        for e in &lengths {
            (0..m * m).for_each(|k| h[k] += 2.0 * trace * e[k / m] * e[k % m]);
        }
        let (values, vectors) = eigen(&h, m).ok_or("the curvature of the cost is not finite")?;
        let is_length =
            |k: usize| lengths.iter().any(|e| e.iter().zip(&vectors[k]).map(|(e, v)| e * v).sum::<f64>().powi(2) > 0.5);
        let largest = (0..m).filter(|k| !is_length(*k)).map(|k| values[k]).fold(0.0, f64::max);
        if largest <= 0.0 {
            return Err("no free parameter changes the cost");
        }
        let variance = |k: usize| if is_length(k) { 0.0 } else { tau / values[k].max(RANK * largest) };
        let mut spread = Spread { variances: (0..m).map(variance).collect(), inner, vectors, sd: Vec::new() };
        spread.with_known(&problem.known_curvature(z, sample.residuals as f64), tau, sample.residuals as f64);
        spread.sd = (0..m).map(|a| spread.covariance(a, a).sqrt()).collect();
        Ok(spread)
    }

    /// Turns τ H⁻¹ into the covariance with what is known beforehand, whose share of H's diagonal is `known` `[q]`.
    fn with_known(&mut self, known: &[f64], tau: f64, n: f64) {
        let m = self.inner.len();
        let known: Vec<f64> = self.inner.iter().map(|&i| known[i]).collect();
        if known.iter().all(|k| *k == 0.0) || tau <= 0.0 {
            return;
        }
        // H⁻¹ (τ H + (1/n − τ) H_known) H⁻¹, from C = τ H⁻¹.
        let c: Vec<f64> = (0..m * m).map(|k| self.covariance(k / m, k % m)).collect();
        let by = (1.0 / n - tau) / (tau * tau);
        let row = |a: usize| &c[a * m..(a + 1) * m];
        let of_known = |a: usize, b: usize| known.iter().enumerate().map(|(j, k)| row(a)[j] * k * row(b)[j]).sum::<f64>();
        let all: Vec<f64> = (0..m * m).map(|k| c[k] + by * of_known(k / m, k % m)).collect();
        if let Some((values, vectors)) = eigen(&all, m) {
            self.variances = values.iter().rev().map(|v| v.max(0.0)).collect();
            self.vectors = vectors.into_iter().rev().collect();
        }
    }

    /// Covariance of two of the m parameters in z.
    fn covariance(&self, a: usize, b: usize) -> f64 {
        (0..self.inner.len()).map(|k| self.variances[k] * self.vectors[k][a] * self.vectors[k][b]).sum()
    }

    /// What is said of two of the m parameters that only act together.
    fn alike(&self, names: &Names, a: usize, b: usize) -> String {
        names.alike(self.inner[a], self.inner[b], self.covariance(a, a), self.covariance(b, b), self.covariance(a, b))
    }
}

/// The identity matrix `[q][q]`.
pub(crate) fn identity(q: usize) -> Vec<Vec<f64>> {
    (0..q).map(|i| (0..q).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect()
}

impl Uncertainty {
    /// Nothing is known of q parameters.
    fn unknown(q: usize) -> Uncertainty {
        Uncertainty {
            standard_errors: vec![None; q],
            noise_errors: vec![None; q],
            errors_z: vec![None; q],
            correlation: if q <= MOST_CORRELATED { identity(q) } else { Vec::new() },
            reduced_chi_square: f64::NAN,
            independent: f64::NAN,
            ..Uncertainty::default()
        }
    }

    /// Reduced χ², what the residuals are worth, and τ.
    fn count(&mut self, sample: &Sample, errors: &ErrorModel, known: usize) {
        let (n, q) = (sample.residuals as f64, self.standard_errors.len());
        let free = n + known as f64 - q as f64;
        if n > 0.0 && free > 0.0 {
            self.reduced_chi_square = 2.0 * n * sample.cost / free;
        } else if n > 0.0 {
            self.warnings.push(format!("there are only {n} residuals for {q} free parameters"));
        }
        if n > 0.0 {
            self.independent = n / errors.design_effect.max(1.0);
            self.tau_noise = self.reduced_chi_square.max(1.0) / self.independent;
            self.tau = self.tau_noise + errors.systematic.powi(2) / errors.groups.max(1) as f64;
        }
    }

    /// Standard errors and correlations.
    fn state(&mut self, problem: &Problem, z: &[f64], spread: &Spread) {
        let sd = &spread.sd;
        for (a, &i) in spread.inner.iter().enumerate() {
            self.errors_z[i] = Some(sd[a]);
            self.standard_errors[i] = Some(sd[a] * problem.charts()[i].slope(z[i]));
            for (b, &j) in spread.inner.iter().enumerate().filter(|(b, _)| *b != a) {
                self.correlation[i][j] = (spread.covariance(a, b) / (sd[a] * sd[b])).clamp(-1.0, 1.0);
            }
        }
    }

    /// Sentences about directions that the data leave open, the least determined first. Returns which of the m parameters each names.
    fn tell_undetermined(&mut self, problem: &Problem, z: &[f64], spread: &Spread) -> Vec<Vec<usize>> {
        let (names, values, inner) = (Names { problem }, problem.values(z), &spread.inner);
        let mut told: Vec<Vec<usize>> = Vec::new();
        for (vector, variance) in spread.vectors.iter().zip(&spread.variances) {
            let size = variance.sqrt();
            if size <= UNDETERMINED {
                break;
            }
            let top = vector.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let members: Vec<usize> = (0..inner.len()).filter(|&a| vector[a].abs() > NAMED * top).collect();
            // Of fields it is said how many values are open, not which.
            if members.iter().any(|&a| problem.of(inner[a]).count > 1) {
                continue;
            }
            // Two directions of the same pair say the same of it.
            if told.contains(&members) {
                continue;
            }
            self.warnings.push(match members.as_slice() {
                [a] => names.undetermined(inner[*a], size, values[inner[*a]], z[inner[*a]]),
                [a, b] => spread.alike(&names, *a, *b),
                many => {
                    let list: Vec<&str> = many.iter().map(|&a| names.path(inner[a])).collect();
                    let (last, first) = list.split_last().expect("more than two members are here");
                    let first = first.join(", ");
                    format!("{first} and {last} cannot be told apart: only some of their combinations are determined")
                }
            });
            told.push(members);
        }
        for (f, range) in problem.blocks().filter(|(f, _)| f.count > 1) {
            let open = self.errors_z[range].iter().flatten().filter(|e| **e > UNDETERMINED).count();
            if open > 0 {
                let (path, count, factor) = (&f.path, f.count, digits(UNDETERMINED.exp(), 2));
                self.warnings.push(format!("{path}: {open} of {count} values are not determined to within a factor of {factor}"));
            }
        }
        told
    }

    /// Sentences about pairs whose errors go together, where `told` does not name them already.
    fn tell_correlated(&mut self, problem: &Problem, spread: &Spread, told: &[Vec<usize>]) {
        let (names, inner, sd) = (Names { problem }, &spread.inner, &spread.sd);
        let direction = |k: usize| &problem.of(inner[k]).direction;
        let numbers: Vec<usize> = (0..inner.len()).filter(|a| problem.of(inner[*a]).count == 1).collect();
        for (k, &a) in numbers.iter().enumerate() {
            for &b in &numbers[k + 1..] {
                let r = self.correlation[inner[a]][inner[b]];
                // Components of a direction turn together.
                let turn = direction(a).is_some() && direction(a) == direction(b);
                if turn || r.abs() <= CORRELATED || told.iter().any(|t| t.contains(&a) && t.contains(&b)) {
                    continue;
                }
                self.warnings.push(if sd[a].max(sd[b]) > KNOWN {
                    spread.alike(&names, a, b)
                } else {
                    let (a, b) = (names.path(inner[a]), names.path(inner[b]));
                    format!("{a} and {b} are known, but their errors go together (correlation {r:.3})")
                });
            }
        }
    }
}

/// Sentences about starts that ended elsewhere with a cost that noise alone could explain: `n ΔJ` below half the χ² quantile
/// of q degrees of freedom, widened by the errors of [`Uncertainty`].
pub fn compare_starts(problem: &Problem, runs: &[StartRun], best: usize, u: &Uncertainty) -> Vec<String> {
    let q = problem.values_count();
    let quantile = ChiSquared::new(q as f64).map_or(2.0 * q as f64, |d| d.inverse_cdf(CONFIDENCE));
    let z_best = &runs[best].outcome.z;
    let limit = runs[best].outcome.cost + 0.5 * quantile * u.tau;
    let equal: Vec<&StartRun> = runs.iter().filter(|r| r.outcome.cost <= limit).collect();
    let mut sentences = Vec::new();
    let differs = |i: usize| {
        let allowed = u.errors_z[i].map_or(0.0, |e| 2.0 * quantile.sqrt() * e).max(CLOSE);
        equal.iter().any(|r| (r.outcome.z[i] - z_best[i]).abs() > allowed)
    };
    for (f, range) in problem.blocks() {
        let different: Vec<usize> = range.filter(|i| differs(*i)).collect();
        let Some(&i) = different.first() else { continue };
        let (of, starts) = (equal.len(), runs.len());
        if f.count > 1 {
            let (path, n, count) = (&f.path, different.len(), f.count);
            sentences.push(format!(
                "{path} is not unique: {of} of {starts} starts reach equal costs, and differ in {n} of {count} values"
            ));
            continue;
        }
        let ends: Vec<f64> = equal.iter().map(|r| problem.charts()[i].value(r.outcome.z[i])).collect();
        let (low, high) = ends.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
        sentences.push(format!(
            "{} is not unique: {of} of {starts} starts reach equal costs with values from {} to {}{}",
            f.path,
            digits(low, 4),
            digits(high, 4),
            unit_behind(&f.unit)
        ));
    }
    sentences
}

struct Names<'p, 'a> {
    problem: &'p Problem<'a>,
}

impl Names<'_, '_> {
    fn path(&self, i: usize) -> &str {
        &self.problem.of(i).path
    }

    fn undetermined(&self, i: usize, spread: f64, value: f64, z: f64) -> String {
        let f = self.problem.of(i);
        let range = if f.transform == Transform::Log {
            format!("a factor of {} up or down", digits(spread.min(300.0).exp(), 2))
        } else {
            let chart = &self.problem.charts()[i];
            let (low, high) = (chart.value(z - spread), chart.value(z + spread));
            let [low, value, high] = [low, value, high].map(|v| digits(v, 3));
            format!("anything from {low}{unit} to {high}{unit} around {value}{unit}", unit = unit_behind(&f.unit))
        };
        format!("{} is not determined: {range} changes the fit no more than the noise does", f.path)
    }

    /// Two parameters by their covariance: the combination of least variance is the one that is determined.
    fn alike(&self, i: usize, j: usize, var_i: f64, var_j: f64, cov: f64) -> String {
        // Eigenvector of the smaller eigenvalue of [[var_i, cov], [cov, var_j]], free of cancellation.
        let half = 0.5 * (var_i - var_j);
        let root = half.hypot(cov);
        let (mut x, mut y) = if half >= 0.0 { (-cov, half + root) } else { (root - half, -cov) };
        let norm = x.hypot(y);
        (x, y) = if norm > 0.0 { (x / norm, y / norm) } else { (1.0, 0.0) };
        if (if x.abs() >= y.abs() { x } else { y }) < 0.0 {
            (x, y) = (-x, -y);
        }
        let (a, b) = (self.problem.of(i), self.problem.of(j));
        let combination = if a.transform == Transform::Log && b.transform == Transform::Log {
            format!("{}^{x:.2}·{}^{y:.2}", short(&a.path), short(&b.path))
        } else {
            let term = |f: &crate::FreeParameter| match f.transform {
                Transform::Log => format!("ln {}", short(&f.path)),
                Transform::Logit => format!("logit {}", short(&f.path)),
                Transform::Relative => format!("ln(1 + {})", short(&f.path)),
                Transform::Linear => format!("{}/{}", short(&f.path), f.typical),
            };
            let sign = if y < 0.0 { '−' } else { '+' };
            format!("{x:.2}·{} {sign} {:.2}·{}", term(a), y.abs(), term(b))
        };
        format!("{} and {} cannot be told apart: only their combination {combination} is determined", a.path, b.path)
    }
}

/// A number for sentences with its first `n` digits, with an exponent only where it is very large or small.
fn digits(x: f64, n: usize) -> String {
    let rounded = format!("{x:.*e}", n.saturating_sub(1));
    number(rounded.parse().unwrap_or(x))
}

/// Last part of a path that says something: `youngs_modulus`, but `gravity.z` and `plane.0.height` whole.
fn short(path: &str) -> &str {
    path.strip_prefix("material.").unwrap_or(path)
}
