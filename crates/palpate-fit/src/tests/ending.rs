//! When a search ends: a hundredth of a standard error from the optimum, in laps as in one go, and not where nothing is seen.

use super::fits::{solve, values};
use super::models::*;
use crate::*;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request};
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;

/// The oscillator with errors of one standard deviation, drawn once, so that costs are those of real data.
fn noisy(start: (f64, f64)) -> Problem<'static> {
    let seen = oscillator(4.0, 0.3, 60);
    let model = LeastSquares::new(2, move |t| {
        let off = |(i, (a, b)): (usize, (&f64, &f64))| (a - b) / 0.01 + 1.4 * (7.0 * i as f64).sin();
        Some(oscillator(t[0], t[1], 60).iter().zip(&seen).enumerate().map(off).collect())
    });
    let free = [(0, start.0, (1e-2, 1e4)), (1, start.1, (1e-4, 10.0))];
    let free = free.map(|(k, at, bounds)| parameter(k, Transform::Log, bounds, (at, at))).to_vec();
    Problem::new(vec![scene(&[start.0, start.1], model)], free).expect("the problem is valid")
}

fn exact(optimizer: Optimizer) -> Settings {
    Settings { tolerance: Tolerance { decrement: 0.0, ..Tolerance::default() }, ..Settings::new(optimizer) }
}

#[test]
fn a_search_ends_within_a_hundredth_of_the_standard_errors_and_no_later() {
    for optimizer in [Optimizer::GaussNewton, Optimizer::GaussNewtonCg, Optimizer::Lbfgs] {
        let far = solve(&mut noisy((2.5, 0.1)), &exact(optimizer));
        let near = solve(&mut noisy((2.5, 0.1)), &Settings::new(optimizer));
        assert_eq!(near.runs[0].status, Status::Converged, "{optimizer:?}");
        // By products a step is as exact as it has to be, and the last one is the same for both.
        let spared = far.evaluations - near.evaluations;
        assert!(spared > 0 || optimizer == Optimizer::GaussNewtonCg, "{optimizer:?}");
        // The distance in standard errors is what the decrement measures: its root is taken of all parameters together. L-BFGS has an
        // approximate curvature, good to a factor of a few.
        let most = if optimizer == Optimizer::Lbfgs { 0.05 } else { 0.012 };
        for (a, b) in near.parameters.iter().zip(&far.parameters) {
            let away = (a.value - b.value).abs() / b.standard_error.expect("it is determined");
            assert!(away < most, "{optimizer:?}: {away}");
        }
    }
}

#[test]
fn what_is_left_to_gain_counts_in_units_of_the_residuals_that_remain() {
    // A model that misses by ten times the noise: standard errors are ten times as wide, and so is what the end allows.
    let model = |miss: f64| {
        LeastSquares::new(1, move |t| Some((0..50).map(|i| t[0] - 3.0 + if i % 2 == 0 { miss } else { -miss }).collect()))
    };
    let problem = |miss: f64, at: f64| {
        let free = vec![parameter(0, Transform::Linear, (-9.0, 9.0), (at, at))];
        solve(&mut Problem::new(vec![scene(&[at], model(miss))], free).expect("valid"), &Settings::new(Optimizer::GaussNewton))
    };
    // The standard error of the mean of 50 readings is 0.141: 8e-4 from the optimum is nearer than a hundredth of it, 8e-3 is not.
    assert_eq!(problem(1.0, 3.0 + 8e-4).evaluations, 1);
    assert!(problem(1.0, 3.0 + 8e-3).evaluations > 1);
    assert_eq!(problem(10.0, 3.0 + 8e-3).evaluations, 1);
    assert!(problem(10.0, 3.0 + 8e-2).evaluations > 1);
}

#[test]
fn laps_are_one_walk() {
    let start = vec![25.0, 0.02];
    for optimizer in [Optimizer::GaussNewton, Optimizer::GaussNewtonCg] {
        let walk = |laps: &[usize]| {
            let (mut costs, mut at, mut walk) = (Vec::new(), start.clone(), Walk::default());
            for &iterations in laps {
                let mut hear = |p: &Progress| {
                    if p.iteration > 0 {
                        costs.push(p.cost);
                    }
                };
                let hooks = Hooks { on_iteration: Some(&mut hear), ..Hooks::default() };
                let settings = Settings { iterations, walk, ..exact(optimizer) };
                let result = fit(&mut noisy((at[0], at[1])), &settings, hooks).expect("it can be evaluated");
                (at, walk) = (values(&result), result.runs[0].walk);
            }
            (costs, at)
        };
        let (whole, end) = walk(&[13]);
        let (laps, last) = walk(&[2, 3, 8]);
        assert!(whole.len() > 6, "the search is long enough to say something: {whole:?}");
        assert_eq!(laps.len(), whole.len(), "{optimizer:?}");
        // Values become coordinates and back between laps, which costs a few roundings.
        assert!(laps.iter().zip(&whole).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{optimizer:?}: {laps:?} {whole:?}");
        assert!(last.iter().zip(&end).all(|(a, b)| (a / b - 1.0).abs() < 1e-7), "{optimizer:?}");
    }
    // Without what is carried they are not.
    let fresh = {
        let settings = |iterations, walk| Settings { iterations, walk, ..exact(Optimizer::GaussNewton) };
        let first = solve(&mut noisy((start[0], start[1])), &settings(2, Walk::default()));
        let v = values(&first);
        let go_on = |walk| solve(&mut noisy((v[0], v[1])), &settings(1, walk)).cost;
        (go_on(Walk::default()), go_on(first.runs[0].walk))
    };
    assert_ne!(fresh.0, fresh.1);
}

/// Readings of a place p around 5 that meet the body only within a band of 1.
struct Banded(LeastSquares);

impl Banded {
    fn new() -> Banded {
        Banded(LeastSquares::new(1, |t| {
            Some((0..20).map(|i| (t[0] - 5.0 + 0.01 * (7.0 * i as f64).sin()).clamp(-1.0, 1.0)).collect())
        }))
    }
}

impl Evaluate for Banded {
    fn parameters(&self) -> usize {
        1
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let mut all = self.0.evaluate(theta, request);
        for (member, e) in all.iter_mut().enumerate() {
            match (theta.row(member)[0] - 5.0).abs() {
                far if far > 1.2 => e.matched = 0,
                // One of twenty is met by chance, and there is a slope yet.
                far if far > 0.99 => e.matched = 1,
                _ => {}
            }
        }
        all
    }
}

#[test]
fn a_start_that_sees_nothing_is_led_and_never_converges_there() {
    let problem = |at: f64| {
        let free = vec![parameter(0, Transform::Linear, (-99.0, 99.0), (at, at))];
        let one = FitScene { evaluate: Box::new(Banded::new()), ..scene(&[at], LeastSquares::new(1, |_| None)) };
        Problem::new(vec![one], free).expect("valid")
    };
    for optimizer in [Optimizer::GaussNewton, Optimizer::Lbfgs, Optimizer::NelderMead] {
        let mut asked = Vec::new();
        let mut lead = |starts: &[Vec<f64>]| {
            asked.extend(starts.iter().cloned());
            vec![Some(vec![5.6])]
        };
        let folder = tempfile::tempdir().expect("a folder");
        let journal = |resume| Some(JournalFile { path: folder.path().join("journal.jsonl"), resume });
        let hooks = Hooks { lead: Some(&mut lead), journal: journal(false), ..Hooks::default() };
        let found = fit(&mut problem(20.0), &Settings::new(optimizer), hooks).expect("it can be evaluated");
        assert!((values(&found)[0] - 5.0).abs() < 0.01, "{optimizer:?}: {found:?}");
        assert_eq!((found.runs[0].start.clone(), found.runs[0].status.clone()), (vec![20.0], Status::Converged), "{optimizer:?}");
        assert_eq!(asked, [vec![20.0]]);
        // Gone on with from its journal it is the same, with nothing computed anew.
        let mut lead = |_: &[Vec<f64>]| vec![Some(vec![5.6])];
        let hooks = Hooks { lead: Some(&mut lead), journal: journal(true), ..Hooks::default() };
        let again = fit(&mut problem(20.0), &Settings::new(optimizer), hooks).expect("it can be evaluated");
        assert_eq!(again.parameters, found.parameters, "{optimizer:?}");
        // A start that sees the body is not led.
        let mut lead = |_: &[Vec<f64>]| -> Vec<Option<Vec<f64>>> { panic!("it sees the body") };
        let hooks = Hooks { lead: Some(&mut lead), ..Hooks::default() };
        let near = fit(&mut problem(5.5), &Settings::new(optimizer), hooks).expect("it can be evaluated");
        assert_eq!(near.runs[0].status, Status::Converged, "{optimizer:?}");
    }
    // Where nobody knows the way it has not converged.
    let mut lost = |_: &[Vec<f64>]| vec![None];
    let hooks = Hooks { lead: Some(&mut lost), ..Hooks::default() };
    let found = fit(&mut problem(20.0), &Settings::new(Optimizer::GaussNewton), hooks).expect("it can be evaluated");
    assert_eq!(found.runs[0].status, Status::Blind);
    assert!(!problem(20.0).sees(&[20.0], Optimizer::GaussNewton) && problem(20.0).sees(&[5.5], Optimizer::GaussNewton));
}

#[test]
fn a_start_that_sees_next_to_nothing_is_led_and_a_wrong_way_is_left_again() {
    for way in [5.6, 20.0] {
        let free = vec![parameter(0, Transform::Linear, (-99.0, 99.0), (5.995, 5.995))];
        let one = FitScene { evaluate: Box::new(Banded::new()), ..scene(&[5.995], LeastSquares::new(1, |_| None)) };
        let mut problem = Problem::new(vec![one], free).expect("valid");
        let mut asked = Vec::new();
        let mut lead = |starts: &[Vec<f64>]| {
            asked.extend(starts.iter().cloned());
            vec![Some(vec![way])]
        };
        let hooks = Hooks { lead: Some(&mut lead), ..Hooks::default() };
        let found = fit(&mut problem, &Settings::new(Optimizer::GaussNewton), hooks).expect("it can be evaluated");
        // Nothing is seen where the wrong way leads: the search goes from its own start.
        assert!((values(&found)[0] - 5.0).abs() < 0.01, "{way}: {found:?}");
        assert_eq!((found.runs[0].start.clone(), found.runs[0].status.clone()), (vec![5.995], Status::Converged), "{way}");
        assert_eq!(asked, [vec![5.995]]);
    }
}
