//! A fit of the size of the paper's teddy on a graphics device: 2440 nodes, 100 steps of which every fifth is seen, gravity, Young's
//! modulus and both dampings unknown, 50 iterations of 18 starts. The teddy's scan is not published; a ball of as many nodes falls
//! on the ground in its place.

use super::PAPER_TEDDY;
use super::report::Report;
use crate::paper::scenes::{ball, cameras, gravity_stiffness_damping};
use crate::paper::study::{Search, Unknown, Watch, plan, record, search_on};
use crate::table;
use glam::DVec3;
use palpate::Backend;
use palpate_gpu::{Choice, Gpu};
use palpate_model::params::ParamKey;
use palpate_model::scene::Optimizer;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// A fit, and how long it took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Simulation nodes.
    pub nodes: usize,
    /// Steps of a simulation.
    pub steps: usize,
    /// Frames that are compared.
    pub frames: usize,
    /// Points of all frames.
    pub points: usize,
    /// Unknowns.
    pub parameters: usize,
    /// Most iterations of a start.
    pub iterations: usize,
    /// Starts, all in one batch.
    pub starts: usize,
    /// Evaluations of all starts.
    pub evaluations: usize,
    /// Wall-clock time, the building of tables and kernels included [s].
    pub seconds: f64,
    /// What as many iterations of one start would have taken with the paper's seconds per step [s].
    pub paper_start: f64,
    /// Relative error of Young's modulus at the best start.
    pub error: f64,
}

/// How large the fit is.
struct Size {
    /// Cells over the radius.
    cells: f64,
    steps: usize,
    pixels: usize,
    iterations: usize,
    starts: usize,
}

const TEDDY: Size = Size { cells: 6.9, steps: 100, pixels: 240, iterations: 50, starts: 18 };
/// Enough to see that it runs.
const TINY: Size = Size { cells: 2.0, steps: 10, pixels: 24, iterations: 2, starts: 2 };
/// Every so-th step is a frame.
const EVERY: usize = 5;

/// Runs it on the adapter that a backend would take; `tiny` for software adapters.
///
/// # Errors
/// There is no device, or no start can be evaluated.
pub fn run(tiny: bool) -> Result<Report, String> {
    let gpu = Gpu::open(&Choice::from_env()).map_err(|e| format!("{e} (hint: {})", e.hint()))?;
    let fit = fit(if tiny { &TINY } else { &TEDDY })?;
    Ok(Report {
        date: table::today(),
        threads: rayon::current_num_threads(),
        adapter: Some(gpu.name.clone()),
        copy: None,
        fit: Some(fit),
        fields: None,
        lines: Vec::new(),
        left_out: Vec::new(),
    })
}

fn fit(size: &Size) -> Result<Fit, String> {
    let mut scene = ball(0.05 / size.cells, 1);
    scene.time.steps = size.steps;
    let cameras = cameras(DVec3::new(0.0, 0.0, 0.06), 0.5, 0.5, 1, size.pixels);
    let watch = Watch { cameras, noise: 1e-4, every: EVERY, refine: 1.0, seed: 1 };
    let recording = record(&scene, &watch).map_err(|e| e.to_string())?;
    let plan = plan(&scene, &recording, 4.0).map_err(|e| e.to_string())?;
    let mut unknowns = gravity_stiffness_damping(&plan);
    unknowns.push(Unknown::within(&plan, ParamKey::MassDamping, 10.0));
    let how = Search { optimizer: Optimizer::Rprop, iterations: size.iterations, starts: size.starts, seed: 1 };
    println!("{} nodes, {} steps, {} starts", plan.body.nodes.len(), size.steps, size.starts);
    let clock = Instant::now();
    let result = search_on(Backend::Gpu, &plan, &unknowns, &how).map_err(|e| e.to_string())?;
    let seconds = clock.elapsed().as_secs_f64();
    let at = unknowns.iter().position(|u| u.key == ParamKey::YoungsModulus);
    let error = at.map_or(f64::NAN, |i| result.parameters[i].value / plan.theta[plan.layout.index(unknowns[i].key)] - 1.0);
    let frames = &plan.observation.frames;
    Ok(Fit {
        nodes: plan.body.nodes.len(),
        steps: size.steps,
        frames: frames.len(),
        points: frames.iter().map(|f| f.points.len()).sum(),
        parameters: unknowns.len(),
        iterations: size.iterations,
        starts: size.starts,
        evaluations: result.evaluations,
        seconds,
        paper_start: size.iterations as f64 * size.steps as f64 * PAPER_TEDDY.iter().sum::<f64>(),
        error,
    })
}

impl Fit {
    /// Prints it.
    pub fn print(&self) {
        println!(
            "fit of {} nodes, {} steps, {} frames with {} points, {} unknowns, {} iterations, {} starts: {:.1} s, {} evaluations, Young's \
             modulus {:+.2} %; the paper's seconds for one start: {:.0} s",
            self.nodes,
            self.steps,
            self.frames,
            self.points,
            self.parameters,
            self.iterations,
            self.starts,
            self.seconds,
            self.evaluations,
            100.0 * self.error,
            self.paper_start
        );
    }
}
