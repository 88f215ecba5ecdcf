//! Whole fits: optimisers, starts, joint problems.

use super::models::*;
use crate::*;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request};
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

pub const ALL: [Optimizer; 6] = [
    Optimizer::Rprop,
    Optimizer::GradientDescent,
    Optimizer::Lbfgs,
    Optimizer::GaussNewton,
    Optimizer::GaussNewtonCg,
    Optimizer::NelderMead,
];

pub fn settings(optimizer: Optimizer) -> Settings {
    // Digits that no noise would leave: these tests compare with exact answers.
    let tolerance = Tolerance { decrement: 0.0, ..Tolerance::default() };
    Settings { iterations: 200, tolerance, ..Settings::new(optimizer) }
}

pub fn solve(problem: &mut Problem, settings: &Settings) -> FitResult {
    fit(problem, settings, Hooks::default()).expect("a start can be evaluated")
}

pub fn values(result: &FitResult) -> Vec<f64> {
    result.parameters.iter().map(|p| p.value).collect()
}

/// Stopping tolerances end the gradient methods about here in a relative value.
const FOUND: f64 = 1e-5;

#[test]
fn every_optimiser_finds_an_oscillator() {
    for optimizer in ALL {
        let result = solve(&mut oscillator_problem(), &Settings { starts: 6, ..settings(optimizer) });
        let v = values(&result);
        assert!((v[0] / 4.0 - 1.0).abs() < FOUND && (v[1] / 0.3 - 1.0).abs() < FOUND, "{optimizer:?}: {v:?}");
        assert_eq!(result.runs[result.best].status, Status::Converged, "{optimizer:?}");
        assert_eq!(result.theta[0], v);
        // Each start moved downhill, whatever it found.
        assert!(result.runs.iter().all(|r| r.cost < r.start_cost), "{optimizer:?}");
    }
}

#[test]
fn optimisers_cross_rosenbrocks_valley() {
    // Rprop is left out: it zigzags across a curved valley (thousands of steps), as it must without curvature.
    for optimizer in ALL.into_iter().filter(|&o| o != Optimizer::Rprop) {
        let v = values(&solve(&mut rosenbrock(), &settings(optimizer)));
        assert!(v.iter().all(|v| (v - 1.0).abs() < 1e-4), "{optimizer:?}: {v:?}");
    }
}

#[test]
fn a_number_that_is_hardly_seen_moves_as_early_as_the_others() {
    // Both are linear in the chart: a step from the start is nearly right, whatever the curvatures, unless damping holds the second.
    let model = LeastSquares::new(2, |t| Some(vec![1e4 * (t[0] / 5.0).ln(), (t[1] / 0.05).ln(), 0.01]));
    let batches = model.batches.clone();
    let free = (0..2).map(|p| parameter(p, Transform::Log, (1e-3, 1e3), (0.01, 10.0))).collect();
    let mut problem = Problem::new(vec![scene(&[2.0, 0.2], model)], free).expect("the problem is valid");
    let v = values(&solve(&mut problem, &settings(Optimizer::GaussNewton)));
    assert!((v[0] / 5.0 - 1.0).abs() < FOUND && (v[1] / 0.05 - 1.0).abs() < FOUND, "{v:?}");
    let evaluations: usize = batches.lock().expect("no test panics while it holds the lock").iter().sum();
    // Damping that is one to three, a third, a ninth… leaves 1e-5 after seven steps.
    assert!(evaluations <= 12, "{evaluations} evaluations");
}

/// A bowl with its minimum outside the box: (2, 0.2) with p0 ≤ 1, coupled so that p1 must move too.
fn bowl_with_bound() -> Problem<'static> {
    let model = LeastSquares::new(2, |t| Some(vec![t[0] - 2.0, 2.0 * (t[1] - 0.2) + (t[0] - 2.0), 0.1]));
    let free = vec![
        parameter(0, Transform::Linear, (-1.0, 1.0), (-0.5, -0.5)),
        parameter(1, Transform::Linear, (-3.0, 3.0), (-2.0, -2.0)),
    ];
    Problem::new(vec![scene(&[0.0, 0.0], model)], free).expect("the problem is valid")
}

#[test]
fn every_optimiser_respects_bounds() {
    for optimizer in ALL {
        let result = solve(&mut bowl_with_bound(), &settings(optimizer));
        let v = values(&result);
        // With p0 = 1 the second residual vanishes at p1 = 0.2 + 1/2.
        assert_eq!(v[0], 1.0, "{optimizer:?}");
        assert!((v[1] - 0.7).abs() < 1e-4, "{optimizer:?}: {v:?}");
        assert_eq!(result.parameters[0].at_bound, Some(AtBound::Upper));
        assert_eq!(result.parameters[0].standard_error, None);
        assert!(result.parameters[1].standard_error.is_some());
        assert!(result.warnings.iter().any(|w| w.starts_with("p0 ended at its upper bound 1")), "{:?}", result.warnings);
    }
}

#[test]
fn failed_evaluations_are_rejected_steps() {
    // The model fails beyond 1.2, close to the minimum at 1, and the curvature at the start makes every method overshoot.
    let problem = || {
        let model = LeastSquares::new(1, |t| (t[0] < 1.2).then(|| vec![(3.0 * (t[0] - 1.0)).tanh(), 0.01]));
        Problem::new(vec![scene(&[-1.0], model)], vec![parameter(0, Transform::Linear, (-9.0, 9.0), (-1.0, -1.0))])
            .expect("the problem is valid")
    };
    for optimizer in ALL {
        let result = solve(&mut problem(), &settings(optimizer));
        assert!((values(&result)[0] - 1.0).abs() < 1e-4, "{optimizer:?}: {result:?}");
        assert_eq!(result.runs[0].status, Status::Converged, "{optimizer:?}");
    }
}

#[test]
fn not_a_number_counts_as_a_failure() {
    let model = LeastSquares::new(1, |t| Some(vec![(t[0] - 1.0) * if t[0] > 0.5 { f64::NAN } else { 1.0 }, 1.0]));
    let free = vec![parameter(0, Transform::Linear, (-9.0, 9.0), (-1.0, -1.0))];
    let result = solve(&mut Problem::new(vec![scene(&[-1.0], model)], free).expect("valid"), &settings(Optimizer::GaussNewton));
    let v = values(&result)[0];
    assert!(v > 0.4 && v <= 0.5, "the edge of the valid region is the best that can be had: {v}");
}

#[test]
fn a_start_that_fails_is_drawn_anew() {
    // Two thirds of the range fail, and so do the scene's own values.
    let problem = |edge: f64| {
        let model = LeastSquares::new(1, move |t| (t[0] < edge).then(|| vec![t[0] - 0.5, 0.1]));
        Problem::new(vec![scene(&[2.5], model)], vec![parameter(0, Transform::Linear, (0.0, 3.0), (0.0, 3.0))]).expect("valid")
    };
    let result = solve(&mut problem(1.0), &Settings { starts: 60, ..settings(Optimizer::GaussNewton) });
    let alive = result.runs.iter().filter(|r| r.cost.is_finite()).count();
    // A start survives with probability 1 − (2/3)⁵ = 0.87: 52 of 60, standard deviation 2.6. Without redraws it would be 20.
    assert!((44..60).contains(&alive), "{alive} of 60 starts found a valid point");
    assert!(result.warnings.iter().any(|w| w.contains("of 60 starts could not be evaluated")), "{:?}", result.warnings);
    let error = fit(&mut problem(-1.0), &settings(Optimizer::GaussNewton), Hooks::default()).expect_err("nothing is valid");
    assert!(matches!(&error, FitError::NoStart(why) if why.contains("toy")), "{error}");
}

/// Two minima: ((p² − 1) + small tilt), the one at −1 slightly deeper.
fn two_minima() -> Problem<'static> {
    let model = LeastSquares::new(1, |t| Some(vec![10.0 * (t[0] * t[0] - 1.0), 0.5 * (t[0] + 1.0)]));
    Problem::new(vec![scene(&[0.8], model)], vec![parameter(0, Transform::Linear, (-3.0, 3.0), (-2.0, 2.0))]).expect("valid")
}

#[test]
fn several_starts_find_the_deeper_of_two_minima() {
    for optimizer in ALL {
        let one = solve(&mut two_minima(), &settings(optimizer));
        assert!(values(&one)[0] > 0.9, "{optimizer:?}: from the scene's own value the near minimum is found");
        let many = solve(&mut two_minima(), &Settings { starts: 10, ..settings(optimizer) });
        assert!((values(&many)[0] + 1.0).abs() < 1e-4, "{optimizer:?}: {:?}", values(&many));
        assert_eq!(many.initial_cost, one.initial_cost, "the first start is the scene's own value");
    }
}

#[test]
fn starts_are_drawn_from_their_ranges_whatever_their_number() {
    let ranges = |n| solve(&mut oscillator_problem(), &Settings { starts: n, iterations: 1, ..settings(Optimizer::Rprop) });
    let (few, many) = (ranges(4), ranges(40));
    for s in 0..4 {
        assert_eq!(few.runs[s].start, many.runs[s].start);
    }
    let first: Vec<f64> = many.runs.iter().map(|r| r.start[0]).collect();
    assert!(first.iter().all(|v| (0.5..=30.0).contains(v)));
    // Log-uniform: as many below the geometric mean 3.9 as above; 3 standard deviations of a binomial with n = 40 are 9.5.
    let low = first.iter().filter(|&&v| v < 15f64.sqrt()).count();
    assert!((10..=30).contains(&low), "{low} of 40");
}

#[test]
fn a_round_of_all_starts_is_one_batch() {
    let model = LeastSquares::new(2, |t| Some(vec![t[0] - 1.0, t[1] + 2.0 * t[0], 0.3]));
    let batches = model.batches.clone();
    let free = (0..2).map(|p| parameter(p, Transform::Linear, (-9.0, 9.0), (-3.0, 3.0))).collect();
    let mut problem = Problem::new(vec![scene(&[0.0, 0.0], model)], free).expect("valid");
    let result = solve(&mut problem, &Settings { starts: 12, ..settings(Optimizer::Rprop) });
    let sizes = batches.lock().expect("not poisoned").clone();
    assert_eq!(sizes[0], 12);
    assert_eq!(sizes.iter().sum::<usize>(), result.evaluations);
    let longest = result.runs.iter().map(|r| r.evaluations).max().expect("twelve runs");
    assert_eq!(sizes.len(), longest + 1, "a round per evaluation of the longest run, and one for the curvature");
    // Only starts that have ended are missing.
    assert!(sizes[..longest].windows(2).all(|w| w[0] >= w[1]), "{sizes:?}");
}

#[test]
fn equal_seeds_give_equal_bits_and_equal_histories() {
    for optimizer in ALL {
        let run = |seed| {
            let mut history = Vec::new();
            let mut note = |p: &Progress| history.push(p.clone());
            let hooks = Hooks { on_iteration: Some(&mut note), ..Hooks::default() };
            let settings = Settings { starts: 5, seed, iterations: 30, ..settings(optimizer) };
            let result = fit(&mut oscillator_problem(), &settings, hooks).expect("it can be evaluated");
            (FitResult { seconds: 0.0, ..result }, history)
        };
        let (first, second, other) = (run(3), run(3), run(4));
        assert_eq!(first, second, "{optimizer:?}");
        assert_ne!(first.0.runs[1].start, other.0.runs[1].start);
        let heard = first.1.iter().filter(|p| p.start == 2).count();
        assert_eq!(heard, first.0.runs[2].iterations + 1, "every iteration of a start, and the start itself");
    }
}

#[test]
fn a_joint_fit_shares_some_parameters_and_not_others() {
    // The same oscillator twice, released by different amounts; scene 1 holds θ in another order and in other units.
    let (k, c) = (4.0, 0.3);
    let one = move |a: f64, k: f64, c: f64, n: usize| -> Vec<f64> { oscillator(k, c, n).iter().map(|x| a * x / 0.01).collect() };
    let residuals = move |a: f64, k: f64, c: f64, truth: f64, n: usize| -> Option<Vec<f64>> {
        Some(one(a, k, c, n).iter().zip(one(truth, 4.0, 0.3, n)).map(|(x, y)| x - y).collect())
    };
    let a = LeastSquares::new(3, move |t| residuals(t[0], t[1], t[2], 1.0, 40));
    let b = LeastSquares::new(3, move |t| residuals(t[2], t[1] / 10.0, t[0], 0.5, 80));
    let slot = |scene, place, factor| Slot { scene, place, factor };
    let mut shared_k = parameter(1, Transform::Log, (0.1, 100.0), (2.0, 2.0));
    shared_k.slots = vec![slot(0, 1, 1.0), slot(1, 1, 10.0)];
    let mut shared_c = parameter(2, Transform::Log, (1e-3, 10.0), (0.1, 0.1));
    shared_c.slots = vec![slot(0, 2, 1.0), slot(1, 0, 1.0)];
    let mut own_a = parameter(0, Transform::Linear, (-5.0, 5.0), (0.7, 0.7));
    own_a.slots = vec![slot(0, 0, 1.0)];
    let mut own_b = own_a.clone();
    own_b.slots = vec![slot(1, 2, 1.0)];
    let scenes = vec![scene(&[1.0, 9.0, 9.0], a), scene(&[9.0, 9.0, 0.5], b)];
    let mut problem = Problem::new(scenes, vec![shared_k, shared_c, own_a, own_b]).expect("the problem is valid");

    // Gradient of the joint cost against central differences of the joint cost; 120 residuals in all.
    let at = vec![3.0, 0.2, 0.9, 0.6];
    let sample = problem.evaluate_values(std::slice::from_ref(&at), Want::Gradient).remove(0);
    let by_sensitivity = problem.evaluate_values(std::slice::from_ref(&at), Want::Curvature).remove(0);
    assert_eq!(sample.residuals, 120);
    for i in 0..4 {
        let d = 1e-5 * at[i];
        let moved = |x: f64| (0..4).map(|j| if i == j { at[j] + x } else { at[j] }).collect::<Vec<f64>>();
        let costs = problem.evaluate_values(&[moved(d), moved(-d)], Want::Cost);
        let difference = (costs[0].cost - costs[1].cost) / (2.0 * d);
        // Truncation 1e-10 relative and the rounding of residual differences with steps of 1e-6.
        assert!((sample.gradient[i] - difference).abs() < 1e-6 * difference.abs(), "{i}");
        assert!((sample.gradient[i] - by_sensitivity.gradient[i]).abs() < 1e-12 * difference.abs(), "{i}");
    }

    // Where all residuals vanish, Gauss–Newton's matrix is the Hessian: differences of the gradient.
    let truth = [k, c, 1.0, 0.5];
    let curvature = problem.evaluate_values(&[truth.to_vec()], Want::Curvature).remove(0).curvature;
    for i in 0..4 {
        let d = 1e-4 * truth[i];
        let moved = |x: f64| (0..4).map(|j| if i == j { truth[j] + x } else { truth[j] }).collect::<Vec<f64>>();
        let g = problem.evaluate_values(&[moved(d), moved(-d)], Want::Gradient);
        for j in 0..4 {
            let difference = (g[0].gradient[j] - g[1].gradient[j]) / (2.0 * d);
            // Relative to what Cauchy and Schwarz allow, as entries off the diagonal may be small.
            let scale = (curvature[5 * i] * curvature[5 * j]).sqrt();
            assert!((curvature[4 * i + j] - difference).abs() < 1e-5 * scale, "{i} {j}");
        }
    }

    let result = solve(&mut problem, &settings(Optimizer::GaussNewton));
    for (found, truth) in values(&result).iter().zip([k, c, 1.0, 0.5]) {
        assert!((found / truth - 1.0).abs() < 1e-6, "{found} instead of {truth}");
    }
    let v = values(&result);
    assert_eq!(result.theta, vec![vec![v[2], v[0], v[1]], vec![v[1], v[0] * 10.0, v[3]]]);
}

#[test]
fn every_residual_counts_once_in_a_joint_cost() {
    let a = LeastSquares::new(1, |t| Some(vec![t[0] - 1.0; 3]));
    let b = LeastSquares::new(1, |t| Some(vec![t[0] - 5.0]));
    let mut shared = parameter(0, Transform::Linear, (-9.0, 9.0), (0.0, 0.0));
    shared.slots.push(Slot { scene: 1, place: 0, factor: 1.0 });
    let mut problem = Problem::new(vec![scene(&[0.0], a), scene(&[0.0], b)], vec![shared]).expect("valid");
    // The mean of 1, 1, 1, 5; a relative change of 1e-9 in the cost of 1.5 ends the search within √3e-9.
    assert!((values(&solve(&mut problem, &settings(Optimizer::GaussNewton)))[0] - 2.0).abs() < 6e-5);
}

#[test]
fn an_interrupted_fit_keeps_its_best() {
    for optimizer in ALL {
        let flag = Arc::new(AtomicBool::new(false));
        let mut lowest = f64::INFINITY;
        let mut stop = |p: &Progress| {
            lowest = lowest.min(p.cost);
            if p.start == 0 && p.iteration == 4 {
                flag.store(true, Ordering::SeqCst);
            }
        };
        let hooks = Hooks { on_iteration: Some(&mut stop), interrupt: flag.clone().into(), ..Hooks::default() };
        let settings = Settings { starts: 3, ..settings(optimizer) };
        let result = fit(&mut oscillator_problem(), &settings, hooks).expect("something was evaluated");
        assert!(result.runs.iter().all(|r| r.status == Status::Interrupted), "{optimizer:?}");
        assert!(result.cost <= lowest && result.cost < result.initial_cost, "{optimizer:?}");
        assert!(result.warnings.iter().any(|w| w.contains("interrupted")));
        assert!(!result.warnings.iter().any(|w| w.contains("unique")), "nothing is known of the noise: {:?}", result.warnings);
        // The kept values are those of the kept cost.
        let again = oscillator_problem().evaluate_values(&[values(&result)], Want::Cost).remove(0);
        assert!((again.cost / result.cost - 1.0).abs() < 1e-12, "{optimizer:?}");
    }
    // In the last iteration as well: that the iterations are used up is not why it ended.
    let settings_of_two = Settings { iterations: 2, ..settings(Optimizer::Rprop) };
    for (at, said) in [(2, false), (usize::MAX, true)] {
        let flag = Arc::new(AtomicBool::new(false));
        let mut stop = |p: &Progress| flag.store(p.iteration == at, Ordering::SeqCst);
        let hooks = Hooks { on_iteration: Some(&mut stop), interrupt: flag.clone().into(), ..Hooks::default() };
        let result = fit(&mut oscillator_problem(), &settings_of_two, hooks).expect("something was evaluated");
        assert_eq!(result.warnings.iter().any(|w| w.contains("used up its 2 iterations")), said, "{:?}", result.warnings);
    }
    let flag = Arc::new(AtomicBool::new(true));
    let hooks = Hooks { interrupt: flag.clone().into(), ..Hooks::default() };
    let error = fit(&mut rosenbrock(), &settings(Optimizer::Lbfgs), hooks).expect_err("nothing was evaluated");
    assert!(matches!(error, FitError::Interrupted));
}

#[test]
fn senseless_problems_are_refused_by_name() {
    let with = |change: &dyn Fn(&mut FreeParameter)| {
        let mut p = parameter(0, Transform::Log, (1.0, 10.0), (2.0, 3.0));
        change(&mut p);
        let made = Problem::new(vec![scene(&[1.0], LeastSquares::new(1, |t| Some(vec![t[0]])))], vec![p]);
        made.err().unwrap_or_else(|| "accepted".into())
    };
    assert_eq!(with(&|_| ()), "accepted");
    assert!(with(&|p| p.bounds = (0.0, 1.0)).contains("p0: lower bound 0 must be positive"));
    assert!(with(&|p| p.start = (20.0, 30.0)).contains("outside the bounds"));
    assert!(with(&|p| p.start = (3.0, 2.0)).contains("smaller one first"));
    assert!(with(&|p| p.slots.clear()).contains("no scene"));
    assert!(with(&|p| p.slots[0].place = 1).contains("place 1"));
    assert!(with(&|p| p.slots[0].scene = 1).contains("scene number 1"));
    assert!(with(&|p| p.slots[0].factor = 0.0).contains("factor"));
    assert!(with(&|p| p.slots.push(p.slots[0])).contains("same number"));
}

/// Derivatives and costs as a graphics device has them: right to some 1e-4 and 1e-7.
struct SinglePrecision(LeastSquares);

impl Evaluate for SinglePrecision {
    fn parameters(&self) -> usize {
        self.0.parameters()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let mut all = self.0.evaluate(theta, request);
        for (member, e) in all.iter_mut().enumerate() {
            // Errors of rounding change with every bit of the parameters.
            let bits = theta.row(member).iter().fold(0u64, |hash, x| (hash ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            let error = |place: u32| (bits.rotate_left(8 * place) >> 11) as f64 / (1u64 << 52) as f64 - 1.0;
            e.cost *= 1.0 + 2e-7 * error(0);
            if let Some(c) = &mut e.curvature {
                let size = (0..c.gradient.len()).map(|p| (2.0 * e.cost * c.matrix[p * c.gradient.len() + p]).sqrt());
                let sizes: Vec<f64> = size.collect();
                c.gradient.iter_mut().zip(sizes).enumerate().for_each(|(p, (g, s))| *g += 3e-4 * s * error(p as u32 + 1));
            }
        }
        all
    }
}

#[test]
fn gauss_newton_ends_where_single_precision_has_nothing_more_to_say() {
    let noisy = |t: &[f64]| {
        let seen = oscillator(4.0, 0.3, 60);
        let off = |(i, (a, b)): (usize, (&f64, f64))| (a - b) / 0.01 + (7.0 * i as f64).sin();
        Some(oscillator(t[0], t[1], 60).iter().zip(seen).enumerate().map(off).collect::<Vec<f64>>())
    };
    let free = || {
        vec![parameter(0, Transform::Log, (0.04, 400.0), (0.4, 40.0)), parameter(1, Transform::Log, (0.003, 30.0), (0.03, 3.0))]
    };
    let of = |evaluate: Box<dyn Evaluate>| {
        let one = FitScene { evaluate, ..scene(&[4.0, 0.3], LeastSquares::new(2, |_| None)) };
        let mut problem = Problem::new(vec![one], free()).expect("the problem is valid");
        solve(&mut problem, &Settings { starts: 6, iterations: 40, ..settings(Optimizer::GaussNewton) })
    };
    let exact = of(Box::new(LeastSquares::new(2, noisy)));
    let rounded = of(Box::new(SinglePrecision(LeastSquares::new(2, noisy))));
    for (a, b) in exact.runs.iter().zip(&rounded.runs).filter(|(a, _)| a.status == Status::Converged) {
        assert_eq!(b.status, Status::Converged, "{b:?}");
        assert!(b.iterations <= a.iterations + 4, "{} and {} iterations", a.iterations, b.iterations);
    }
    // Of the errors that noise leaves the rounding takes a hundredth.
    for (a, b) in exact.parameters.iter().zip(&rounded.parameters) {
        assert!((a.value - b.value).abs() < 1e-2 * a.standard_error.expect("it is determined"), "{a:?} {b:?}");
    }
}
