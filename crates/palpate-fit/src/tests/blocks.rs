//! Free fields: thousands of values under one path.

use super::fits::{settings, solve};
use super::models::parameter;
use crate::*;
use palpate_engine::{Evaluate, Evaluation, Failure, ParamBatch, Request, Wanted};
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;
use std::time::Instant;

/// Neighbouring values should differ by a wave, and one number scales all: `r_k = a ln(x_k/x_{k+1}) − wave(k)`, `r = ln x_0`.
struct Chain(usize);

impl Chain {
    fn wave(k: usize) -> f64 {
        0.3 * (0.4 * k as f64).sin()
    }

    fn residuals(&self, t: &[f64]) -> Vec<f64> {
        let step = |k: usize| t[0] * (t[k + 1] / t[k + 2]).ln() - Chain::wave(k);
        (0..self.0 - 1).map(step).chain([t[1].ln(), t[0] - 2.0]).collect()
    }

    /// J v.
    fn along(&self, t: &[f64], v: &[f64]) -> Vec<f64> {
        let step = |k: usize| v[0] * (t[k + 1] / t[k + 2]).ln() + t[0] * (v[k + 1] / t[k + 1] - v[k + 2] / t[k + 2]);
        (0..self.0 - 1).map(step).chain([v[1] / t[1], v[0]]).collect()
    }

    /// Jᵀ w / n.
    fn pull(&self, t: &[f64], w: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; t.len()];
        for k in 0..self.0 - 1 {
            out[0] += w[k] * (t[k + 1] / t[k + 2]).ln();
            out[k + 1] += w[k] * t[0] / t[k + 1];
            out[k + 2] -= w[k] * t[0] / t[k + 2];
        }
        out[1] += w[self.0 - 1] / t[1];
        out[0] += w[self.0];
        out.iter_mut().for_each(|o| *o /= w.len() as f64);
        out
    }
}

impl Evaluate for Chain {
    fn parameters(&self) -> usize {
        self.0 + 1
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        assert!(request.sensitivities.len() <= 256);
        let one = |b| {
            let r = self.residuals(theta.row(b));
            let cost = r.iter().map(|r| r * r).sum::<f64>() / (2 * r.len()) as f64;
            Evaluation { cost, gradient: self.pull(theta.row(b), &r), residuals: r.len(), ..Evaluation::default() }
        };
        (0..theta.members()).map(one).collect()
    }

    fn has_products(&self) -> bool {
        true
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], _wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        let theta = at.row(0);
        Ok(self.pull(theta, &self.along(theta, v)))
    }
}

fn problem(count: usize) -> Problem<'static> {
    let field = FreeParameter {
        path: "field.0".into(),
        count,
        slots: vec![Slot { scene: 0, place: 1, factor: 1.0 }],
        ..parameter(1, Transform::Log, (1e-6, 1e6), (1.0, 1.0))
    };
    let number = parameter(0, Transform::Log, (1e-3, 1e3), (1.0, 1.0));
    let base = [vec![1.0], vec![1.0; count]].concat();
    let scene = FitScene { name: "chain".into(), fingerprint: "chain".into(), base, evaluate: Box::new(Chain(count)) };
    Problem::new(vec![scene], vec![number, field]).expect("valid")
}

#[test]
fn products_are_those_of_the_chain_by_z() {
    let mut problem = problem(40);
    let z: Vec<f64> = (0..41).map(|k| 0.1 * (k as f64).cos()).collect();
    let v: Vec<f64> = (0..41).map(|k| (1.3 * k as f64).sin()).collect();
    let found = problem.product(&z, &v).expect("there are products");
    let model = Chain(40);
    let residuals = |t: f64| {
        let z: Vec<f64> = z.iter().zip(&v).map(|(z, v)| z + t * v).collect();
        model.residuals(&problem.theta(0, &problem.values(&z)))
    };
    let (plus, minus) = (residuals(1e-5), residuals(-1e-5));
    let square: f64 = plus.iter().zip(&minus).map(|(a, b)| ((a - b) / 2e-5).powi(2)).sum::<f64>() / plus.len() as f64;
    let vhv: f64 = found.iter().zip(&v).map(|(h, v)| h * v).sum();
    assert!((vhv / square - 1.0).abs() < 1e-8, "{vhv}, {square}");
}

#[test]
fn fields_are_found_by_both_methods_for_many_values() {
    for optimizer in [Optimizer::GaussNewtonCg, Optimizer::Lbfgs] {
        let iterations = if optimizer == Optimizer::Lbfgs { 2000 } else { 60 };
        let settings = Settings { iterations, ..settings(optimizer) };
        let result = solve(&mut problem(300), &settings);
        let field = &result.fields[0];
        println!("{optimizer:?}: cost {:e}, {:?}", result.cost, result.runs[0]);
        assert!(result.cost < 1e-7, "{optimizer:?}: {}", result.cost);
        assert_eq!((result.parameters.len(), field.values.len(), result.correlation.len()), (1, 300, 1));
        assert!((result.parameters[0].value - 2.0).abs() < 1e-2);
        assert!(field.standard_errors.iter().all(Option::is_none));
        assert!(result.warnings[0].starts_with("no standard errors: 301 values are free"), "{:?}", result.warnings);
    }
}

#[test]
fn ten_thousand_values_are_set_up_at_once() {
    let clock = Instant::now();
    let mut problem = problem(10_000);
    let result = solve(&mut problem, &Settings { iterations: 3, ..settings(Optimizer::Lbfgs) });
    let seconds = clock.elapsed().as_secs_f64();
    println!("{seconds:.3} s");
    assert!(seconds < 1.0 && result.fields[0].values.len() == 10_000);
}

#[test]
fn what_is_free_twice_is_refused() {
    let twice = |place| {
        let field = FreeParameter { count: 4, ..parameter(1, Transform::Log, (1e-6, 1e6), (1.0, 1.0)) };
        let one = parameter(place, Transform::Log, (1e-6, 1e6), (1.0, 1.0));
        let base = vec![1.0; 5];
        let scene = FitScene { name: "chain".into(), fingerprint: "chain".into(), base, evaluate: Box::new(Chain(4)) };
        Problem::new(vec![scene], vec![field, one]).err()
    };
    assert!(twice(3).is_some_and(|e| e.contains("already sets the same number")));
    assert!(twice(0).is_none());
    assert!(twice(5).is_some_and(|e| e.contains("place 5 is not in θ")));
}
