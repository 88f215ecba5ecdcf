//! What is fitted to what: free parameters, and the scenes that share them.

use crate::chart::Chart;
use crate::known;
use crate::optimise::{Sample, is_blind, want};
use crate::priors::{FieldPrior, Priors};
use palpate_engine::{Evaluate, Evaluation, Failure, FailureKind, ParamBatch, Request, Wanted};
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;

/// Where a free parameter acts: `theta[scene][place] = value · factor`; value k of a field at `place + k`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slot {
    /// Number of the scene in [`Problem::scenes`].
    pub scene: usize,
    /// Place in that scene's θ.
    pub place: usize,
    /// θ per unit of the parameter: 1, or a change of variable such as 1/volume for `material.mass` over density.
    pub factor: f64,
}

/// One free number, or the values of a free field, which share everything but their places.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParameter {
    /// Path as the user wrote it.
    pub path: String,
    /// SI unit, `1` for none.
    pub unit: String,
    /// How optimisers see it.
    pub transform: Transform,
    /// A size at which it matters, positive.
    pub typical: f64,
    /// Allowed range.
    pub bounds: (f64, f64),
    /// Where starts are drawn from; equal ends fix the start.
    pub start: (f64, f64),
    /// Value and standard deviation that are known beforehand, in its own unit: a Gaussian prior, of every value of a field.
    pub known: Option<(f64, f64)>,
    /// What is expected of a field's values together.
    pub prior: Option<FieldPrior>,
    /// Places that follow it; at least one.
    pub slots: Vec<Slot>,
    /// How many values follow each other from every slot's place on: 1 for a number.
    pub count: usize,
    /// The vector that it is a component of, where only the direction of that counts: its length is no unknown.
    pub direction: Option<String>,
}

/// One scene of a joint fit.
pub struct FitScene<'a> {
    /// Name for messages.
    pub name: String,
    /// Identifies what stands behind `evaluate` (recording, frames, grid), so that a journal of another problem is refused.
    pub fingerprint: String,
    /// θ with the scene's own values `[P]`.
    pub base: Vec<f64>,
    /// The physics.
    pub evaluate: Box<dyn Evaluate + 'a>,
}

/// What a round of evaluations asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Want {
    /// Cost alone.
    Cost,
    /// Cost and adjoint gradient.
    Gradient,
    /// Cost, and gradient and Gauss–Newton curvature from forward sensitivities.
    Curvature,
}

/// A joint fit of one or more scenes. Its cost is `Σ n_s J_s / Σ n_s` with n_s the residual count of scene s, so that every
/// residual counts once; what is known of values beforehand ([`crate::KnownRow`]) and priors of fields ([`crate::FieldPrior`]) add to it. The free
/// values of all parameters, one after the other, are the vector `[q]` that optimisers see.
pub struct Problem<'a> {
    scenes: Vec<FitScene<'a>>,
    free: Vec<FreeParameter>,
    /// First value of each parameter; the last entry is q.
    firsts: Vec<usize>,
    /// Of every value `[q]`.
    charts: Vec<Chart>,
    /// Residuals n_s of every scene when it was last evaluated.
    residuals: Vec<f64>,
    /// True once they were counted.
    counted: bool,
    priors: Priors,
}

impl<'a> Problem<'a> {
    /// Checks a problem; the error names the parameter or scene and says what is allowed.
    pub fn new(scenes: Vec<FitScene<'a>>, free: Vec<FreeParameter>) -> Result<Problem<'a>, String> {
        if free.is_empty() {
            return Err("nothing to fit: no free parameter is given".into());
        }
        for s in &scenes {
            let p = s.evaluate.parameters();
            if s.base.len() != p {
                return Err(format!("scene {}: θ has {} values, {p} are expected", s.name, s.base.len()));
            }
        }
        let mut charts = Vec::new();
        let mut firsts = vec![0];
        let mut taken: Vec<Vec<bool>> = scenes.iter().map(|s| vec![false; s.base.len()]).collect();
        for f in &free {
            let wrong = |message: String| format!("parameter {}: {message}", f.path);
            let chart = Chart::new(f.transform, f.typical, f.bounds.0, f.bounds.1).map_err(wrong)?;
            charts.extend(std::iter::repeat_n(chart, f.count));
            firsts.push(charts.len());
            check_start(f).map_err(wrong)?;
            f.known.map_or(Ok(()), |k| known::check(k, f.bounds)).map_err(wrong)?;
            for s in &f.slots {
                let scene = scenes.get(s.scene).ok_or_else(|| wrong(format!("scene number {} does not exist", s.scene)))?;
                let Some(taken) = taken[s.scene].get_mut(s.place..s.place + f.count) else {
                    return Err(wrong(format!("place {} is not in θ of scene {}", s.place + f.count - 1, scene.name)));
                };
                if !(s.factor.is_finite() && s.factor != 0.0) {
                    return Err(wrong(format!("factor {} must be finite and not zero", s.factor)));
                }
                if taken.contains(&true) {
                    return Err(wrong("another free parameter already sets the same number".into()));
                }
                taken.fill(true);
            }
        }
        let residuals = vec![1.0; scenes.len()];
        let priors = Priors::new(free.iter().zip(firsts.windows(2).map(|w| w[0]..w[1])))?;
        Ok(Problem { scenes, free, firsts, charts, residuals, counted: false, priors })
    }

    /// Priors of fields as they stand.
    pub(crate) fn priors(&self) -> &Priors {
        &self.priors
    }

    pub(crate) fn priors_mut(&mut self) -> &mut Priors {
        &mut self.priors
    }

    /// Residuals of all scenes when they were last evaluated; a scene that counts none weighs as one.
    pub(crate) fn residual_count(&self) -> f64 {
        self.residuals.iter().sum()
    }

    /// Free parameters; each stands for as many values as it counts.
    pub fn free(&self) -> &[FreeParameter] {
        &self.free
    }

    /// Number of free values q.
    pub fn values_count(&self) -> usize {
        self.charts.len()
    }

    /// The free parameters with the places of their values among the q.
    pub fn blocks(&self) -> impl Iterator<Item = (&FreeParameter, std::ops::Range<usize>)> {
        self.free.iter().zip(self.firsts.windows(2).map(|w| w[0]..w[1]))
    }

    /// The parameter that value i belongs to.
    pub fn of(&self, i: usize) -> &FreeParameter {
        &self.free[self.firsts.partition_point(|first| *first <= i) - 1]
    }

    /// Charts of the free values `[q]`.
    pub fn charts(&self) -> &[Chart] {
        &self.charts
    }

    /// The scenes.
    pub fn scenes(&self) -> &[FitScene<'a>] {
        &self.scenes
    }

    /// Physical values `[q]` at z `[q]`.
    pub fn values(&self, z: &[f64]) -> Vec<f64> {
        self.charts.iter().zip(z).map(|(c, &z)| c.value(z)).collect()
    }

    /// The scenes' own values `[q]` of the free parameters (of the first scene that has each).
    pub fn own_values(&self) -> Vec<f64> {
        let own = |f: &FreeParameter| {
            let s = f.slots[0];
            self.scenes[s.scene].base[s.place..s.place + f.count].iter().map(move |v| v / s.factor)
        };
        self.free.iter().flat_map(own).collect()
    }

    /// θ of one scene with the free parameters at `values` `[q]`.
    pub fn theta(&self, scene: usize, values: &[f64]) -> Vec<f64> {
        let mut theta = self.scenes[scene].base.clone();
        for (i, slot) in self.slots(scene) {
            theta[slot.place] = values[i] * slot.factor;
        }
        theta
    }

    /// Every free value that acts on a scene, with the place where it does.
    fn slots(&self, scene: usize) -> impl Iterator<Item = (usize, Slot)> {
        self.blocks().flat_map(move |(f, range)| {
            let of_scene = f.slots.iter().filter(move |s| s.scene == scene);
            of_scene.flat_map(move |s| range.clone().enumerate().map(move |(k, i)| (i, Slot { place: s.place + k, ..*s })))
        })
    }

    /// True where a search from values `[q]` is moved by what it sees; see [`crate::Status::Blind`].
    pub fn sees(&mut self, values: &[f64], optimizer: Optimizer) -> bool {
        let sample = self.evaluate_values(&[values.to_vec()], want(optimizer)).remove(0);
        // In a band so wide that all is met, what changes nothing still leads nowhere.
        sample.failure.is_none() && !is_blind(&sample) && !sample.gradient.contains(&0.0)
    }

    /// True where every scene's physics has [`Problem::product`].
    pub fn has_products(&self) -> bool {
        self.scenes.iter().all(|s| s.evaluate.has_products())
    }

    /// Product `[q]` of the Gauss–Newton curvature by z, at z `[q]`, with a direction `[q]`.
    ///
    /// # Errors
    /// Why it could not be computed.
    pub fn product(&mut self, z: &[f64], direction: &[f64]) -> Result<Vec<f64>, Failure> {
        // Evaluations that a journal served have not counted residuals.
        if !self.counted && (self.scenes.len() > 1 || !self.priors.is_empty()) {
            let values = self.values(z);
            self.evaluate_values(&[values], Want::Cost);
        }
        let mut out = self.data_product(z, direction)?;
        out.iter_mut().zip(self.prior_product(z, direction)).for_each(|(o, p)| *o += p);
        Ok(out)
    }

    /// What priors of fields give to such a product, once residuals have been counted; zeros without any.
    pub(crate) fn prior_product(&self, z: &[f64], direction: &[f64]) -> Vec<f64> {
        if self.priors.is_empty() {
            return vec![0.0; z.len()];
        }
        let weight = self.priors.temper / self.residual_count();
        self.priors.product(z, direction).into_iter().map(|p| weight * p).collect()
    }

    /// The same without priors of fields.
    pub(crate) fn data_product(&mut self, z: &[f64], direction: &[f64]) -> Result<Vec<f64>, Failure> {
        let slopes: Vec<f64> = self.charts.iter().zip(z).map(|(c, &z)| c.slope(z)).collect();
        let values = self.values(z);
        let mut out = vec![0.0; z.len()];
        let all: f64 = self.residuals.iter().sum();
        for s in 0..self.scenes.len() {
            let slots: Vec<(usize, Slot)> = self.slots(s).collect();
            if slots.is_empty() {
                continue;
            }
            let theta = self.theta(s, &values);
            let mut v = vec![0.0; theta.len()];
            slots.iter().for_each(|(i, slot)| v[slot.place] = slot.factor * slopes[*i] * direction[*i]);
            let wanted = Wanted::Places(slots.iter().map(|(_, slot)| slot.place).collect());
            let product = self.scenes[s].evaluate.product(&ParamBatch::of(&theta), &v, &wanted)?;
            for (i, slot) in &slots {
                out[*i] += self.residuals[s] / all * slot.factor * slopes[*i] * product[slot.place];
            }
        }
        let known = self.known_curvature(z, all);
        out.iter_mut().zip(known).zip(direction).for_each(|((o, k), d)| *o += k * d);
        Ok(out)
    }

    /// What a scene is asked for.
    fn request(&self, scene: usize, want: Want) -> Request {
        let mut places: Vec<usize> = self.slots(scene).map(|(_, slot)| slot.place).collect();
        places.sort_unstable();
        match want {
            Want::Cost => Request::default(),
            Want::Gradient => Request { gradient: Wanted::Places(places), sensitivities: Vec::new() },
            Want::Curvature => Request { gradient: Wanted::Nothing, sensitivities: places },
        }
    }

    /// Physics of every scene at each row of values, `[scenes][B]`, as far as it was computed: scenes that are parts of one evaluator and ask for
    /// the same are one batch, and a member that failed in one scene is not worth simulating in the next.
    fn simulate(&mut self, values: &[Vec<f64>], want: Want) -> Vec<Vec<Option<Evaluation>>> {
        let mut all: Vec<Vec<Option<Evaluation>>> = vec![vec![None; values.len()]; self.scenes.len()];
        let mut live: Vec<usize> = (0..values.len()).collect();
        let mut open: Vec<usize> = (0..self.scenes.len()).collect();
        while let Some(first) = open.first().copied().filter(|_| !live.is_empty()) {
            let request = self.request(first, want);
            let share = self.scenes[first].evaluate.share();
            let of =
                |s: usize| self.scenes[s].evaluate.share().filter(|other| share.as_ref().is_some_and(|own| own.of == other.of));
            let joins = |s: &usize| *s == first || (of(*s).is_some() && self.request(*s, want) == request);
            let together: Vec<usize> = open.iter().copied().filter(joins).collect();
            open.retain(|s| !together.contains(s));
            let rows: Vec<Vec<f64>> = together.iter().flat_map(|s| live.iter().map(|b| self.theta(*s, &values[*b]))).collect();
            let views = together.iter().filter_map(|s| of(*s)).flat_map(|share| vec![share.view; live.len()]).collect();
            let batch = ParamBatch { views, ..ParamBatch::from_rows(&rows) };
            let mut found = self.scenes[first].evaluate.evaluate(&batch, &request).into_iter();
            for s in &together {
                live.iter().for_each(|b| all[*s][*b] = found.next());
            }
            live.retain(|b| together.iter().all(|s| all[*s][*b].as_ref().is_some_and(|e| fault("", e).is_none())));
        }
        all
    }

    /// Cost and derivatives by the free values at each row of physical values `[B][q]`.
    pub fn evaluate_values(&mut self, values: &[Vec<f64>], want: Want) -> Vec<Sample> {
        let q = self.values_count();
        let mut sums: Vec<Sample> = values
            .iter()
            .map(|_| Sample {
                gradient: if want == Want::Cost { Vec::new() } else { vec![0.0; q] },
                curvature: if want == Want::Curvature { vec![0.0; q * q] } else { Vec::new() },
                ..Sample::default()
            })
            .collect();
        let mut weights = vec![0.0; values.len()];
        let found = self.simulate(values, want);
        for (b, sum) in sums.iter_mut().enumerate() {
            let fault = self.scenes.iter().zip(&found).find_map(|(scene, all)| fault(&scene.name, all[b].as_ref()?));
            *sum = fault.unwrap_or(std::mem::take(sum));
        }
        for (s, results) in found.into_iter().enumerate() {
            let slots: Vec<(usize, Slot)> = self.slots(s).collect();
            let places = self.request(s, want).sensitivities;
            for (b, found) in results.into_iter().enumerate() {
                let sum = &mut sums[b];
                if sum.failure.is_some() {
                    continue;
                }
                let Some(e) = found else {
                    *sum = Sample::failed(format!("{}: the backend returned no result", self.scenes[s].name));
                    continue;
                };
                // Physics that counts no residuals (an analytic cost) weighs as one.
                let n = e.residuals.max(1) as f64;
                weights[b] += n;
                self.residuals[s] = n;
                self.counted = s + 1 == self.residuals.len();
                sum.residuals += e.residuals;
                sum.unmatched += e.residuals.saturating_sub(e.matched);
                sum.cost += n * e.cost;
                if want == Want::Gradient {
                    for (i, slot) in &slots {
                        sum.gradient[*i] += n * slot.factor * e.gradient[slot.place];
                    }
                }
                if want == Want::Curvature && !slots.is_empty() {
                    let Some(c) = &e.curvature else {
                        *sum = Sample::failed(format!("{}: no sensitivities were computed", self.scenes[s].name));
                        continue;
                    };
                    let at = |place: usize| places.partition_point(|&p| p < place);
                    for (i, a) in &slots {
                        sum.gradient[*i] += n * a.factor * c.gradient[at(a.place)];
                        for (j, b) in &slots {
                            let entry = c.matrix[at(a.place) * places.len() + at(b.place)];
                            sum.curvature[i * q + j] += n * a.factor * b.factor * entry;
                        }
                    }
                }
            }
        }
        for ((sum, n), values) in sums.iter_mut().zip(weights).zip(values) {
            if sum.failure.is_none() {
                self.add_known(sum, values);
                sum.scale(1.0 / n);
            }
        }
        sums
    }

    /// Cost and derivatives by z at each row of z `[B][q]`; the curvature is the Gauss–Newton one (the chart's second
    /// derivative times the gradient is left out, as it vanishes at the optimum).
    pub fn evaluate(&mut self, z: &[Vec<f64>], want: Want) -> Vec<Sample> {
        let values: Vec<Vec<f64>> = z.iter().map(|z| self.values(z)).collect();
        let mut samples = self.evaluate_values(&values, want);
        for (sample, z) in samples.iter_mut().zip(z) {
            let slopes: Vec<f64> = self.charts.iter().zip(z).map(|(c, &z)| c.slope(z)).collect();
            sample.scale_axes(&slopes);
            if !self.priors.is_empty() && sample.failure.is_none() {
                self.add_priors(sample, z);
            }
        }
        samples
    }

    /// Adds the priors of fields at z `[q]`.
    fn add_priors(&self, sample: &mut Sample, z: &[f64]) {
        let (q, weight) = (z.len(), self.priors.temper / self.residual_count());
        let (energy, gradient) = self.priors.energy(z);
        sample.cost += weight * energy;
        sample.gradient.iter_mut().zip(gradient).for_each(|(g, p)| *g += weight * p);
        for row in 0..sample.curvature.len() / q.max(1) {
            let unit: Vec<f64> = (0..q).map(|i| if i == row { 1.0 } else { 0.0 }).collect();
            let along = self.priors.product(z, &unit);
            sample.curvature[row * q..(row + 1) * q].iter_mut().zip(along).for_each(|(h, p)| *h += weight * p);
        }
    }
}

/// What a member that failed in a scene leaves of its sample.
fn fault(scene: &str, e: &Evaluation) -> Option<Sample> {
    if e.failure.is_none() && e.cost.is_finite() {
        return None;
    }
    let why = e.failure.as_ref().map_or("the cost is not finite".into(), |f| f.to_string());
    let is = |kind| e.failure.as_ref().is_some_and(|f| f.kind == kind);
    let (broken, stopped) = (is(FailureKind::Device), is(FailureKind::Stopped));
    Some(Sample { broken, stopped, ..Sample::failed(format!("{scene}: {why}")) })
}

fn check_start(f: &FreeParameter) -> Result<(), String> {
    let (a, b) = f.start;
    if !(a.is_finite() && b.is_finite() && a <= b) {
        return Err(format!("start [{a}, {b}] must be two finite numbers, the smaller one first"));
    }
    if b < f.bounds.0 || a > f.bounds.1 {
        return Err(format!("start [{a}, {b}] lies outside the bounds [{}, {}]", f.bounds.0, f.bounds.1));
    }
    if f.count == 0 {
        return Err("it has no values".into());
    }
    if f.slots.is_empty() { Err("it acts on no scene".into()) } else { Ok(()) }
}
