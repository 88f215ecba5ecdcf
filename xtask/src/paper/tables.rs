//! The tables: the paper's figures beside ours.

use super::finer::{self, Asked, FAINT, Finer};
use super::gradient::{self, Gradient};
use super::scenes;
use super::several::{self, Several};
use super::study::{self, Recovery, Search, Unknown, Watch};
use crate::table;
use glam::DVec3;
use palpate::Error;
use palpate::render::Pinhole;
use palpate_model::params::ParamKey;
use palpate_model::scene::{Optimizer, Scene, Solver};
use serde::Serialize;
use std::time::Instant;

/// One line of a study.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// Which table.
    pub table: &'static str,
    /// What is varied, and its value.
    pub case: String,
    /// What the paper says, or nothing.
    pub paper: String,
    /// Simulation nodes.
    pub nodes: usize,
    /// Starts within 5 % of the truth.
    pub converged: usize,
    /// Starts.
    pub starts: usize,
    /// Mean relative error of those [%].
    pub mean_error_percent: f64,
    /// Signed relative error of the best start [%].
    pub best_error_percent: f64,
    /// Spread of the converged ends [%].
    pub spread_percent: f64,
    /// Median evaluations of a start.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Where tables are gathered and shown.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    /// Day of the run.
    pub date: String,
    /// The one table that was asked for; `None` = all.
    pub only: Option<String>,
    /// All recoveries.
    pub lines: Vec<Line>,
    /// The torus from finer recordings.
    pub finer: Vec<Finer>,
    /// The ball with several unknowns.
    pub several: Vec<Several>,
    /// Gradient checks.
    pub gradients: Vec<Gradient>,
    /// [`gradient::PAPER`], beside gradient checks.
    pub gradients_paper_percent: Option<[f64; 3]>,
}

fn torus_cameras(count: usize, pixels: usize) -> Vec<Pinhole> {
    scenes::cameras(DVec3::new(0.0, 0.0, 0.1), 1.0, 26.0, count, pixels)
}

fn ball_cameras() -> Vec<Pinhole> {
    scenes::cameras(DVec3::new(0.0, 0.0, 0.07), 0.6, 30.0, 1, 50)
}

/// One experiment with E unknown.
struct Case<'a> {
    table: &'static str,
    name: String,
    paper: &'a str,
    scene: Scene,
    watch: Watch,
    band: f64,
    search: Search,
}

fn run(report: &mut Report, case: Case) -> Result<(), Error> {
    if !report.wants(case.table) {
        return Ok(());
    }
    let clock = Instant::now();
    let plan = study::plan(&case.scene, &study::record(&case.scene, &case.watch)?, case.band)?;
    let unknown = Unknown::within(&plan, ParamKey::YoungsModulus, 10.0);
    let result = study::search(&plan, &[unknown], &case.search)?;
    let r = Recovery::of(&result, 0, case.scene.material.youngs_modulus);
    let line = Line {
        table: case.table,
        case: case.name,
        paper: case.paper.into(),
        nodes: plan.body.nodes.len(),
        converged: r.converged,
        starts: r.starts,
        mean_error_percent: 100.0 * r.mean_error,
        best_error_percent: 100.0 * r.best_error,
        spread_percent: 100.0 * r.spread,
        evaluations: r.evaluations,
        seconds: clock.elapsed().as_secs_f64(),
    };
    println!(
        "{}, {}: {}/{} converged, mean error {:.2} %, {} evaluations, {:.0} s",
        line.table, line.case, line.converged, line.starts, line.mean_error_percent, line.evaluations, line.seconds
    );
    report.lines.push(line);
    Ok(())
}

/// Runs everything, or the table `only` (torus, finer, ball, gravity, cameras, image, band, optimiser, gradient); `quick` takes coarser cells and
/// fewer starts and cases.
///
/// # Errors
/// A scene cannot be simulated, or no start of a fit can be evaluated.
pub fn all(quick: bool, only: Option<String>) -> Result<Report, Error> {
    const TABLES: [&str; 9] = ["torus", "finer", "ball", "gravity", "cameras", "image", "band", "optimiser", "gradient"];
    if let Some(t) = only.as_ref().filter(|t| !TABLES.contains(&t.as_str())) {
        return Err(Error::Input(format!("--only {t}: no such table; allowed are {}", TABLES.join(", "))));
    }
    let mut report = Report { date: table::today(), only, ..Report::default() };
    let cell = if quick { 0.028 } else { 0.02 };
    let starts = if quick { 3 } else { 20 };
    let few = if quick { 2 } else { 4 };
    let gauss_newton = |starts| Search { optimizer: Optimizer::GaussNewton, iterations: 30, starts, seed: 5 };
    let torus = |table, name: String, paper, cameras, band, search| Case {
        table,
        name,
        paper,
        scene: scenes::torus(cell),
        watch: Watch { cameras, noise: 0.1 * cell, every: 1, refine: 1.0, seed: 3 },
        band,
        search,
    };
    let paper_torus = "about 19/20, 2.39 %";
    run(&mut report, torus("torus", "same grid".into(), paper_torus, torus_cameras(1, 50), 5.0, gauss_newton(starts)))?;
    if report.wants("finer") {
        let grid = Asked { ghost: Solver::default().ghost, noise: FAINT, recordings: if quick { 2 } else { 3 }, starts: 1 };
        let all = [0.03, 0.024, 0.02, 0.016];
        report.finer = finer::finer(if quick { &all[..1] } else { &all }, grid)?;
        if !quick {
            // A tenth of the penalty: how much of the error it makes.
            report.finer.extend(finer::finer(&[0.03, 0.02], Asked { ghost: 0.1 * grid.ghost, ..grid })?);
            // The other tables' noise and starts.
            report.finer.extend(finer::finer(&all, Asked { noise: 0.1, recordings: 2, starts, ..grid })?);
        }
    }
    for seed in 1..=(if quick { 2 } else { 6 }) {
        let case = Case {
            table: "ball",
            name: format!("tilted plane {seed}"),
            paper: "18 to 20 of 20",
            scene: scenes::ball(if quick { 0.0167 } else { 0.0125 }, seed),
            watch: Watch { cameras: ball_cameras(), noise: 0.07 * 0.0125, every: 1, refine: 1.0, seed: 4 },
            band: 4.0,
            search: gauss_newton(starts),
        };
        run(&mut report, case)?;
    }
    if report.wants("gravity") {
        // Every step of the bounce; two frames of it.
        let cell = if quick { 0.0167 } else { 0.0125 };
        report.several = [1, 10].into_iter().map(|every| several::several(cell, every, starts)).collect::<Result<_, Error>>()?;
    }
    // Figures 21 to 23; the paper's text swaps some labels between figures, the order here is that of the figures.
    for (count, paper) in [(1, "2.39 %"), (2, "8.94 %"), (4, "5.08 %"), (8, "4.46 %")] {
        run(&mut report, torus("cameras", count.to_string(), paper, torus_cameras(count, 50), 5.0, gauss_newton(few)))?;
    }
    for (pixels, paper) in [(20, "18/20, 2.71 %"), (50, "4.62 %"), (100, "20/20, 3.05 %"), (200, "2.56 %")] {
        let name = format!("{pixels}²");
        run(&mut report, torus("image", name, paper, torus_cameras(1, pixels), 5.0, gauss_newton(few)))?;
    }
    for (band, paper) in [(1.0, "10/14"), (2.0, "-"), (5.0, "13/14")] {
        let name = format!("{band} cells");
        // As many starts as the paper's.
        let starts = if quick { few } else { 14 };
        run(&mut report, torus("band", name, paper, torus_cameras(1, 50), band, gauss_newton(starts)))?;
    }
    use Optimizer::{GaussNewton, GradientDescent, Lbfgs, NelderMead, Rprop};
    for (optimizer, paper) in
        [(GaussNewton, "-"), (Lbfgs, "-"), (GradientDescent, "-"), (Rprop, "100 iterations"), (NelderMead, "-")]
    {
        let search = Search { optimizer, iterations: 100, starts: few.min(3), seed: 5 };
        run(&mut report, torus("optimiser", format!("{optimizer:?}"), paper, torus_cameras(1, 50), 5.0, search))?;
    }
    if !report.wants("gradient") {
        return Ok(report);
    }
    let watch = Watch { cameras: torus_cameras(1, 50), noise: 0.1 * cell, every: 1, refine: 1.0, seed: 3 };
    let truth = scenes::torus(cell);
    let plan = study::plan(&truth, &study::record(&truth, &watch)?, 5.0)?;
    report.gradients_paper_percent = Some(gradient::PAPER);
    report.gradients = gradient::gradients(&plan, if quick { &[0.4, 2.5] } else { &[0.2, 0.4, 0.7, 0.9, 1.2, 2.5, 5.0] })?;
    Ok(report)
}

impl Report {
    fn wants(&self, table: &str) -> bool {
        self.only.as_ref().is_none_or(|only| only == table)
    }

    /// Prints all tables.
    pub fn print(&self) {
        let mut tables: Vec<&str> = self.lines.iter().map(|l| l.table).collect();
        tables.dedup();
        for name in tables {
            let head = ["case", "nodes", "paper", "converged", "mean error", "best", "spread", "evaluations", "time"];
            let mut rows = vec![head.map(String::from).to_vec()];
            rows.extend(self.lines.iter().filter(|l| l.table == name).map(|l| {
                vec![
                    l.case.clone(),
                    l.nodes.to_string(),
                    l.paper.clone(),
                    format!("{}/{}", l.converged, l.starts),
                    format!("{:.2} %", l.mean_error_percent),
                    format!("{:+.2} %", l.best_error_percent),
                    format!("{:.3} %", l.spread_percent),
                    l.evaluations.to_string(),
                    format!("{:.0} s", l.seconds),
                ]
            }));
            table::print(name, &rows);
        }
        if !self.finer.is_empty() {
            finer::print(&self.finer);
        }
        if !self.several.is_empty() {
            several::print(&self.several);
        }
        if !self.gradients.is_empty() {
            gradient::print(&self.gradients);
        }
    }
}
