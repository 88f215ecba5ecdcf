//! No inverse crime: the torus' stiffness from recordings of a simulation twice as fine in space and time.

use super::scenes;
use super::study::{self, Recovery, Search, Unknown, Watch};
use crate::table;
use glam::DVec3;
use palpate::Error;
use palpate_model::params::ParamKey;
use palpate_model::scene::Optimizer;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::time::Instant;

/// How far E is off at one cell size, over several recordings.
#[derive(Clone, Debug, Serialize)]
pub struct Finer {
    /// Cell of the fit [m]; the recording's is half of it.
    pub cell: f64,
    /// Factor of the ghost penalty, in the recording as in the fit.
    pub ghost: f64,
    /// Noise of a reading in cells.
    pub noise: f64,
    /// Simulation nodes of the fit, mean.
    pub nodes: usize,
    /// Recordings: each with its own noise and place on the lattice.
    pub recordings: usize,
    /// Starts of the fit to each.
    pub starts: usize,
    /// Starts that ended within 5 % of the truth.
    pub converged: usize,
    /// Signed relative error of the best start of every fit [%].
    pub errors_percent: Vec<f64>,
    /// Their mean [%].
    pub mean_percent: f64,
    /// Standard error of the mean [%].
    pub standard_error_percent: f64,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// What is asked of recordings that are twice as fine.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// Factor of the ghost penalty.
    pub ghost: f64,
    /// Noise in cells.
    pub noise: f64,
    /// Recordings of each cell size.
    pub recordings: u64,
    /// Starts of each fit.
    pub starts: usize,
}

/// Noise that leaves some 0.2 % to a fit where the grid's own error is asked for; a tenth of a cell would leave 1 %.
pub const FAINT: f64 = 0.02;

/// Fits recordings at every cell size: one camera of 50², every other step a frame.
///
/// # Errors
/// A scene cannot be simulated, or no fit can be made.
pub fn finer(cells: &[f64], asked: Asked) -> Result<Vec<Finer>, Error> {
    let one = |&cell: &f64| {
        let line = at(cell, asked)?;
        println!(
            "finer, cell {cell} m, ghost penalty {}, noise {} cells: {:+.2} % ± {:.2} %, {}/{} converged, {:.0} s",
            line.ghost,
            line.noise,
            line.mean_percent,
            line.standard_error_percent,
            line.converged,
            line.recordings * line.starts,
            line.seconds
        );
        Ok(line)
    };
    cells.iter().map(one).collect()
}

fn at(cell: f64, asked: Asked) -> Result<Finer, Error> {
    let clock = Instant::now();
    let (mut errors, mut nodes, mut converged) = (Vec::new(), 0, 0);
    for seed in 1..=asked.recordings {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = cell * DVec3::new(rng.random(), rng.random(), rng.random());
        let mut truth = scenes::moved(scenes::torus(cell), place);
        truth.solver.ghost = asked.ghost;
        let cameras = scenes::cameras(place + DVec3::new(0.0, 0.0, 0.1), 1.0, 26.0, 1, 50);
        let watch = Watch { cameras, noise: asked.noise * cell, every: 2, refine: 2.0, seed };
        let plan = study::plan(&truth, &study::record(&truth, &watch)?, 5.0)?;
        let unknown = Unknown::within(&plan, ParamKey::YoungsModulus, 10.0);
        let how = Search { optimizer: Optimizer::GaussNewton, iterations: 30, starts: asked.starts, seed };
        let recovery = Recovery::of(&study::search(&plan, &[unknown], &how)?, 0, truth.material.youngs_modulus);
        errors.push(100.0 * recovery.best_error);
        converged += recovery.converged;
        nodes += plan.body.nodes.len();
    }
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / n;
    let squares: f64 = errors.iter().map(|e| (e - mean).powi(2)).sum();
    Ok(Finer {
        cell,
        ghost: asked.ghost,
        noise: asked.noise,
        nodes: nodes / errors.len(),
        recordings: errors.len(),
        starts: asked.starts,
        converged,
        mean_percent: mean,
        standard_error_percent: (squares / (n - 1.0) / n).sqrt(),
        errors_percent: errors,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// Prints the table.
pub fn print(lines: &[Finer]) {
    let head = ["cell", "ghost penalty", "noise / cell", "nodes", "converged", "mean error", "standard error", "time"];
    let mut rows = vec![head.map(String::from).to_vec()];
    rows.extend(lines.iter().map(|l| {
        vec![
            format!("{} m", l.cell),
            l.ghost.to_string(),
            l.noise.to_string(),
            l.nodes.to_string(),
            format!("{}/{}", l.converged, l.recordings * l.starts),
            format!("{:+.2} %", l.mean_percent),
            format!("{:.2} %", l.standard_error_percent),
            format!("{:.0} s", l.seconds),
        ]
    }));
    table::print("torus from recordings twice as fine, errors of E", &rows);
}
