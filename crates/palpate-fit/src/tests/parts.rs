//! Scenes that are parts of one evaluator are one batch, and their joint fit is what it is with an evaluator each, bit by bit.

use super::models::{Batches, LeastSquares, parameter};
use crate::{FitResult, FitScene, FreeParameter, Hooks, Problem, Settings, Slot, Want, fit};
use palpate_engine::{Evaluate, Evaluation, Failure, ParamBatch, Part, Request, Wanted};
use palpate_model::observation::View;
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;

/// Recordings of one thing.
struct Recordings {
    each: Vec<LeastSquares>,
    batches: Batches,
}

impl Evaluate for Recordings {
    fn parameters(&self) -> usize {
        self.each[0].parameters
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        self.batches.lock().unwrap().push(theta.members());
        let one = |b: usize| self.each[theta.view(b).recording].one(theta.row(b), request);
        (0..theta.members()).map(one).collect()
    }

    fn has_products(&self) -> bool {
        true
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        self.each[at.view(0).recording].product(at, v, wanted)
    }
}

/// Recordings k of a decay with amplitudes of their own, which cannot be computed for slow decays.
fn decay(k: usize) -> LeastSquares {
    let own = [2.0, 0.7, 1.1][k];
    LeastSquares::new(2, move |t| {
        let at = |i: usize| 0.2 * (i + k) as f64;
        let r = (0..5 + k).map(|i| (t[1] * (-t[0] * at(i)).exp() - own * (-1.3 * at(i)).exp()) / 0.01 + (i as f64).sin());
        (t[0] > [0.05, 0.3, 0.1][k]).then(|| r.collect())
    })
}

/// Three scenes, the second of which stands alone, with one shared number and one of each; of the last the amplitude is known.
fn problem(joint: bool) -> (Problem<'static>, Batches) {
    let batches = Batches::default();
    let mut evaluators: Vec<Box<dyn Evaluate>> = Vec::new();
    if joint {
        let whole = Recordings { each: (0..3).map(decay).collect(), batches: batches.clone() };
        let mut parts = Part::all(Box::new(whole), [0, 2].map(View::of)).into_iter();
        evaluators.push(Box::new(parts.next().unwrap()));
        evaluators.push(Box::new(LeastSquares { batches: batches.clone(), ..decay(1) }));
        evaluators.push(Box::new(parts.next().unwrap()));
    } else {
        evaluators
            .extend((0..3).map(|k| -> Box<dyn Evaluate> { Box::new(LeastSquares { batches: batches.clone(), ..decay(k) }) }));
    }
    let scene = |(k, evaluate)| FitScene { name: format!("{k}"), fingerprint: format!("{k}"), base: vec![1.0, 1.0], evaluate };
    let scenes = evaluators.into_iter().enumerate().map(scene).collect();
    let slot = |scene, place| Slot { scene, place, factor: 1.0 };
    let shared =
        FreeParameter { slots: (0..3).map(|s| slot(s, 0)).collect(), ..parameter(0, Transform::Log, (0.01, 100.0), (0.1, 10.0)) };
    let own = |s: usize| FreeParameter {
        path: format!("amplitude {s}"),
        slots: vec![slot(s, 1)],
        ..parameter(1, Transform::Log, (0.01, 100.0), (0.1, 10.0))
    };
    (Problem::new(scenes, vec![shared, own(0), own(1), own(2)]).expect("valid"), batches)
}

#[test]
fn parts_of_one_evaluator_are_one_batch_and_change_no_bit() {
    for optimizer in [Optimizer::GaussNewton, Optimizer::GaussNewtonCg, Optimizer::Lbfgs, Optimizer::NelderMead] {
        let [(apart, all), (joint, fewer)] = [false, true].map(|joint| {
            let (mut problem, batches) = problem(joint);
            let settings = Settings { starts: 3, iterations: 12, ..Settings::new(optimizer) };
            let result = fit(&mut problem, &settings, Hooks::default()).expect("a start can be computed");
            let batches = batches.lock().unwrap().clone();
            (FitResult { seconds: 0.0, ..result }, batches)
        });
        assert_eq!(format!("{apart:?}"), format!("{joint:?}"), "{optimizer:?}");
        // A round asks three evaluators, or two. Where nobody's first scenes can be computed the others are not asked.
        let (before, after) =
            (all.iter().sum::<usize>() as f64 / all.len() as f64, fewer.iter().sum::<usize>() as f64 / fewer.len() as f64);
        println!("{optimizer:?}: {} batches of {before:.2} become {} of {after:.2}", all.len(), fewer.len());
        assert!(10 * fewer.len() <= 7 * all.len() && after > 1.4 * before);
    }
}

#[test]
fn a_member_that_fails_in_a_part_says_which_scene_it_was() {
    let values = [0.2, 0.02].map(|rate| vec![rate, 1.0, 1.0, 1.0]);
    let [apart, joint] = [false, true].map(|joint| problem(joint).0.evaluate_values(&values, Want::Curvature));
    assert_eq!(apart, joint);
    let told = |k: usize| joint[k].failure.clone().unwrap_or_default();
    assert!(told(0).starts_with("1: ") && told(1).starts_with("0: "), "{} and {}", told(0), told(1));
}
