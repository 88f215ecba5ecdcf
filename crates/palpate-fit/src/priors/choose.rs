//! The search for hyperparameters: fit, look at the evidence of all others around what was found, fit with the best, until that is the best.
//!
//! How many residuals count as one (t) is measured along with it, as what a fit leaves depends on both. It begins with the design effect where the
//! search begins: residuals of one value everywhere go together, so that t falls on the way. From t = 1 a field would first follow errors
//! that neighbouring readings share, and residuals without them would confirm it.

use super::evidence::{Quadratic, Tried, tried};
use super::lowrank::{LowRank, MOST_NUMBERS, Reduced};
use super::{Hyper, Priors};
use crate::fit::{FitError, Hooks};
use crate::journal::Journal;
use crate::multistart::{self, Begin, StartRun};
use crate::optimise::{Sample, Status, Stop};
use crate::problem::{Problem, Want};
use crate::settings::{Settings, Tolerance};

/// Most fits.
const ROUNDS: usize = 8;
/// Farthest step on the grid from one fit to the next, where the evidence of a quadratic around the last is still believed.
const STEPS: usize = 2;
/// Iterations of a fit on the way, and its distance from the optimum in standard errors: the evidence allows for the gradient that is left.
const ON_THE_WAY: (usize, f64) = (8, 0.1);
/// A change of t by less than this share changes nothing that matters.
const SAME: f64 = 0.1;

/// What a search for hyperparameters came to.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Choice {
    /// Hyperparameters of every prior.
    pub hypers: Vec<Hyper>,
    /// How many residuals count as one.
    pub temper: f64,
    /// What was tried around the last fit, by prior.
    pub tried: Vec<Vec<Tried>>,
    /// Values `[q]` where it began, and their cost then.
    pub start: Vec<f64>,
    pub start_cost: f64,
    /// Values `[q]` where it ended.
    pub values: Vec<f64>,
    /// Fits, and what they took together.
    pub fits: usize,
    pub iterations: usize,
    pub evaluations: usize,
    pub products: usize,
    /// False where the last fit was not at the best of those around it.
    pub settled: bool,
}

/// What is said of a point of a fit, for hyperparameters and errors.
pub(super) struct Look<'s> {
    pub reduced: Reduced<'s>,
    pub low: LowRank,
    /// ∇ of the data's minus log-likelihood by z `[q]`.
    pub gradient: Vec<f64>,
    /// The same with that of the priors.
    pub whole: Vec<f64>,
    /// Reduced χ² of the data alone, for as many numbers as they tell.
    pub chi_square: f64,
}

/// Numbers of a problem that have no prior of fields.
pub(super) fn numbers(problem: &Problem) -> Result<Vec<usize>, String> {
    let all: Vec<usize> = problem.blocks().filter(|(f, _)| f.prior.is_none()).flat_map(|(_, range)| range).collect();
    match all.len() > MOST_NUMBERS {
        true => Err(format!("{} values without a prior are free beside a field with one; {MOST_NUMBERS} may be", all.len())),
        false => Ok(all),
    }
}

impl<'s> Look<'s> {
    /// At z `[q]` with the sample there, which may lack a gradient.
    pub fn new(problem: &mut Problem, z: &[f64], sample: &Sample, over: &'s dyn Fn() -> bool) -> Result<Look<'s>, Stop> {
        let priors: Priors = problem.priors().clone();
        let again = match sample.gradient.is_empty() {
            true => problem.evaluate(&[z.to_vec()], Want::Gradient).swap_remove(0),
            false => sample.clone(),
        };
        if let Some(why) = &again.failure {
            return Err(if again.stopped { Stop::Interrupted } else { Stop::Broken(why.clone()) });
        }
        let sample = &again;
        let values = problem.values(z);
        let free = numbers(problem).map_err(Stop::Broken)?;
        let inner: Vec<usize> = free.into_iter().filter(|i| problem.charts()[*i].at_bound(values[*i]).is_none()).collect();
        let reduced = Reduced::new(problem, &priors, z, inner, over)?;
        let low = reduced.low_rank(problem)?;
        let (energy, slope) = priors.energy(z);
        let n = problem.residual_count();
        let weight = n / priors.temper;
        let whole: Vec<f64> = sample.gradient.iter().map(|g| weight * g).collect();
        let gradient = whole.iter().zip(slope).map(|(g, s)| g - s).collect();
        let told = low.effective() + reduced.numbers.len() as f64;
        let known: f64 = problem.known_rows(&values).iter().map(|r| 0.5 * r.residual * r.residual).sum();
        let data = sample.cost - (energy + known) / weight;
        let chi_square = if n > told { 2.0 * n * data / (n - told) } else { f64::NAN };
        Ok(Look { reduced, low, gradient, whole, chi_square })
    }
}

/// How a search for hyperparameters ended.
pub(crate) enum Ended {
    /// Found.
    Found(Choice),
    /// A fit ended before, and is the result.
    Cut(Box<StartRun>),
}

/// Fits with hyperparameters until they are the best around.
///
/// # Errors
/// As a fit.
pub(crate) fn choose(
    problem: &mut Problem,
    settings: &Settings,
    hooks: &mut Hooks,
    mut journal: Option<&mut Journal>,
) -> Result<Ended, FitError> {
    if !problem.has_products() {
        return Err(FitError::NoStart(
            "a prior of a field needs products with the Gauss-Newton matrix, which are not computed".into(),
        ));
    }
    if let Some(choice) = journal.as_mut().and_then(|j| j.chosen()) {
        problem.set_priors(&choice.hypers, choice.temper).map_err(FitError::NoStart)?;
        return Ok(Ended::Found(choice));
    }
    numbers(problem).map_err(FitError::NoStart)?;
    let (iterations, decrement) = (settings.iterations.min(ON_THE_WAY.0), settings.tolerance.decrement.max(ON_THE_WAY.1));
    let tolerance = Tolerance { decrement, ..settings.tolerance.clone() };
    let one = Settings { starts: 1, iterations, tolerance, ..settings.clone() };
    let stop = hooks.interrupt.clone();
    let over = || stop.is_over();
    let first: Vec<Hyper> = problem.priors().placed.iter().map(|p| p.hyper).collect();
    let mut choice = Choice { temper: design_effect(problem, settings, hooks, &problem.own_values()), ..Choice::default() };
    problem.set_priors(&first, choice.temper).map_err(FitError::NoStart)?;
    for _ in 0..ROUNDS {
        let first = (choice.fits > 0).then(|| Begin::given(choice.values.clone(), choice.evaluations, choice.iterations));
        let mut run = multistart::run(problem, &one, hooks, journal.as_deref_mut(), first)?.swap_remove(0);
        if choice.fits == 0 {
            (choice.start, choice.start_cost) = (problem.values(&run.start), run.outcome.start_cost);
        }
        choice.fits += 1;
        choice.iterations += run.outcome.iterations;
        choice.evaluations += run.outcome.evaluations;
        choice.products += run.outcome.products;
        let cut = matches!(run.outcome.status, Status::Interrupted | Status::Broken(_));
        let Some(sample) = run.outcome.sample.clone().filter(|_| !cut) else { return Ok(choice.cut(problem, run)) };
        let z = &run.outcome.z.clone();
        choice.values = problem.values(z);
        let look = match Look::new(problem, z, &sample, &over) {
            Ok(look) => look,
            Err(stop) => {
                run.outcome.status = stop.into();
                return Ok(choice.cut(problem, run));
            }
        };
        let design = design_effect(problem, settings, hooks, &choice.values);
        let temper = design * look.chi_square.max(1.0);
        let before = problem.priors().clone();
        let mut m = vec![0.0; z.len()];
        before.placed.iter().for_each(|p| m[p.range.clone()].copy_from_slice(&p.logarithms(z)));
        let quadratic = Quadratic::new(&look.reduced, &look.low, &m, &look.gradient, before.temper / temper);
        choice.hypers = before.placed.iter().map(|p| p.hyper).collect();
        choice.tried.clear();
        for (field, p) in before.placed.iter().enumerate() {
            let mut all = tried(&quadratic, &before.placed, &look.reduced, field).map_err(FitError::NoStart)?;
            choice.hypers[field] = best(&all, p.hyper);
            let top = all.iter().map(|t| t.evidence).fold(f64::NEG_INFINITY, f64::max);
            all.iter_mut().for_each(|t| t.evidence -= top);
            choice.tried.push(all);
        }
        choice.settled =
            before.placed.iter().zip(&choice.hypers).all(|(p, h)| p.hyper == *h) && (temper / before.temper).ln().abs() < SAME;
        if choice.settled {
            break;
        }
        choice.temper = temper;
        problem.set_priors(&choice.hypers, temper).map_err(FitError::NoStart)?;
    }
    if let Some(journal) = journal {
        journal.choose(&choice)?;
    }
    Ok(Ended::Found(choice))
}

/// How many residuals go together at values `[q]`.
fn design_effect(problem: &Problem, settings: &Settings, hooks: &mut Hooks, values: &[f64]) -> f64 {
    let theta: Vec<Vec<f64>> = (0..problem.scenes().len()).map(|s| problem.theta(s, values)).collect();
    hooks.design_effect.as_mut().map_or(settings.errors.design_effect, |ask| ask(&theta)).max(1.0)
}

impl Choice {
    /// A fit that ended the search, as one with all that was done before.
    fn cut(&self, problem: &Problem, mut run: StartRun) -> Ended {
        self.add_to(problem, &mut run);
        let o = &mut run.outcome;
        // Its own part was added already.
        (o.iterations, o.evaluations, o.products) = (self.iterations, self.evaluations, self.products);
        Ended::Cut(Box::new(run))
    }

    /// What was done before a search that went on from here, so that it counts as one with that.
    pub fn add_to(&self, problem: &Problem, run: &mut StartRun) {
        run.start = problem.charts().iter().zip(&self.start).map(|(c, v)| c.coordinate(*v)).collect();
        let o = &mut run.outcome;
        o.start_cost = self.start_cost;
        o.iterations += self.iterations;
        o.evaluations += self.evaluations;
        o.products += self.products;
    }
}

/// The best of those that lie no more than [`STEPS`] from `now` on the grid.
fn best(tried: &[Tried], now: Hyper) -> Hyper {
    let axis = |of: fn(&Hyper) -> f64| {
        let mut all: Vec<f64> = tried.iter().filter(|t| t.hyper.deviation > 0.0).map(|t| of(&t.hyper)).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let (lengths, deviations) = (axis(|h| h.length), axis(|h| h.deviation));
    let place = |axis: &[f64], x: f64| axis.partition_point(|a| *a < x * (1.0 - 1e-9));
    let near = |axis: &[f64], x: f64, from: f64| place(axis, x).abs_diff(place(axis, from)) <= STEPS;
    tried
        .iter()
        .filter(|t| t.hyper.deviation > 0.0)
        .filter(|t| near(&lengths, t.hyper.length, now.length) && near(&deviations, t.hyper.deviation, now.deviation))
        .max_by(|a, b| a.evidence.total_cmp(&b.evidence))
        .map_or(now, |t| t.hyper)
}
