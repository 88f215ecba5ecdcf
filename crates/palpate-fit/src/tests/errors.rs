//! Standard errors and what cannot be told apart.

use super::fits::{settings, solve, values};
use super::models::*;
use crate::*;
use palpate_model::params::Transform;
use palpate_model::scene::Optimizer;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// y = a + b t at 40 times, with errors of σ (the stated noise is 0.1).
fn line(sigma: f64, seed: u64, common: f64) -> Problem<'static> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let shift: f64 = common * normal();
    let data: Vec<(f64, f64)> = (0..40).map(|i| i as f64 / 40.0).map(|t| (t, 2.0 + 3.0 * t + sigma * normal() + shift)).collect();
    let model = LeastSquares::new(2, move |p| Some(data.iter().map(|(t, y)| (p[0] + p[1] * t - y) / 0.1).collect()));
    let free = (0..2).map(|p| parameter(p, Transform::Log, (1e-3, 1e3), (1.0, 1.0))).collect();
    Problem::new(vec![scene(&[1.0, 1.0], model)], free).expect("the problem is valid")
}

/// Mean stated standard error over empirical spread, for both parameters, over 200 noise draws.
fn coverage(sigma: f64, common: f64, errors: ErrorModel) -> Vec<f64> {
    let draws = 200;
    let fits: Vec<FitResult> = (0..draws)
        .map(|seed| {
            solve(&mut line(sigma, seed, common), &Settings { errors: errors.clone(), ..settings(Optimizer::GaussNewton) })
        })
        .collect();
    (0..2)
        .map(|i| {
            let mean = fits.iter().map(|f| values(f)[i]).sum::<f64>() / draws as f64;
            let variance = fits.iter().map(|f| (values(f)[i] - mean).powi(2)).sum::<f64>() / (draws - 1) as f64;
            let stated = fits.iter().filter_map(|f| f.parameters[i].standard_error).sum::<f64>() / draws as f64;
            stated / variance.sqrt()
        })
        .collect()
}

/// The spread of 200 draws has a relative standard error of 1/√400 = 5 %; this is three of them.
const THREE_SIGMA: f64 = 0.15;

#[test]
fn standard_errors_cover_the_spread_of_noise() {
    for ratio in coverage(0.1, 0.0, ErrorModel::default()) {
        // s² = max(1, χ²) makes errors larger on average by 2 to 4 % with 38 degrees of freedom.
        assert!((ratio / 1.04 - 1.0).abs() < THREE_SIGMA, "{ratio}");
    }
}

#[test]
fn residuals_larger_than_the_noise_widen_standard_errors() {
    for ratio in coverage(0.3, 0.0, ErrorModel::default()) {
        assert!((ratio - 1.0).abs() < THREE_SIGMA, "{ratio}");
    }
}

#[test]
fn smaller_residuals_do_not_narrow_standard_errors() {
    for ratio in coverage(0.03, 0.0, ErrorModel::default()) {
        // The stated noise is 0.1/0.03 times the real one.
        assert!((ratio / (0.1 / 0.03) - 1.0).abs() < THREE_SIGMA, "{ratio}");
    }
}

#[test]
fn a_shared_error_is_covered() {
    // One error of 0.2 = 2 σ shared by all residuals: without it in the error model the offset's error is far too small.
    let blind = coverage(0.1, 0.2, ErrorModel::default())[0];
    let told = coverage(0.1, 0.2, ErrorModel { systematic: 2.0, ..ErrorModel::default() });
    assert!(blind < 0.4, "{blind}");
    assert!(told.iter().all(|&ratio| ratio > 1.0 - THREE_SIGMA), "a bound: {told:?}");
}

#[test]
fn errors_that_go_together_widen_by_what_they_are_worth() {
    let plain = solve(&mut line(0.1, 1, 0.0), &settings(Optimizer::GaussNewton));
    let mut asked = Vec::new();
    let mut worth = |theta: &[Vec<f64>]| {
        asked.push(theta.to_vec());
        9.0
    };
    let hooks = Hooks { design_effect: Some(&mut worth), ..Hooks::default() };
    let wide = fit(&mut line(0.1, 1, 0.0), &settings(Optimizer::GaussNewton), hooks).expect("the line can be fitted");
    assert_eq!(asked, std::slice::from_ref(&plain.theta), "asked once, at the best point");
    assert_eq!((plain.independent, wide.independent), (40.0, 40.0 / 9.0));
    for (p, w) in plain.parameters.iter().zip(&wide.parameters) {
        assert!((w.standard_error.unwrap() / p.standard_error.unwrap() - 3.0).abs() < 1e-12);
    }
    // A narrowing is not believed.
    let mut less = |_: &[Vec<f64>]| 0.25;
    let hooks = Hooks { design_effect: Some(&mut less), ..Hooks::default() };
    let same = fit(&mut line(0.1, 1, 0.0), &settings(Optimizer::GaussNewton), hooks).expect("the line can be fitted");
    assert_eq!(same.parameters, plain.parameters);
}

#[test]
fn correlation_and_errors_match_the_closed_form() {
    let result = solve(&mut line(0.1, 1, 0.0), &settings(Optimizer::GaussNewton));
    let t: Vec<f64> = (0..40).map(|i| i as f64 / 40.0).collect();
    let (s0, s1, s2) = (40.0, t.iter().sum::<f64>(), t.iter().map(|t| t * t).sum::<f64>());
    let s_square = result.reduced_chi_square.max(1.0) * 0.01;
    let det = s0 * s2 - s1 * s1;
    // Derivatives of the test model are differences with an error of 1e-9.
    let expected = [(s_square * s2 / det).sqrt(), (s_square * s0 / det).sqrt()];
    for (p, e) in result.parameters.iter().zip(expected) {
        assert!((p.standard_error.expect("not at a bound") / e - 1.0).abs() < 1e-6);
    }
    assert!((result.correlation[0][1] + s1 / (s0 * s2).sqrt()).abs() < 1e-6);
    assert_eq!(result.correlation[0][0], 1.0);
    assert!(result.warnings.is_empty(), "{:?}", result.warnings);
}

/// Residuals that see E and β only in the product E β (plus a whiff of E).
fn ambiguous(whiff: f64) -> Problem<'static> {
    let model = LeastSquares::new(2, move |t| {
        let product = (0..50).map(|i| (t[0] * t[1] * (1.0 + 0.001 * i as f64) / 200.0 - 1.0) / 0.05);
        Some(product.chain((0..50).map(|_| whiff * (t[0] / 2e4).ln())).collect())
    });
    let mut free =
        vec![parameter(0, Transform::Log, (1e2, 1e7), (1e4, 1e5)), parameter(1, Transform::Log, (1e-6, 1.0), (1e-3, 1e-1))];
    free[0].path = "material.youngs_modulus".into();
    free[0].unit = "Pa".into();
    free[1].path = "material.stiffness_damping".into();
    Problem::new(vec![scene(&[2e4, 1e-2], model)], free).expect("the problem is valid")
}

#[test]
fn parameters_that_only_act_together_are_named() {
    let result = solve(&mut ambiguous(0.0), &Settings { starts: 6, ..settings(Optimizer::GaussNewton) });
    let sentence = "material.youngs_modulus and material.stiffness_damping cannot be told apart: only their combination \
                    youngs_modulus^0.71·stiffness_damping^0.71 is determined";
    assert!(result.warnings.iter().any(|w| w == sentence), "{:#?}", result.warnings);
    let told = result.warnings.iter().filter(|w| w.contains("told apart")).count();
    assert_eq!(told, 1, "once is enough");
    assert!(result.parameters[0].standard_error.expect("inside its bounds") > result.parameters[0].value);
}

#[test]
fn a_weakly_determined_pair_is_named_by_its_correlation() {
    let result = solve(&mut ambiguous(1.0), &settings(Optimizer::GaussNewton));
    assert!(result.correlation[0][1] < -0.95);
    let relative = result.parameters[0].standard_error.expect("inside its bounds") / result.parameters[0].value;
    assert!(relative < 0.5, "not undetermined as such: {relative}");
    assert!(result.warnings.iter().any(|w| w.contains("cannot be told apart")), "{:?}", result.warnings);
}

#[test]
fn a_parameter_without_effect_is_named() {
    let model = LeastSquares::new(2, |t| Some((0..9).map(|i| t[0] - 1.0 + 0.1 * (i as f64 - 4.0) + 1e-9 * t[1]).collect()));
    let free = (0..2).map(|p| parameter(p, Transform::Log, (1e-2, 1e2), (2.0, 2.0))).collect();
    let mut problem = Problem::new(vec![scene(&[2.0, 2.0], model)], free).expect("valid");
    let result = solve(&mut problem, &settings(Optimizer::GaussNewton));
    assert!(result.warnings.iter().any(|w| w.starts_with("p1 is not determined: a factor of")), "{:?}", result.warnings);
    assert!(!result.warnings.iter().any(|w| w.starts_with("p0")), "{:?}", result.warnings);
}

#[test]
fn what_is_not_determined_has_a_range_in_its_unit() {
    // An offset of 0.1 m read four times with an error of 2 m each, and a stiffness with one of 0.6 in its logarithm.
    let model = LeastSquares::new(2, |t| {
        let offset = |i: i32| if i < 4 { (t[0] - 0.1) / 2.0 } else { 0.0 };
        Some((0..8).map(|i| offset(i) + if i < 4 { 0.0 } else { (t[1] / 2e4).ln() / 1.2 }).collect())
    });
    let mut free =
        vec![parameter(0, Transform::Linear, (-50.0, 50.0), (0.3, 0.3)), parameter(1, Transform::Log, (1e2, 1e7), (1e4, 1e4))];
    (free[0].unit, free[1].unit) = ("m".into(), "Pa".into());
    let mut problem = Problem::new(vec![scene(&[0.3, 1e4], model)], free).expect("valid");
    let result = solve(&mut problem, &settings(Optimizer::GaussNewton));
    let told = |words: &str| result.warnings.iter().any(|w| w == &format!("{words} changes the fit no more than the noise does"));
    assert!(told("p0 is not determined: anything from -0.9 m to 1.1 m around 0.1 m"), "{:?}", result.warnings);
    assert!(told("p1 is not determined: a factor of 1.8 up or down"), "{:?}", result.warnings);
}

#[test]
fn starts_with_equal_costs_elsewhere_are_reported() {
    // An even function: −1 and 1 cannot be told apart, yet each is sharply determined by the curvature.
    let even = |tilt: f64| {
        let model = LeastSquares::new(1, move |t| {
            let even = (0..20).map(|i| 10.0 * (t[0] * t[0] - 1.0) + if i % 2 == 0 { 1.0 } else { -1.0 });
            Some(even.chain([tilt * (t[0] + 1.0)]).collect())
        });
        Problem::new(vec![scene(&[0.8], model)], vec![parameter(0, Transform::Linear, (-3.0, 3.0), (-2.0, 2.0))]).expect("valid")
    };
    let many = Settings { starts: 8, ..settings(Optimizer::GaussNewton) };
    let result = solve(&mut even(0.0), &many);
    assert!(
        result
            .warnings
            .iter()
            .any(|w| w.starts_with("p0 is not unique: 8 of 8 starts reach equal costs with values from -1 to 1")),
        "{:?}",
        result.warnings
    );
    let result = solve(&mut even(2.0), &many);
    assert!(result.warnings.is_empty(), "the cost tells the minima apart: {:?}", result.warnings);
}

#[test]
fn logits_have_errors_in_their_own_unit() {
    // A Poisson's ratio measured directly 25 times with σ = 0.01.
    let model = LeastSquares::new(1, |t| Some((0..25).map(|i| (t[0] - 0.3) / 0.01 + (i as f64 - 12.0) / 8.0).collect()));
    let mut problem = Problem::new(vec![scene(&[0.1], model)], vec![parameter(0, Transform::Logit, (-0.5, 0.4999), (0.1, 0.1))])
        .expect("valid");
    let p = solve(&mut problem, &settings(Optimizer::GaussNewton)).parameters.remove(0);
    // Convergence and difference quotients of the model to 1e-7; χ² per degree of freedom is below 1.
    assert!((p.value - 0.3).abs() < 1e-6, "{p:?}");
    assert!((p.standard_error.expect("inside") / 0.002 - 1.0).abs() < 1e-4, "{p:?}");
}

#[test]
fn a_direction_has_the_error_of_its_angle() {
    // The angle of a vector in the plane, read 25 times with an error of 0.1 rad each: 0.02 rad.
    let model = LeastSquares::new(2, |p| Some(vec![(p[1].atan2(p[0]) - 0.6) / 0.1; 25]));
    let vector = |p| FreeParameter { direction: Some("v".into()), ..parameter(p, Transform::Linear, (-10.0, 10.0), (2.0, 2.0)) };
    let mut problem = Problem::new(vec![scene(&[2.0, 2.0], model)], vec![vector(0), vector(1)]).expect("the problem is valid");
    let fit = solve(&mut problem, &settings(Optimizer::GaussNewton));
    let v = values(&fit);
    let length = (v[0] * v[0] + v[1] * v[1]).sqrt();
    for (p, across) in fit.parameters.iter().zip([v[1], v[0]]) {
        // Central differences of the residuals.
        let expected = 0.02 * length * (across / length).abs();
        assert!((p.standard_error.unwrap() / expected - 1.0).abs() < 1e-4, "{p:?} {expected}");
    }
    assert!(fit.warnings.iter().all(|w| !w.contains("told apart") && !w.contains("determine")), "{:?}", fit.warnings);
}
