//! Results of a benchmark, shown and compared.

use crate::table;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Median and extremes of repeated timings [s].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Times {
    /// Median.
    pub median: f64,
    /// Shortest.
    pub min: f64,
    /// Longest.
    pub max: f64,
}

impl Times {
    /// Of some timings; zeros if there are none.
    pub fn of(mut seconds: Vec<f64>) -> Times {
        seconds.sort_by(f64::total_cmp);
        let at = |i: usize| seconds.get(i).copied().unwrap_or(0.0);
        Times { median: at(seconds.len() / 2), min: at(0), max: at(seconds.len().saturating_sub(1)) }
    }
}

/// One body.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line {
    /// Body and kind of rotation.
    pub name: String,
    /// Simulation nodes.
    pub nodes: usize,
    /// Cells.
    pub cells: usize,
    /// Nodes of the band around the body.
    pub band_nodes: usize,
    /// Cutting the body out of the lattice [s].
    pub build: f64,
    /// One step forward.
    pub forward: Times,
    /// Comparing one frame.
    pub cost: Times,
    /// Adjoint of comparison and step together.
    pub adjoint: Times,
    /// Newton iterations of a step, on average; 0 where they were not counted.
    #[serde(default)]
    pub newton: f64,
    /// Iterations of conjugate gradients for all of them together; 0 where the matrix was factorised.
    #[serde(default)]
    pub linear: f64,
    /// Seconds of a step in the paper (forward, cost, adjoint), for the same body.
    pub paper: Option<[f64; 3]>,
    /// u and v of one step on the tape [bytes].
    pub tape: usize,
    /// Blocks of the stiffness matrix, all of them (3 × 3 numbers each) [bytes].
    pub matrix: usize,
    /// Most memory that was allocated at once, from cutting the body to the adjoint of all steps [bytes].
    #[serde(default)]
    pub peak: usize,
    /// Why it stopped, if it did.
    pub failure: Option<String>,
    /// What only a graphics device has; its times are per member of a batch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gpu: Option<super::gpu::Device>,
}

/// A run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// Day.
    pub date: String,
    /// Threads.
    pub threads: usize,
    /// Graphics adapter, if one took part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adapter: Option<String>,
    /// Its measured bandwidth of copies [bytes/s].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copy: Option<f64>,
    /// Bodies.
    pub lines: Vec<Line>,
}

fn milliseconds(t: &Times) -> String {
    format!("{:.1} [{:.1}, {:.1}]", 1e3 * t.median, 1e3 * t.min, 1e3 * t.max)
}

impl Report {
    /// Prints the table.
    pub fn print(&self) {
        let head = [
            "body",
            "nodes",
            "cells",
            "build s",
            "forward ms",
            "cost ms",
            "adjoint ms",
            "newton",
            "cg",
            "tape/step",
            "matrix",
            "peak",
        ];
        let mut rows = vec![head.map(String::from).to_vec()];
        let mb = |b: usize| format!("{:.2} MB", b as f64 / 1e6);
        rows.extend(self.lines.iter().map(|l| {
            vec![
                l.name.clone(),
                l.nodes.to_string(),
                l.cells.to_string(),
                format!("{:.2}", l.build),
                milliseconds(&l.forward),
                milliseconds(&l.cost),
                milliseconds(&l.adjoint),
                format!("{:.1}", l.newton),
                format!("{:.0}", l.linear),
                mb(l.tape),
                mb(l.matrix),
                mb(l.peak),
            ]
        }));
        table::print(&format!("{}, {} threads: median [shortest, longest] of one step", self.date, self.threads), &rows);
        for l in &self.lines {
            if let Some(p) = l.paper {
                let ratio = |a: f64, t: &Times| format!("{:.1}", a / t.median);
                println!(
                    "  {}: times faster than the paper's (RTX 2070; {:.3} / {:.3} / {:.3} s): forward {}, cost {}, adjoint {}",
                    l.name,
                    p[0],
                    p[1],
                    p[2],
                    ratio(p[0], &l.forward),
                    ratio(p[1], &l.cost),
                    ratio(p[2], &l.adjoint)
                );
            }
            if let Some(g) = &l.gpu {
                g.print(&l.name, self.copy);
            }
            if let Some(f) = &l.failure {
                println!("  {}: {f}", l.name);
            }
        }
    }
}

/// Prints the ratio of two earlier runs, body by body.
///
/// # Errors
/// A file that cannot be read or is no result of a benchmark.
pub fn compare(before: &Path, after: &Path) -> Result<(), String> {
    let read = |p: &Path| -> Result<Report, String> {
        let text = std::fs::read_to_string(p).map_err(|e| format!("{}: {e}", p.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: no result of a benchmark: {e}", p.display()))
    };
    let (a, b) = (read(before)?, read(after)?);
    let mut rows = vec![["body", "forward", "cost", "adjoint", "memory"].map(String::from).to_vec()];
    for l in &b.lines {
        let Some(old) = a.lines.iter().find(|o| o.name == l.name) else { continue };
        let ratio = |new: f64, old: f64| if old > 0.0 { format!("{:.2}", new / old) } else { "-".into() };
        let time = |new: &Times, old: &Times| ratio(new.median, old.median);
        rows.push(vec![
            l.name.clone(),
            time(&l.forward, &old.forward),
            time(&l.cost, &old.cost),
            time(&l.adjoint, &old.adjoint),
            ratio(l.peak as f64, old.peak as f64),
        ]);
    }
    let title = format!("{} ({} threads) over {} ({} threads); below 1 is faster", b.date, b.threads, a.date, a.threads);
    table::print(&title, &rows);
    Ok(())
}
