//! Optimisers over z: each walks a [`Search`], which counts, guards against failures and keeps the best point.

mod conjugate;
mod descent;
mod gauss_newton;
mod lbfgs;
mod line;
mod metric;
mod rprop;
mod simplex;
mod watchdog;

use crate::dense::max_abs;
use crate::priors::Priors;
use crate::problem::Want;
use crate::settings::{Settings, Walk};
use palpate_model::scene::Optimizer;

/// Added to a unit diagonal, so that what changes nothing stays put.
const LENGTHS: f64 = 1e-10;

/// Share of readings that meet nothing up to which a start sees enough: outliers and the edges of images.
const LOST: f64 = 0.05;
/// Share from which on the few that are met are chance: a body that was thrown away passes some of them on its way.
const NEARLY_ALL: f64 = 0.9;

/// Cost and derivatives at one point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// Cost, infinite if it could not be computed.
    pub cost: f64,
    /// Gradient `[q]`; empty unless requested.
    pub gradient: Vec<f64>,
    /// Gauss–Newton matrix `[q, q]`, row-major; empty unless requested.
    pub curvature: Vec<f64>,
    /// Scalar residuals in all scenes.
    pub residuals: usize,
    /// Those of them that met nothing, and tell of the parameters nothing.
    pub unmatched: usize,
    /// Why there is no cost.
    pub failure: Option<String>,
    /// True where there is none because what computes broke: the point is not to blame.
    pub broken: bool,
    /// True where there is none because somebody asked to stop.
    pub stopped: bool,
}

impl Sample {
    /// A point where the cost could not be computed.
    pub fn failed(why: String) -> Sample {
        Sample { cost: f64::INFINITY, failure: Some(why), ..Sample::default() }
    }

    /// The undamped Gauss–Newton step −H⁻¹g `[q]` along some axes, with the others held: where the model of the cost at this point has its
    /// minimum. `None` without curvature, or where it does not determine all of them.
    pub fn gauss_newton_step(&self, free: &[usize]) -> Option<Vec<f64>> {
        let (q, m) = (self.gradient.len(), free.len());
        if self.curvature.len() != q * q || m == 0 {
            return None;
        }
        // Parameters may differ by many orders of magnitude: scaled to a unit diagonal.
        let scale: Vec<f64> = free.iter().map(|i| self.curvature[i * q + i].sqrt()).collect();
        let h: Vec<f64> =
            (0..m * m).map(|k| self.curvature[free[k / m] * q + free[k % m]] / (scale[k / m] * scale[k % m])).collect();
        // The length of a vector of which only the direction counts is no unknown: nothing pulls at it.
        let h: Vec<f64> = h.iter().enumerate().map(|(k, h)| if k / m == k % m { h * (1.0 + LENGTHS) } else { *h }).collect();
        let g: Vec<f64> = free.iter().zip(&scale).map(|(i, s)| -self.gradient[*i] / s).collect();
        let mut step = vec![0.0; q];
        for ((i, d), s) in free.iter().zip(crate::dense::solve(&h, &g)?).zip(&scale) {
            step[*i] = d / s;
        }
        Some(step)
    }

    /// Distance to the optimum in standard errors, for a decrease of the cost that is promised to q parameters; infinite where no residuals
    /// are counted.
    pub(crate) fn decrement(&self, q: usize, promised: f64) -> f64 {
        let (n, q) = (self.residuals as f64, q as f64);
        if n == 0.0 {
            return f64::INFINITY;
        }
        let s_square = if n > q { (2.0 * n * self.cost / (n - q)).max(1.0) } else { 1.0 };
        (2.0 * n * promised.max(0.0) / s_square).sqrt()
    }

    /// Multiplies cost and derivatives by one number.
    pub fn scale(&mut self, by: f64) {
        self.cost *= by;
        self.gradient.iter_mut().chain(&mut self.curvature).for_each(|x| *x *= by);
    }

    /// Chain rule for a change of variable along each axis.
    pub fn scale_axes(&mut self, slopes: &[f64]) {
        let q = slopes.len();
        self.gradient.iter_mut().zip(slopes).for_each(|(g, s)| *g *= s);
        for (k, x) in self.curvature.iter_mut().enumerate() {
            *x *= slopes[k / q] * slopes[k % q];
        }
    }
}

/// Why no sample came back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The fit is to end now.
    Interrupted,
    /// What computes broke, in its words.
    Broken(String),
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Status {
    /// A stopping criterion was met.
    Converged,
    /// The iterations were used up.
    IterationLimit,
    /// No better point could be found although no criterion was met.
    Stalled,
    /// The start could not be evaluated, or the run broke off.
    Failed(String),
    /// From the start nothing could be seen: readings met nothing, and some parameter changes none of those that did.
    Blind,
    /// The fit was interrupted.
    Interrupted,
    /// What computes broke, in its words.
    Broken(String),
}

impl From<Stop> for Status {
    fn from(stop: Stop) -> Status {
        match stop {
            Stop::Interrupted => Status::Interrupted,
            Stop::Broken(why) => Status::Broken(why),
        }
    }
}

impl Status {
    /// Name in result files.
    pub fn name(&self) -> &'static str {
        match self {
            Status::Converged => "converged",
            Status::IterationLimit => "iteration-limit",
            Status::Stalled => "stalled",
            Status::Failed(_) => "failed",
            Status::Blind => "blind",
            Status::Interrupted => "interrupted",
            Status::Broken(_) => "broken-off",
        }
    }
}

/// What an optimiser asks for at every point.
pub fn want(optimizer: Optimizer) -> Want {
    match optimizer {
        Optimizer::GaussNewton => Want::Curvature,
        Optimizer::NelderMead => Want::Cost,
        Optimizer::Rprop | Optimizer::GradientDescent | Optimizer::Lbfgs | Optimizer::GaussNewtonCg => Want::Gradient,
    }
}

/// From z and a direction, both `[q]`, to the product with the Gauss–Newton matrix at z.
type Product<'a> = dyn FnMut(&[f64], &[f64]) -> Result<Vec<f64>, Stop> + 'a;

/// A search from one start.
pub struct Search<'a> {
    evaluate: &'a mut dyn FnMut(&[f64]) -> Result<Sample, Stop>,
    progress: &'a mut dyn FnMut(usize, f64, &[f64]),
    product: Option<&'a mut Product<'a>>,
    /// Priors of fields, whose precision conditions products.
    priors: Option<&'a Priors>,
    /// Whether a start from which nothing can be seen ends it.
    sight: bool,
    /// Smallest z `[q]`; may be −∞.
    pub lower: &'a [f64],
    /// Largest z `[q]`; may be ∞.
    pub upper: &'a [f64],
    /// Limits and tolerances.
    pub settings: &'a Settings,
    /// How Gauss–Newton stands.
    pub walk: Walk,
    best: Option<(Vec<f64>, Sample)>,
    start_cost: f64,
    evaluations: usize,
    products: usize,
    iterations: usize,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Best point `[q]`.
    pub z: Vec<f64>,
    /// Its cost; infinite if no point could be evaluated.
    pub cost: f64,
    /// Cost at the start.
    pub start_cost: f64,
    /// Iterations done.
    pub iterations: usize,
    /// Evaluations used.
    pub evaluations: usize,
    /// Products with the Gauss–Newton matrix used.
    pub products: usize,
    /// How Gauss–Newton stood, for [`Settings::walk`] of a search that goes on from here.
    pub walk: Walk,
    /// By how much the curvature at z promises to lower the cost further, where sensitivities give one; 0 without.
    pub promised: f64,
    /// How it ended.
    pub status: Status,
    /// Cost and derivatives at z, as far as the optimiser asked for them; `None` if no point could be evaluated.
    pub sample: Option<Sample>,
}

/// True where readings meet nothing, and a parameter changes none of those that do: a search would not move it.
pub(crate) fn is_unmoved(sample: &Sample) -> bool {
    let (n, lost) = (sample.residuals, sample.unmatched);
    n > 0 && (lost == n || lost as f64 > LOST * n as f64 && sample.gradient.contains(&0.0))
}

/// The same, or where next to none of the readings meet anything: a search would settle on chance.
pub(crate) fn is_blind(sample: &Sample) -> bool {
    is_unmoved(sample) || sample.residuals > 0 && sample.unmatched as f64 > NEARLY_ALL * sample.residuals as f64
}

impl<'a> Search<'a> {
    /// A search in a box of z; `evaluate` gives samples, `progress` hears of every iteration (number, cost, z).
    pub fn new(
        evaluate: &'a mut dyn FnMut(&[f64]) -> Result<Sample, Stop>,
        progress: &'a mut dyn FnMut(usize, f64, &[f64]),
        lower: &'a [f64],
        upper: &'a [f64],
        settings: &'a Settings,
    ) -> Search<'a> {
        Search {
            evaluate,
            progress,
            product: None,
            priors: None,
            sight: false,
            lower,
            upper,
            settings,
            walk: settings.walk,
            best: None,
            start_cost: f64::INFINITY,
            evaluations: 0,
            products: 0,
            iterations: 0,
        }
    }

    /// The same search with products for [`Optimizer::GaussNewtonCg`].
    #[must_use]
    pub fn with_products(self, product: &'a mut Product<'a>) -> Search<'a> {
        Search { product: Some(product), ..self }
    }

    /// The same search, for a problem with these priors of fields.
    #[must_use]
    pub(crate) fn with_priors(self, priors: &'a Priors) -> Search<'a> {
        Search { priors: Some(priors).filter(|p| !p.is_empty()), ..self }
    }

    /// The same search, which ends as [`Status::Blind`] at a start from which nothing can be seen.
    #[must_use]
    pub fn with_sight(self, sight: bool) -> Search<'a> {
        Search { sight, ..self }
    }

    /// Runs an optimiser from `z`.
    pub fn run(mut self, optimizer: Optimizer, z: &[f64]) -> Outcome {
        let start = self.project(z);
        let status = match self.evaluate(&start) {
            Err(stop) => stop.into(),
            Ok(Sample { failure: Some(why), .. }) => Status::Failed(why),
            Ok(first) => {
                self.start_cost = first.cost;
                (self.progress)(0, first.cost, &start);
                let walk = match optimizer {
                    _ if self.sight && is_blind(&first) => Ok(Status::Blind),
                    Optimizer::GaussNewton => gauss_newton::minimise(&mut self, start.clone(), first),
                    Optimizer::GaussNewtonCg => gauss_newton::minimise_by_products(&mut self, start.clone(), first),
                    Optimizer::Rprop => rprop::minimise(&mut self, start.clone(), first),
                    Optimizer::GradientDescent => descent::minimise(&mut self, start.clone(), first),
                    Optimizer::Lbfgs => lbfgs::minimise(&mut self, start.clone(), first),
                    Optimizer::NelderMead => simplex::minimise(&mut self, start.clone(), first),
                };
                walk.unwrap_or_else(Status::from)
            }
        };
        let promised = match (optimizer, self.best.clone()) {
            (Optimizer::GaussNewton, Some((z, at))) => gauss_newton::promised(&mut self, &z, &at),
            _ => 0.0,
        };
        let Search { start_cost, iterations, evaluations, products, walk, best, .. } = self;
        let (z, sample) = best.map_or((start, None), |(z, s)| (z, Some(s)));
        let cost = sample.as_ref().map_or(f64::INFINITY, |s| s.cost);
        Outcome { z, cost, start_cost, iterations, evaluations, products, walk, promised, status, sample }
    }

    /// Evaluates a point. Whatever is not a number counts as a failed point with infinite cost.
    fn evaluate(&mut self, z: &[f64]) -> Result<Sample, Stop> {
        let mut sample = (self.evaluate)(z)?;
        self.evaluations += 1;
        if sample.failure.is_none() {
            let derivatives = sample.gradient.iter().chain(&sample.curvature);
            if !sample.cost.is_finite() || derivatives.into_iter().any(|x| !x.is_finite()) {
                sample = Sample::failed("the cost or its derivatives are not finite".into());
            } else if self.best.as_ref().is_none_or(|(_, best)| sample.cost < best.cost) {
                self.best = Some((z.to_vec(), sample.clone()));
            }
        }
        Ok(sample)
    }

    /// The product of the Gauss–Newton matrix at z with a direction.
    fn product(&mut self, z: &[f64], direction: &[f64]) -> Result<Vec<f64>, Stop> {
        let product = self.product.as_mut().ok_or_else(|| Stop::Broken("this search has no products".into()))?;
        self.products += 1;
        product(z, direction)
    }

    /// Counts an iteration that ended at z.
    fn iterated(&mut self, cost: f64, z: &[f64]) {
        self.iterations += 1;
        (self.progress)(self.iterations, cost, z);
    }

    fn out_of_iterations(&self) -> bool {
        self.iterations >= self.settings.iterations
    }

    fn project(&self, z: &[f64]) -> Vec<f64> {
        (0..z.len()).map(|i| z[i].clamp(self.lower[i], self.upper[i])).collect()
    }

    /// Gradient without the parts that push against a bound.
    fn projected_gradient(&self, z: &[f64], g: &[f64]) -> Vec<f64> {
        let against = |i: usize| (g[i] > 0.0 && z[i] <= self.lower[i]) || (g[i] < 0.0 && z[i] >= self.upper[i]);
        (0..z.len()).map(|i| if against(i) { 0.0 } else { g[i] }).collect()
    }

    /// Distance to the optimum in standard errors, for a decrease of the cost that the curvature promises.
    fn decrement(&self, at: &Sample, promised: f64) -> f64 {
        if let Some(priors) = self.priors {
            return (2.0 * at.residuals as f64 * promised.max(0.0) / priors.temper).sqrt();
        }
        at.decrement(self.lower.len(), promised)
    }

    /// True where moving z by one would change the cost by no more than `tolerance.gradient` of itself.
    fn is_flat(&self, z: &[f64], sample: &Sample) -> bool {
        max_abs(&self.projected_gradient(z, &sample.gradient)) <= self.settings.tolerance.gradient * sample.cost.abs()
    }
}
