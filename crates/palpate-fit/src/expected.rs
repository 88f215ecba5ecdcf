//! What a recording would tell before anything is fitted: expected errors from sensitivities at one point alone.
//!
//! With H the Gauss–Newton matrix by z of n residuals, cov = τ H⁻¹ with τ = 1/n + systematic²/groups: residuals as large as the noise and errors of
//! their own, which is the best that a fit can do ([`crate::Settings::errors`]). Values may be taken together, as parts of a field.

use crate::dense::eigen;
use crate::optimise::Sample;
use crate::problem::{Problem, Want};
use crate::settings::ErrorModel;
use crate::{priors, uncertainty};
use palpate_engine::MOST_SENSITIVITIES;

/// Eigenvalues below this share of the largest are rounding errors.
const RANK: f64 = 1e-12;

/// What is to be expected of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// Standard error of every group in z (relative errors for logarithms), for a change that its values share.
    pub errors: Vec<f64>,
    /// Correlation of every two groups.
    pub correlation: Vec<Vec<f64>>,
    /// ½ Σ ln(λ/τ) over the eigenvalues λ of H: what two recordings differ by is how much more the one tells [nats].
    pub information: f64,
    /// Of groups of a field with a prior: the share of the prior's own variance, around the field's mean, that the recording takes away, 0 to 1.
    pub gain: Vec<Option<f64>>,
    /// Whether the recording tells of a group, as a fit would say afterwards.
    pub told: Vec<bool>,
    /// Residuals that it is taken from.
    pub residuals: usize,
}

/// Expected errors at values `[q]` of the problem, with values in groups that change together.
///
/// # Errors
/// Why it could not be simulated, or that nothing is seen.
pub fn expected(
    problem: &mut Problem,
    values: &[f64],
    groups: &[Vec<usize>],
    errors: &ErrorModel,
    hear: &mut dyn FnMut(usize),
) -> Result<Expected, String> {
    let z: Vec<f64> = problem.charts().iter().zip(values).map(|(c, v)| c.coordinate(*v)).collect();
    let (q, m) = (z.len(), groups.len());
    let whole = q <= MOST_SENSITIVITIES;
    let sample: Sample = problem.evaluate(std::slice::from_ref(&z), if whole { Want::Curvature } else { Want::Cost }).remove(0);
    if let Some(why) = sample.failure {
        return Err(why);
    }
    if sample.residuals == 0 {
        return Err("nothing is compared".into());
    }
    let mut h = vec![0.0; m * m];
    let mut prior = vec![0.0; m * m];
    for (a, group) in groups.iter().enumerate() {
        let mut along = vec![0.0; q];
        group.iter().for_each(|i| along[*i] = 1.0);
        let row: Vec<f64> = if whole {
            (0..q).map(|j| group.iter().map(|i| sample.curvature[i * q + j]).sum()).collect()
        } else {
            problem.product(&z, &along).map_err(|f| f.to_string())?
        };
        let before = problem.prior_product(&z, &along);
        for (b, other) in groups.iter().enumerate() {
            h[a * m + b] = other.iter().map(|j| row[*j]).sum();
            prior[a * m + b] = other.iter().map(|j| before[*j]).sum();
        }
        hear(a + 1);
    }
    // Products are symmetric but for rounding.
    let symmetric = |h: &[f64]| -> Vec<f64> { (0..m * m).map(|k| 0.5 * (h[k] + h[k % m * m + k / m])).collect() };
    let (h, prior) = (symmetric(&h), symmetric(&prior));
    let tau = 1.0 / sample.residuals as f64 + errors.systematic.powi(2) / errors.groups as f64;
    let (lambda, vectors) = eigen(&h, m).ok_or("the curvature of the cost is not finite")?;
    let largest = lambda.iter().fold(0.0, |m: f64, l| m.max(*l));
    if largest <= 0.0 {
        return Err("no free number changes what is read".into());
    }
    let lambda: Vec<f64> = lambda.into_iter().map(|l| l.max(RANK * largest)).collect();
    let covariance = |a: usize, b: usize| (0..m).map(|k| tau / lambda[k] * vectors[k][a] * vectors[k][b]).sum::<f64>();
    let (stiff, axes) = eigen(&prior, m).ok_or("the prior of a field is not finite")?;
    let most = stiff.iter().fold(0.0, |m: f64, l| m.max(*l));
    let before = |a: usize, b: usize| {
        (0..m).filter(|k| stiff[*k] > RANK * most).map(|k| tau / stiff[k] * axes[k][a] * axes[k][b]).sum::<f64>()
    };
    // Variance of a group around the mean of its field, which is all but free beforehand.
    let placed: Vec<_> = problem.priors().placed.iter().map(|p| p.range.clone()).collect();
    let field = |a: usize| groups[a].first().and_then(|i| placed.iter().position(|range| range.contains(i)));
    let alone = |a: usize| {
        let own: Vec<usize> = (0..m).filter(|b| field(*b) == field(a)).collect();
        let n = own.len() as f64;
        let rows = own.iter().map(|b| before(a, *b)).sum::<f64>() / n;
        let all = own.iter().map(|b| own.iter().map(|c| before(*b, *c)).sum::<f64>()).sum::<f64>() / (n * n);
        before(a, a) - 2.0 * rows + all
    };
    let gain = |a: usize| field(a).map(|_| (1.0 - covariance(a, a) / alone(a)).clamp(0.0, 1.0));
    let sd: Vec<f64> = (0..m).map(|a| covariance(a, a).sqrt()).collect();
    let correlation = (0..m).map(|a| (0..m).map(|b| covariance(a, b) / (sd[a] * sd[b])).collect()).collect();
    let information = 0.5 * lambda.iter().map(|l| (l / tau).ln()).sum::<f64>();
    let gain: Vec<Option<f64>> = (0..m).map(gain).collect();
    let told = gain.iter().zip(&sd).map(|(g, sd)| g.map_or(*sd < uncertainty::UNDETERMINED, |g| g >= priors::UNDETERMINED));
    Ok(Expected { told: told.collect(), errors: sd, correlation, information, gain, residuals: sample.residuals })
}
