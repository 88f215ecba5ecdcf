//! What is known of a field after the recording was looked at: the Gaussian posterior around what was found, as the prior's covariance minus an
//! update of low rank (Bui-Thanh et al. 2013).

use super::choose::{Choice, Look};
use super::evidence::{Quadratic, tried};
use super::mixture::mixture;
use super::{Hyper, Tried};
use crate::dense::dot;
use crate::optimise::{Sample, Stop};
use crate::problem::Problem;
use crate::uncertainty::{self, Uncertainty};
use palpate_model::params::fields::PriorKind;

/// A value is undetermined where the recording lowers its variance by less than this share.
pub const UNDETERMINED: f64 = 0.1;
/// Logarithms of evidences that differ by less tell nothing apart.
const ALIKE: f64 = 2.0;

/// What is known of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldPosterior {
    /// Kind of its prior.
    pub kind: PriorKind,
    /// Numbers of its prior.
    pub hyper: Hyper,
    /// Whether the data chose length and deviation.
    pub chosen: (bool, bool),
    /// Evidence of all that were tried, around what was found.
    pub tried: Vec<Tried>,
    /// How many residuals count as one reading of the stated noise.
    pub temper: f64,
    /// Standard deviation of the logarithm of each value `[N]`, over all priors that were tried by the weight of their evidence.
    pub deviation: Vec<f64>,
    /// The same before the recording was looked at, around the field's mean `[N]`.
    pub prior_deviation: Vec<f64>,
    /// Share of that variance which the recording took away, 0 where it left more than that around the mean `[N]`.
    pub gain: Vec<f64>,
    /// Values of which the recording says next to nothing `[N]`.
    pub undetermined: Vec<bool>,
    /// Their share of the body's volume.
    pub undetermined_share: f64,
    /// Σ μ/(1+μ): how many numbers the recording tells of all fields with priors.
    pub effective: f64,
}

/// What [`assess`] found.
pub(crate) struct Assessed {
    pub uncertainty: Uncertainty,
    /// By prior.
    pub fields: Vec<FieldPosterior>,
    /// Distance from the optimum in standard errors.
    pub distance: f64,
}

/// Errors of all free values at z `[q]` with the sample there.
///
/// # Errors
/// The fit is to end, or what computes broke.
pub(crate) fn assess(
    problem: &mut Problem,
    z: &[f64],
    sample: &Sample,
    choice: Option<&Choice>,
    design: f64,
    over: &dyn Fn() -> bool,
) -> Result<Assessed, Stop> {
    let look = Look::new(problem, z, sample, over)?;
    let (reduced, low) = (&look.reduced, &look.low);
    let mut u = uncertainty::assess(problem, z, &Sample::default(), &Default::default());
    let n = problem.residual_count();
    u.reduced_chi_square = look.chi_square;
    u.independent = n / design;
    let priors = problem.priors().clone();
    u.tau = priors.temper / n;
    let mut m = vec![0.0; z.len()];
    priors.placed.iter().for_each(|p| m[p.range.clone()].copy_from_slice(&p.logarithms(z)));
    let quadratic = Quadratic::new(reduced, low, &m, &look.gradient, 1.0);
    let mut fields = Vec::new();
    for (k, ((range, p), placed)) in reduced.blocks.iter().zip(&priors.placed).enumerate() {
        let broken = |e: String| Stop::Broken(e);
        let mut tried = tried(&quadratic, &priors.placed, reduced, k).map_err(broken)?;
        let (after, prior) = match tried.len() > 2 {
            true => {
                let mixed = mixture(&quadratic, (&priors.placed, reduced), k, &tried, &m[range.clone()]).map_err(broken)?;
                (mixed.after, mixed.before)
            }
            // One prior and one value everywhere: nothing to mix.
            false => {
                let (prior, mean) = (p.marginal(), p.mean_deviation().powi(2));
                let taken = |i: usize| low.values.iter().zip(&low.along).map(|(m, x)| m / (1.0 + m) * x[i] * x[i]).sum::<f64>();
                // What draws estimate may fall below what is exact.
                (range.clone().zip(&prior).map(|(i, v)| (v + mean - taken(i)).max(1e-6 * v)).collect(), prior)
            }
        };
        let top = tried.iter().map(|t| t.evidence).fold(f64::NEG_INFINITY, f64::max);
        tried.iter_mut().for_each(|t| t.evidence -= top);
        let gain: Vec<f64> = after.iter().zip(&prior).map(|(a, b)| (1.0 - a / b).max(0.0)).collect();
        let undetermined: Vec<bool> = gain.iter().map(|g| *g < UNDETERMINED).collect();
        let around = &placed.prior.around;
        let open: f64 = around.volume.iter().zip(&undetermined).filter(|(_, u)| **u).map(|(v, _)| v).sum::<f64>() + 0.0;
        for (i, v) in range.clone().zip(&after) {
            u.errors_z[i] = Some(v.sqrt());
            u.standard_errors[i] = Some(v.sqrt() * problem.charts()[i].slope(z[i]));
            u.noise_errors[i] = u.standard_errors[i];
        }
        fields.push(FieldPosterior {
            kind: placed.prior.kind,
            hyper: placed.hyper,
            chosen: (placed.prior.length.is_none() && placed.prior.kind == PriorKind::Matern, placed.prior.deviation.is_none()),
            tried,
            temper: priors.temper,
            deviation: after.iter().map(|v| v.sqrt()).collect(),
            prior_deviation: prior.iter().map(|v| v.sqrt()).collect(),
            gain,
            undetermined,
            undetermined_share: open / around.whole(),
            effective: low.effective(),
        });
    }
    number_errors(problem, z, &look, &mut u);
    let names: Vec<String> = problem.blocks().filter(|(f, _)| f.prior.is_some()).map(|(f, _)| f.path.clone()).collect();
    names.iter().zip(&fields).for_each(|(path, f)| u.warnings.extend(f.open_questions(path)));
    if choice.is_some_and(|c| !c.settled) {
        u.warnings.push("the search for the prior's numbers went back and forth: those reported are the last".into());
    }
    Ok(Assessed { distance: distance(&look), uncertainty: u, fields })
}

/// √(gᵀ C g) with the whole gradient g, the data's and the prior's.
fn distance(look: &Look) -> f64 {
    let (reduced, low) = (&look.reduced, &look.low);
    // The prior's gradient by fields is that of the precision which touches it.
    let g = reduced.without_numbers(&look.whole);
    let solved = reduced.prior_solve(&g);
    let by_fields = dot(&g, &low.posterior(solved, &g));
    let y: Vec<f64> = reduced.numbers.iter().map(|k| look.whole[*k]).collect();
    let by_numbers: f64 = (0..y.len()).map(|a| y[a] * dot(&reduced.inverse[a * y.len()..(a + 1) * y.len()], &y)).sum();
    (by_fields.max(0.0) + by_numbers.max(0.0)).sqrt()
}

/// Standard errors and correlations of the numbers beside the fields: A_yy⁻¹ and what follows from the field's own.
fn number_errors(problem: &Problem, z: &[f64], look: &Look, u: &mut Uncertainty) {
    let (reduced, low) = (&look.reduced, &look.low);
    let follow = reduced.follow();
    let spread: Vec<Vec<f64>> = follow.iter().map(|f| low.posterior(reduced.prior_solve(f), f)).collect();
    let (y, correlated) = (reduced.numbers.len(), !u.correlation.is_empty());
    let covariance = |a: usize, b: usize| reduced.inverse[a * y + b] + dot(&follow[a], &spread[b]);
    for (a, &i) in reduced.numbers.iter().enumerate() {
        let sd = covariance(a, a).max(0.0).sqrt();
        u.errors_z[i] = Some(sd);
        u.standard_errors[i] = Some(sd * problem.charts()[i].slope(z[i]));
        u.noise_errors[i] = u.standard_errors[i];
        for (b, &j) in reduced.numbers.iter().enumerate().filter(|(b, _)| *b != a && correlated) {
            u.correlation[i][j] = (covariance(a, b) / (sd * covariance(b, b).max(0.0).sqrt())).clamp(-1.0, 1.0);
        }
    }
}

impl FieldPosterior {
    /// Sentences on what the recording does not decide about the prior.
    fn open_questions(&self, path: &str) -> Vec<String> {
        let mut out = Vec::new();
        let alike: Vec<Hyper> =
            self.tried.iter().filter(|t| t.evidence > -ALIKE && t.hyper.deviation > 0.0).map(|t| t.hyper).collect();
        let range = |of: fn(&Hyper) -> f64, all: &mut dyn Iterator<Item = Hyper>| {
            all.map(|h| of(&h)).fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), x| (a.min(x), b.max(x)))
        };
        let tried = || self.tried.iter().map(|t| t.hyper).filter(|h| h.deviation > 0.0);
        let (own, all) = (range(|h| h.length, &mut alike.iter().copied()), range(|h| h.length, &mut tried()));
        if self.chosen.0 && !alike.is_empty() && own == all {
            out.push(format!(
                "{path}: the recording does not decide over which length its values are alike: {:.3} m to {:.3} m explain it as well",
                own.0, own.1
            ));
        }
        let (own, all) = (range(|h| h.deviation, &mut alike.iter().copied()), range(|h| h.deviation, &mut tried()));
        if self.chosen.1 && !alike.is_empty() && own == all {
            out.push(format!(
                "{path}: the recording does not decide how much its values differ: deviations of the logarithm from {} to {} explain it as well",
                own.0, own.1
            ));
        }
        if self.one_value().is_some_and(|e| e > -ALIKE) {
            out.push(format!("{path}: one value everywhere explains the recording as well; that it varies is not shown"));
        }
        out
    }

    /// Log-evidence of one value everywhere, over that of the best.
    pub fn one_value(&self) -> Option<f64> {
        self.tried.iter().find(|t| t.hyper.deviation == 0.0).map(|t| t.evidence)
    }
}
