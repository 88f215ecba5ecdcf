//! Whole fits.

use super::models::*;
use crate::*;
use palpate_model::scene::Optimizer;

fn settings(optimizer: Optimizer) -> Settings {
    Settings { iterations: 100, ..Settings::new(optimizer) }
}

#[test]
fn gauss_newton_crosses_rosenbrocks_valley() {
    let result = fit(&mut rosenbrock(), &settings(Optimizer::GaussNewton), Hooks::default()).expect("it can be evaluated");
    assert_eq!(result.runs[0].status, Status::Converged);
    // Zero-residual problem: convergence is quadratic, and stops at a step of 1e-7.
    assert!(result.values.iter().all(|v| (v - 1.0).abs() < 1e-6), "{:?}", result.values);
    assert_eq!(result.theta[0], result.values);
}

#[test]
fn several_starts_find_an_oscillator() {
    let settings = Settings { starts: 8, ..settings(Optimizer::GaussNewton) };
    let result = fit(&mut oscillator_problem(), &settings, Hooks::default()).expect("it can be evaluated");
    assert!((result.values[0] / 4.0 - 1.0).abs() < 1e-6, "{:?}", result.values);
    assert!((result.values[1] / 0.3 - 1.0).abs() < 1e-6, "{:?}", result.values);
    assert_eq!(result.runs.len(), 8);
}

const ALL: [Optimizer; 5] =
    [Optimizer::Rprop, Optimizer::GradientDescent, Optimizer::Lbfgs, Optimizer::GaussNewton, Optimizer::NelderMead];

#[test]
fn every_optimiser_finds_an_oscillator() {
    for optimizer in ALL {
        let settings = Settings { starts: 6, iterations: 200, ..settings(optimizer) };
        let r = fit(&mut oscillator_problem(), &settings, Hooks::default()).expect("it can be evaluated");
        for run in &r.runs {
            eprintln!(
                "{optimizer:?} {:?} -> {:?} {} it {} ev {} {:?}",
                run.start, run.end, run.cost, run.iterations, run.evaluations, run.status
            );
        }
    }
}

#[test]
fn every_optimiser_rosen() {
    for optimizer in ALL {
        let settings = Settings { starts: 3, iterations: 2000, ..settings(optimizer) };
        let r = fit(&mut rosenbrock(), &settings, Hooks::default()).expect("it can be evaluated");
        for run in &r.runs {
            eprintln!(
                "{optimizer:?} {:?} -> {:?} {} it {} ev {} {:?}",
                run.start, run.end, run.cost, run.iterations, run.evaluations, run.status
            );
        }
    }
}
