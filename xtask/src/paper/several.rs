//! A bouncing ball whose gravity, stiffness and damping are all unknown: what a recording tells apart, and what it is said not to. (Weiss et al. find
//! gravity in all 60 of their starts, and many pairs of the other two that do as well.)

use super::scenes;
use super::study::{self, Recovery, Search, Watch};
use crate::table;
use glam::DVec3;
use palpate::Error;
use palpate_fit::FitResult;
use palpate_model::params::ParamKey;
use palpate_model::scene::Optimizer;
use serde::Serialize;
use std::time::Instant;

/// A start has arrived when its cost is within this share of the best one's.
const AS_GOOD: f64 = 0.01;
/// Where gravity counts as found: error over its size.
const FOUND: f64 = 0.005;

/// One recording.
#[derive(Clone, Debug, Serialize)]
pub struct Several {
    /// Every so-th of 20 steps is a frame.
    pub every: usize,
    /// Simulation nodes.
    pub nodes: usize,
    /// Starts that end as well as the best.
    pub arrived: usize,
    /// Of these, starts whose gravity is within half a percent.
    pub gravity_found: usize,
    /// Starts.
    pub starts: usize,
    /// Largest error of gravity among those that arrived, over its size [%].
    pub gravity_error_percent: f64,
    /// Young's modulus and stiffness damping of the best: signed error and standard error [%].
    pub others_percent: [[f64; 2]; 2],
    /// Correlation of the two.
    pub correlation: f64,
    /// Whether the fit warns that the two cannot be told apart.
    pub warned: bool,
    /// Median evaluations of a start.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Fits the ball's bounce, of which every so-th step is seen, from so many starts: gravity up to 5 m/s² off in every component, the others
/// by factors of up to ten.
///
/// # Errors
/// The scene cannot be simulated, or no start of the fit can be evaluated.
pub fn several(cell: f64, every: usize, starts: usize) -> Result<Several, Error> {
    let clock = Instant::now();
    let truth = scenes::ball(cell, 1);
    let watch = Watch {
        cameras: scenes::cameras(DVec3::new(0.0, 0.0, 0.07), 0.6, 30.0, 1, 50),
        noise: 0.1 * cell,
        every,
        refine: 1.0,
        seed: 4,
    };
    let plan = study::plan(&truth, &study::record(&truth, &watch)?, 4.0)?;
    let how = Search { optimizer: Optimizer::GaussNewton, iterations: 30, starts, seed: 5 };
    let result = study::search(&plan, &scenes::gravity_stiffness_damping(&plan), &how)?;
    let value = |k| plan.theta[plan.layout.index(k)];
    let gravity = DVec3::from([0, 1, 2].map(|axis| value(ParamKey::Gravity(axis))));
    let off = |end: &[f64]| (DVec3::from_slice(end) - gravity).length() / gravity.length();
    let good: Vec<f64> = result.runs.iter().filter(|r| r.cost < (1.0 + AS_GOOD) * result.cost).map(|r| off(&r.end)).collect();
    let recovered = |place: usize, truth: f64| {
        let error = result.parameters[place].standard_error.unwrap_or(f64::INFINITY) / truth;
        let r = Recovery::of(&result, place, truth);
        ([r.best_error, error].map(|x| 100.0 * x), r.evaluations)
    };
    let (modulus, evaluations) = recovered(3, truth.material.youngs_modulus);
    let (damping, _) = recovered(4, truth.material.stiffness_damping);
    let line = Several {
        every,
        nodes: plan.body.nodes.len(),
        arrived: good.len(),
        gravity_found: good.iter().filter(|e| **e < FOUND).count(),
        starts: result.runs.len(),
        gravity_error_percent: 100.0 * good.iter().copied().fold(0.0, f64::max),
        others_percent: [modulus, damping],
        correlation: result.correlation[3][4],
        warned: warns_of_ambiguity(&result),
        evaluations,
        seconds: clock.elapsed().as_secs_f64(),
    };
    println!(
        "gravity, every {every}: {} of {} arrived, gravity off by {:.2} % at most, {:.0} s",
        line.arrived, line.starts, line.gravity_error_percent, line.seconds
    );
    Ok(line)
}

/// True if a fit warns of stiffness and damping together.
pub fn warns_of_ambiguity(result: &FitResult) -> bool {
    let both = ["material.youngs_modulus", "material.stiffness_damping"];
    result.warnings.iter().any(|w| both.iter().all(|path| w.contains(path)))
}

/// Prints the table.
pub fn print(lines: &[Several]) {
    let head =
        ["frames", "nodes", "arrived", "gravity found", "off by", "E", "damping", "correlation", "said", "evaluations", "time"];
    let mut rows = vec![head.map(String::from).to_vec()];
    let error = |[off, sd]: [f64; 2]| format!("{off:+.2} ± {sd:.2} %");
    rows.extend(lines.iter().map(|l| {
        vec![
            format!("every {}", l.every),
            l.nodes.to_string(),
            format!("{}/{}", l.arrived, l.starts),
            format!("{}/{}", l.gravity_found, l.arrived),
            format!("{:.2} %", l.gravity_error_percent),
            error(l.others_percent[0]),
            error(l.others_percent[1]),
            format!("{:.3}", l.correlation),
            if l.warned { "not told apart" } else { "-" }.into(),
            l.evaluations.to_string(),
            format!("{:.0} s", l.seconds),
        ]
    }));
    table::print("ball with gravity, E and damping unknown", &rows);
}
