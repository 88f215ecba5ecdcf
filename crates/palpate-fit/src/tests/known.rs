//! What is known beforehand: derivatives, the Gaussian posterior of a linear problem, and who asks for it.

use super::models::{LeastSquares, parameter, scene};
use crate::{FitResult, FreeParameter, Hooks, Problem, Settings, Tolerance, Want, fit};
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;

/// Readings of a line a + b t at 40 times with errors of 0.1, drawn once; their mean square is that of noise.
fn readings() -> Vec<(f64, f64)> {
    let error = |i: usize| 0.1 * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    (0..40).map(|i| i as f64 / 40.0).enumerate().map(|(i, t)| (t, 0.7 + 1.3 * t + error(i))).collect()
}

fn line(known: [Option<(f64, f64)>; 2]) -> Problem<'static> {
    let model = LeastSquares::new(2, |p| Some(readings().iter().map(|(t, y)| (p[0] + p[1] * t - y) / 0.1).collect()));
    let free = |k: usize| FreeParameter { known: known[k], ..parameter(k, Transform::Linear, (-50.0, 50.0), (0.0, 0.0)) };
    Problem::new(vec![scene(&[0.0, 0.0], model)], vec![free(0), free(1)]).expect("the problem is valid")
}

fn solve(problem: &mut Problem, optimizer: Optimizer) -> FitResult {
    // First-order methods need many steps to the last digit.
    let tolerance = Tolerance { decrement: 0.0, ..Tolerance::default() };
    let settings = Settings { iterations: 2000, tolerance, ..Settings::new(optimizer) };
    fit(problem, &settings, Hooks::default()).expect("a line can be fitted")
}

/// Mean and covariance of the posterior: precision A = XᵀX/σ² + diag(1/sd²), mean A⁻¹ (Xᵀy/σ² + value/sd²).
fn posterior(known: [Option<(f64, f64)>; 2]) -> ([f64; 2], [f64; 2], f64) {
    let (mut a, mut b) = ([0.0; 3], [0.0; 2]);
    for (t, y) in readings() {
        for (sum, x) in a.iter_mut().zip([1.0, t, t * t]) {
            *sum += 100.0 * x;
        }
        b[0] += 100.0 * y;
        b[1] += 100.0 * t * y;
    }
    for (k, (value, sd)) in known.iter().enumerate().filter_map(|(k, p)| Some((k, (*p)?))) {
        a[2 * k] += 1.0 / (sd * sd);
        b[k] += value / (sd * sd);
    }
    let det = a[0] * a[2] - a[1] * a[1];
    let mean = [(a[2] * b[0] - a[1] * b[1]) / det, (a[0] * b[1] - a[1] * b[0]) / det];
    let sd = [(a[2] / det).sqrt(), (a[0] / det).sqrt()];
    (mean, sd, -a[1] / (a[0] * a[2]).sqrt())
}

#[test]
fn a_linear_problem_ends_at_its_gaussian_posterior_whoever_minimises() {
    let known = [Some((0.73, 0.03)), Some((1.2, 0.2))];
    let (mean, sd, correlation) = posterior(known);
    for (_, optimizer) in Optimizer::ALL {
        let result = solve(&mut line(known), optimizer);
        for k in 0..2 {
            let p = &result.parameters[k];
            // What a fit promises: a hundredth of the standard error.
            assert!((p.value - mean[k]).abs() < 0.01 * sd[k], "{optimizer:?}: {p:?} {mean:?}");
            // A reduced χ² above one widens by up to its root; derivatives are differences with an error of 1e-9.
            let s = result.reduced_chi_square.max(1.0);
            let (data, all) = (precision([None, None], k), precision(known, k));
            assert!(s < 1.1 && data < all, "{s}");
            let error = p.standard_error.expect("not at a bound");
            assert!((error / sd[k] - 1.0).abs() < s - 1.0 + 1e-6, "{optimizer:?}: {error} {sd:?} {s}");
            assert_eq!(p.known, known[k]);
        }
        assert!((result.correlation[0][1] - correlation).abs() < 0.05, "{correlation} {:?}", result.correlation);
    }
}

fn precision(known: [Option<(f64, f64)>; 2], k: usize) -> f64 {
    posterior(known).1[k].powi(-2)
}

#[test]
fn errors_are_those_of_the_closed_form_where_residuals_are_as_noisy_as_stated() {
    // A prior far from the data would raise χ²; at their own optimum it stays below one and s² = 1.
    let (at, ..) = posterior([None, None]);
    let known = [Some((at[0], 0.03)), None];
    let (mean, sd, correlation) = posterior(known);
    // To the last digit: the usual tolerance of the cost would leave √(41 · 1e-9) standard errors.
    let tolerance = Tolerance { decrement: 0.0, cost: 0.0, step: 1e-10, ..Tolerance::default() };
    let settings = Settings { tolerance, ..Settings::new(Optimizer::GaussNewton) };
    let result = fit(&mut line(known), &settings, Hooks::default()).expect("a line can be fitted");
    // 40 residuals of size one and a prior that is met, over 40 + 1 − 2; the line takes up a little of them.
    assert!((0.95..1.03).contains(&result.reduced_chi_square), "{}", result.reduced_chi_square);
    let s = result.reduced_chi_square.max(1.0);
    for k in 0..2 {
        let p = &result.parameters[k];
        assert!((p.value - mean[k]).abs() < 1e-6 * sd[k], "{p:?} {mean:?}");
        assert!((p.standard_error.unwrap() / sd[k] - 1.0).abs() <= s - 1.0 + 1e-6, "{p:?} {sd:?} {s}");
    }
    assert!((result.correlation[0][1] - correlation).abs() <= s - 1.0 + 1e-6);
    assert!(sd[0] < 0.03 && sd[1] < posterior([None, None]).1[1]);
}

#[test]
fn what_the_recording_widens_leaves_what_is_known_beforehand_alone() {
    // Readings that count once in a hundred: of the slope the data say little, and what is known of it stays.
    let known = [None, Some((1.3, 1e-3))];
    let mut worth = |_: &[Vec<f64>]| 100.0;
    let hooks = Hooks { design_effect: Some(&mut worth), ..Hooks::default() };
    let result = fit(&mut line(known), &Settings::new(Optimizer::GaussNewton), hooks).expect("a line can be fitted");
    let error = result.parameters[1].standard_error.expect("not at a bound");
    assert!((error / 1e-3 - 1.0).abs() < 0.02, "{error}");
    // The offset is what the mean of the readings leaves open, widened tenfold.
    let (s, free) = (result.reduced_chi_square.max(1.0).sqrt(), result.parameters[0].standard_error.expect("not at a bound"));
    assert!((free / (10.0 * s * 0.1 / 40f64.sqrt()) - 1.0).abs() < 0.01, "{free}");
}

#[test]
fn derivatives_match_differences_in_every_chart() {
    let transforms = [Transform::Log, Transform::Logit, Transform::Linear, Transform::Relative];
    let model = || LeastSquares::new(4, |p| Some(vec![p[0] * p[1] - 0.3, p[2] + p[3] - 0.1, p[0] - p[3], 0.5 * p[1] * p[2]]));
    let free = transforms.iter().enumerate().map(|(k, &t)| {
        let known = (k != 2).then_some((0.2 + 0.05 * k as f64, 0.01));
        FreeParameter { known, ..parameter(k, t, (1e-3, 0.999), (0.3, 0.3)) }
    });
    let mut problem = Problem::new(vec![scene(&[0.3; 4], model())], free.collect()).expect("valid");
    let z: Vec<f64> = problem.charts().iter().zip([0.2, 0.4, 0.3, 0.35]).map(|(c, v)| c.coordinate(v)).collect();
    let sample = problem.evaluate(std::slice::from_ref(&z), Want::Curvature).remove(0);
    let gradient = problem.evaluate(std::slice::from_ref(&z), Want::Gradient).remove(0).gradient;
    for k in 0..4 {
        let d = 1e-5;
        let mut cost = |by: f64| {
            let mut z = z.clone();
            z[k] += by;
            problem.evaluate(&[z], Want::Cost).remove(0).cost
        };
        // Truncation d²/6 of third derivatives of order a thousand, and rounding.
        let difference = (cost(d) - cost(-d)) / (2.0 * d);
        for g in [sample.gradient[k], gradient[k]] {
            assert!((g - difference).abs() < 1e-6 * difference.abs().max(1.0), "{k}: {g} {difference}");
        }
    }
    // The matrix: that of the data plus (slope/sd)²/n of each prior; products agree with it.
    let values = problem.values(&z);
    let rows = problem.known_rows(&values);
    assert_eq!(rows.iter().map(|r| r.index).collect::<Vec<_>>(), [0, 1, 3]);
    let bare = transforms.iter().enumerate().map(|(k, &t)| parameter(k, t, (1e-3, 0.999), (0.3, 0.3))).collect();
    let mut data = Problem::new(vec![scene(&[0.3; 4], model())], bare).expect("valid");
    let plain = data.evaluate(std::slice::from_ref(&z), Want::Curvature).remove(0);
    for k in 0..16 {
        let prior = rows.iter().find(|r| 5 * r.index == k).map_or(0.0, |r| {
            let slope = problem.charts()[r.index].slope(z[r.index]);
            (slope * r.slope).powi(2) / 4.0
        });
        assert!((sample.curvature[k] - plain.curvature[k] - prior).abs() < 1e-12 * sample.curvature[k].abs().max(1.0));
    }
    let v = [0.3, -1.0, 0.2, 0.7];
    let product = problem.product(&z, &v).expect("the model has products");
    for i in 0..4 {
        let by_matrix: f64 = (0..4).map(|j| sample.curvature[4 * i + j] * v[j]).sum();
        assert!((product[i] - by_matrix).abs() < 1e-9 * by_matrix.abs().max(1.0), "{product:?}");
    }
}

#[test]
fn a_prior_that_makes_no_sense_is_refused() {
    let refused = |known| {
        let model = LeastSquares::new(1, |p| Some(vec![p[0]]));
        let free = FreeParameter { known: Some(known), ..parameter(0, Transform::Log, (1e-2, 1e2), (1.0, 1.0)) };
        Problem::new(vec![scene(&[1.0], model)], vec![free]).err().expect("it makes no sense")
    };
    assert_eq!(refused((1.0, 0.0)), "parameter p0: known to ± 0: the standard deviation must be a finite number > 0");
    assert_eq!(refused((200.0, 1.0)), "parameter p0: known value 200 lies outside the bounds [0.01, 100]");
}
