//! No inverse crime: the torus' stiffness from recordings of a simulation twice as fine in space and time.

use super::scenes;
use super::study::{self, CONVERGED, Search, Unknown, Watch};
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
    /// Simulation nodes of the fit, mean.
    pub nodes: usize,
    /// Recordings: each with its own noise, place on the lattice and start.
    pub recordings: usize,
    /// Fits that ended within 5 % of the truth.
    pub converged: usize,
    /// Signed relative error of every fit [%].
    pub errors_percent: Vec<f64>,
    /// Their mean [%].
    pub mean_percent: f64,
    /// Standard error of the mean [%].
    pub standard_error_percent: f64,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Fits `recordings` recordings at every cell size: one camera of 50², every other step a frame. What is asked is the grid's own
/// error, so the noise is a fiftieth of a cell, which leaves some 0.2 % to a fit; a tenth of a cell, as in the other tables, would
/// leave 1 %.
///
/// # Errors
/// A scene cannot be simulated, or no fit can be made.
pub fn finer(cells: &[f64], ghost: f64, recordings: u64) -> Result<Vec<Finer>, Error> {
    let one = |&cell: &f64| {
        let line = at(cell, ghost, recordings)?;
        println!(
            "finer, cell {cell} m, ghost penalty {ghost}: {:+.2} % ± {:.2} %, {:.0} s",
            line.mean_percent, line.standard_error_percent, line.seconds
        );
        Ok(line)
    };
    cells.iter().map(one).collect()
}

fn at(cell: f64, ghost: f64, recordings: u64) -> Result<Finer, Error> {
    let clock = Instant::now();
    let (mut errors, mut nodes) = (Vec::new(), 0);
    for seed in 1..=recordings {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let place = cell * DVec3::new(rng.random(), rng.random(), rng.random());
        let mut truth = scenes::moved(scenes::torus(cell), place);
        truth.solver.ghost = ghost;
        let cameras = scenes::cameras(place + DVec3::new(0.0, 0.0, 0.1), 1.0, 26.0, 1, 50);
        let watch = Watch { cameras, noise: 0.02 * cell, every: 2, refine: 2.0, seed };
        let plan = study::plan(&truth, &study::record(&truth, &watch)?, 5.0)?;
        let unknown = Unknown::within(&plan, ParamKey::YoungsModulus, 10.0);
        let how = Search { optimizer: Optimizer::GaussNewton, iterations: 30, starts: 1, seed };
        let found = study::search(&plan, &[unknown], &how)?.parameters[0].value;
        errors.push(100.0 * (found / truth.material.youngs_modulus - 1.0));
        nodes += plan.body.nodes.len();
    }
    let n = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / n;
    let squares: f64 = errors.iter().map(|e| (e - mean).powi(2)).sum();
    Ok(Finer {
        cell,
        ghost,
        nodes: nodes / errors.len(),
        recordings: errors.len(),
        converged: errors.iter().filter(|e| e.abs() <= 100.0 * CONVERGED).count(),
        mean_percent: mean,
        standard_error_percent: (squares / (n - 1.0) / n).sqrt(),
        errors_percent: errors,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// Prints the table.
pub fn print(lines: &[Finer]) {
    let head = ["cell", "ghost penalty", "nodes", "converged", "mean error", "standard error", "time"];
    let mut rows = vec![head.map(String::from).to_vec()];
    rows.extend(lines.iter().map(|l| {
        vec![
            format!("{} m", l.cell),
            l.ghost.to_string(),
            l.nodes.to_string(),
            format!("{}/{}", l.converged, l.recordings),
            format!("{:+.2} %", l.mean_percent),
            format!("{:.2} %", l.standard_error_percent),
            format!("{:.0} s", l.seconds),
        ]
    }));
    table::print("torus from recordings twice as fine, errors of E", &rows);
}
