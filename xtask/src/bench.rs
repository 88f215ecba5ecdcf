//! `cargo xtask bench`: seconds per time step, beside the paper's, and how they grow with size.

use glam::{DAffine3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::body::Body;
use palpate_model::observation::{Camera, Frame, Observation, ObservedPoint};
use palpate_model::params::{Layout, ParamKey};
use palpate_model::plan::{Clock, Plan, PlaneSite};
use palpate_model::scene::{Analytic, InitialShape, RotationUpdate, Solver};
use palpate_model::shape::{Placed, Shape};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Steps that are timed; the first two are left out of the medians (caches, first factorisation).
const STEPS: usize = 12;
/// Points of a frame, about what a 50 × 50 camera sees of a body.
const POINTS: usize = 1000;

/// Seconds: median, smallest and largest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Seconds {
    /// Median.
    pub median: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// One row of the table.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// What was simulated.
    pub name: String,
    /// Simulation nodes.
    pub nodes: usize,
    /// Cells.
    pub cells: usize,
    /// Band nodes.
    pub band_nodes: usize,
    /// A time step.
    pub forward: Seconds,
    /// Matching and cost of a frame.
    pub cost: Seconds,
    /// Adjoint of a step and its frame.
    pub adjoint: Seconds,
    /// The paper's seconds (forward, cost, adjoint; RTX 2070), where it has them.
    pub paper: Option<[f64; 3]>,
    /// Bytes of one state on the tape.
    pub state_bytes: usize,
    /// Bytes of the system matrix.
    pub matrix_bytes: usize,
}

/// A whole run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// `bench/1`.
    pub format: String,
    /// Backend.
    pub backend: String,
    /// Seconds since 1970 when it was made.
    pub unix_time: u64,
    /// Threads in use.
    pub threads: usize,
    /// Rows.
    pub rows: Vec<Row>,
}

/// Bodies to time: the paper's dragon where its file is given, and balls of about so many nodes.
pub fn run(dragon: Option<&Path>, sizes: &[usize]) -> Result<Report, String> {
    let mut rows = Vec::new();
    if let Some(path) = dragon {
        let length = 0.3;
        let sdf = palpate_io::read_sdf(path, length / 5.0).map_err(|e| e.to_string())?.snapped();
        for rotation in [RotationUpdate::Converged, RotationUpdate::Lagged] {
            let name = format!("dragon, {} rotation", if rotation == RotationUpdate::Lagged { "lagged" } else { "converged" });
            rows.push(time(&name, &sdf, length / 30.0, rotation, Some([0.318, 0.172, 0.462]))?);
        }
    }
    for &nodes in sizes {
        // A ball of n cells across has about π/6 n³ nodes, and a few per cent of surface ones more.
        let across = (nodes as f64 * 6.0 / std::f64::consts::PI).cbrt() - 1.0;
        let ball = Placed::new(Analytic::Ball { radius: 0.1, center: DVec3::new(0.001, 0.002, 0.103) }, DAffine3::IDENTITY);
        rows.push(time("ball, converged rotation", &ball, 0.2 / across, RotationUpdate::Converged, None)?);
    }
    let unix_time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    Ok(Report { format: "bench/1".into(), backend: CpuBackend.name(), unix_time, threads: rayon::current_num_threads(), rows })
}

/// A body that falls onto the ground, its surface at rest being what a camera saw.
fn plan(shape: &dyn Shape, h: f64, rotation: RotationUpdate) -> Result<Plan, String> {
    let band = 4.0 * h;
    let body = Body::build(shape, h, band, 2).map_err(|e| e.to_string())?;
    let layout = Layout::new(1, 0);
    let bottom = body.patches.iter().map(|p| p.point.z).fold(f64::INFINITY, f64::min);
    let theta = layout
        .keys
        .iter()
        .map(|k| match k {
            ParamKey::YoungsModulus => 5e4,
            ParamKey::PoissonRatio => 0.45,
            ParamKey::Density => 1000.0,
            ParamKey::MassDamping => 0.1,
            ParamKey::StiffnessDamping => 0.01,
            ParamKey::Gravity(2) => -9.81,
            ParamKey::PlaneTheta(_) | ParamKey::PlanePhi(_) => std::f64::consts::FRAC_PI_2,
            // Touches after three of the twelve steps.
            ParamKey::PlaneHeight(_) => bottom - 0.004,
            _ => 0.0,
        })
        .collect();
    let every = (body.patches.len() / (2 * POINTS)).max(1);
    let points: Vec<ObservedPoint> =
        body.patches.iter().step_by(every).take(POINTS).map(|p| ObservedPoint { position: p.point, camera: 0 }).collect();
    let frames = (1..=STEPS).map(|k| Frame { time: 0.01 * k as f64, points: points.clone(), ..Frame::default() }).collect();
    let observation = Observation {
        cameras: vec![Camera { center: DVec3::new(0.0, -1.0, 0.2) }],
        frames,
        depth_noise: 1e-3,
        marker_noise: 1e-3,
        displacement_noise: 1e-3,
        ..Observation::default()
    };
    Ok(Plan {
        body: Arc::new(body),
        layout,
        theta,
        planes: vec![PlaneSite { polar_axis: 0, stiffness: None }],
        clamps: Vec::new(),
        masses: Vec::new(),
        clock: Clock { step: 0.01, steps: STEPS, theta: 0.6 },
        initial: InitialShape::Rest,
        pivot: DVec3::ZERO,
        observation: Arc::new(observation),
        band,
        solver: Solver { rotation, ..Solver::default() },
    })
}

fn time(name: &str, shape: &dyn Shape, h: f64, rotation: RotationUpdate, paper: Option<[f64; 3]>) -> Result<Row, String> {
    let plan = plan(shape, h, rotation)?;
    let b = CpuBackend;
    let mut w = b.build(&plan, 1).map_err(|e| e.to_string())?;
    b.set_params(&mut w, &ParamBatch::from_rows(&[plan.theta.clone()]));
    let mut tally = b.new_tally(&w, &[]);
    let mut now = b.new_state(&w);
    b.start(&mut w, &mut now, &mut tally);
    let (mut forward, mut cost, mut adjoint, mut tape) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for k in 0..STEPS {
        let mut next = b.new_state(&w);
        let clock = Instant::now();
        b.step(&mut w, k, &now, &mut next, &mut tally);
        forward.push(clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        b.observe(&w, k, &now, &next, &mut tally);
        cost.push(clock.elapsed().as_secs_f64());
        tape.push(std::mem::replace(&mut now, next));
    }
    let (mut adj, mut adj_now) = (b.new_adjoint(&w), b.new_adjoint(&w));
    let mut next = now;
    for (k, now) in tape.into_iter().enumerate().rev() {
        let clock = Instant::now();
        b.observe_adjoint(&w, k, &now, &next, &mut adj, &mut adj_now, &mut tally);
        b.step_adjoint(&mut w, k, &now, &next, &adj, &mut adj_now, &mut tally);
        adjoint.push(clock.elapsed().as_secs_f64());
        std::mem::swap(&mut adj, &mut adj_now);
        b.clear_adjoint(&mut adj_now);
        next = now;
    }
    adjoint.reverse();
    if let Some(f) = &b.read(&w, &tally)[0].failure {
        return Err(format!("{name}: {f}"));
    }
    let body = &plan.body;
    Ok(Row {
        name: name.into(),
        nodes: body.nodes.len(),
        cells: body.cells.len(),
        band_nodes: body.band.nodes.len(),
        forward: seconds(&forward[2..]),
        cost: seconds(&cost[2..]),
        adjoint: seconds(&adjoint[2..]),
        paper,
        state_bytes: 48 * body.nodes.len(),
        matrix_bytes: 72 * palpate_cpu::linear::pattern::Pattern::new(body).blocks.columns.len(),
    })
}

fn seconds(samples: &[f64]) -> Seconds {
    let mut s = samples.to_vec();
    s.sort_by(f64::total_cmp);
    Seconds { median: s[s.len() / 2], min: s[0], max: s[s.len() - 1] }
}

/// The table that a person reads.
pub fn table(report: &Report) -> String {
    let mut out = format!(
        "{} backend, {} threads; milliseconds a step: median (min–max); ×: how many times faster than the paper's RTX 2070\n",
        report.backend, report.threads
    );
    out += &format!(
        "{:28} {:>7} {:>7} {:>24} {:>24} {:>24} {:>9} {:>9}\n",
        "body", "nodes", "cells", "forward", "cost", "adjoint", "state MB", "matrix MB"
    );
    for r in &report.rows {
        let cell = |s: &Seconds, i: usize| {
            let times = r.paper.map_or(String::new(), |p| format!(" {:.1}×", p[i] / s.median));
            format!("{:.1} ({:.0}–{:.0}){times}", 1e3 * s.median, 1e3 * s.min, 1e3 * s.max)
        };
        out += &format!(
            "{:28} {:>7} {:>7} {:>24} {:>24} {:>24} {:>9.2} {:>9.1}\n",
            r.name,
            r.nodes,
            r.cells,
            cell(&r.forward, 0),
            cell(&r.cost, 1),
            cell(&r.adjoint, 2),
            r.state_bytes as f64 / 1e6,
            r.matrix_bytes as f64 / 1e6,
        );
    }
    out
}

/// Ratios of the medians of two reports (second over first) for the rows that both have.
pub fn compare(a: &Report, b: &Report) -> String {
    let mut out = format!("{:28} {:>7} {:>9} {:>9} {:>9}   (second over first)\n", "body", "nodes", "forward", "cost", "adjoint");
    for x in &a.rows {
        for y in b.rows.iter().filter(|y| y.name == x.name && y.nodes == x.nodes) {
            out += &format!(
                "{:28} {:>7} {:>9.2} {:>9.2} {:>9.2}\n",
                x.name,
                x.nodes,
                y.forward.median / x.forward.median,
                y.cost.median / x.cost.median,
                y.adjoint.median / x.adjoint.median
            );
        }
    }
    out
}
