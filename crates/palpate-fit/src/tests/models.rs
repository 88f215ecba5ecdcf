//! Cheap physics: least squares of a few residual functions.

use crate::{FitScene, FreeParameter, Problem, Slot};
use palpate_engine::{Curvature, Evaluate, Evaluation, Failure, FailureKind, ParamBatch, Request, Wanted};
use palpate_model::params::Transform;

/// Residuals r(θ) over σ; `None` where the model fails.
pub type Residuals = dyn Fn(&[f64]) -> Option<Vec<f64>> + Send;

/// Sizes of the batches that a model has evaluated.
pub type Batches = std::sync::Arc<std::sync::Mutex<Vec<usize>>>;

/// Least squares `J = (1/n) Σ r²/2` with derivatives by central differences of the residuals.
pub struct LeastSquares {
    pub parameters: usize,
    pub residuals: Box<Residuals>,
    /// Sizes of the batches so far.
    pub batches: Batches,
}

impl LeastSquares {
    pub fn new(parameters: usize, residuals: impl Fn(&[f64]) -> Option<Vec<f64>> + Send + 'static) -> LeastSquares {
        LeastSquares { parameters, residuals: Box::new(residuals), batches: Default::default() }
    }

    pub fn one(&self, theta: &[f64], request: &Request) -> Evaluation {
        let failed = || Evaluation::failed(Failure::new(FailureKind::NewtonStalled, 0.1, format!("at {theta:?}")));
        let Some(r) = (self.residuals)(theta) else { return failed() };
        let n = r.len() as f64;
        let cost = r.iter().map(|r| r * r / 2.0).sum::<f64>() / n;
        let column = |p: usize| {
            let d = 1e-6 * theta[p].abs().max(1e-6);
            let at = |x: f64| {
                let mut t = theta.to_vec();
                t[p] = x;
                (self.residuals)(&t)
            };
            let (plus, minus) = (at(theta[p] + d)?, at(theta[p] - d)?);
            Some(plus.iter().zip(&minus).map(|(a, b)| (a - b) / (2.0 * d)).collect::<Vec<f64>>())
        };
        let slope = |c: &[f64]| c.iter().zip(&r).map(|(c, r)| c * r).sum::<f64>() / n;
        let mut gradient = Vec::new();
        if request.gradient.any() {
            for p in 0..self.parameters {
                let Some(c) = column(p) else { return failed() };
                gradient.push(slope(&c));
            }
        }
        let columns: Option<Vec<Vec<f64>>> = request.sensitivities.iter().map(|&p| column(p)).collect();
        let Some(columns) = columns else { return failed() };
        let curvature = (!columns.is_empty()).then(|| Curvature {
            gradient: columns.iter().map(|c| slope(c)).collect(),
            matrix: columns
                .iter()
                .flat_map(|a| columns.iter().map(|b| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / n).collect::<Vec<_>>())
                .collect(),
        });
        Evaluation { cost, gradient, curvature, matched: r.len(), residuals: r.len(), ..Evaluation::default() }
    }
}

impl Evaluate for LeastSquares {
    fn parameters(&self) -> usize {
        self.parameters
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        self.batches.lock().expect("no test panics while it holds the lock").push(theta.members());
        (0..theta.members()).map(|b| self.one(theta.row(b), request)).collect()
    }

    fn has_products(&self) -> bool {
        true
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        let theta = at.row(0);
        let mask = wanted.mask(self.parameters);
        let places: Vec<usize> = (0..self.parameters).filter(|p| mask[*p]).collect();
        let e = self.one(theta, &Request { sensitivities: places.clone(), ..Request::default() });
        let c = e.curvature.ok_or_else(|| e.failure.expect("it failed, or has curvature"))?;
        let mut out = vec![0.0; self.parameters];
        for (a, p) in places.iter().enumerate() {
            out[*p] = places.iter().enumerate().map(|(b, p)| c.matrix[a * places.len() + b] * v[*p]).sum();
        }
        Ok(out)
    }
}

pub fn scene(base: &[f64], model: LeastSquares) -> FitScene<'static> {
    FitScene { name: "toy".into(), fingerprint: "toy".into(), base: base.to_vec(), evaluate: Box::new(model) }
}

pub fn parameter(place: usize, transform: Transform, bounds: (f64, f64), start: (f64, f64)) -> FreeParameter {
    FreeParameter {
        path: format!("p{place}"),
        unit: "1".into(),
        transform,
        typical: 1.0,
        bounds,
        start,
        known: None,
        prior: None,
        slots: vec![Slot { scene: 0, place, factor: 1.0 }],
        count: 1,
        direction: None,
    }
}

/// Rosenbrock's valley as residuals, minimum at (1, 1).
pub fn rosenbrock() -> Problem<'static> {
    let model = LeastSquares::new(2, |t| Some(vec![10.0 * (t[1] - t[0] * t[0]), 1.0 - t[0]]));
    let free = (0..2).map(|p| parameter(p, Transform::Linear, (-5.0, 5.0), (-2.0, 2.0))).collect();
    Problem::new(vec![scene(&[-1.2, 1.0], model)], free).expect("the problem is valid")
}

/// Position of a damped oscillator released from 1 at `times`: stiffness k, damping c, unit mass.
pub fn oscillator(k: f64, c: f64, times: usize) -> Vec<f64> {
    let w = (k - c * c / 4.0).max(1e-12).sqrt();
    (0..times)
        .map(|i| 0.1 * (i + 1) as f64)
        .map(|t| (-c * t / 2.0).exp() * ((w * t).cos() + c / (2.0 * w) * (w * t).sin()))
        .collect()
}

/// Oscillator seen with σ = 0.01, true stiffness 4 and damping 0.3; fails for stiffness above 400.
pub fn oscillator_problem() -> Problem<'static> {
    counted_oscillator().0
}

/// The same, with the sizes of the batches evaluated so far.
pub fn counted_oscillator() -> (Problem<'static>, Batches) {
    let truth = oscillator(4.0, 0.3, 60);
    let model = LeastSquares::new(2, move |t| {
        (t[0] < 400.0).then(|| oscillator(t[0], t[1], 60).iter().zip(&truth).map(|(a, b)| (a - b) / 0.01).collect())
    });
    let free =
        vec![parameter(0, Transform::Log, (1e-2, 1e4), (0.5, 30.0)), parameter(1, Transform::Log, (1e-4, 10.0), (0.01, 2.0))];
    let batches = model.batches.clone();
    (Problem::new(vec![scene(&[2.0, 0.1], model)], free).expect("the problem is valid"), batches)
}
