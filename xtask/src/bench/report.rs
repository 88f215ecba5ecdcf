//! Results of a benchmark, shown and compared.

use crate::table;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Median and extremes of repeated timings [s].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Body.
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
    /// Steps that were timed, from the first on; 0 in files of earlier versions.
    #[serde(default)]
    pub steps: usize,
    /// The first step in which the ground acts on the body, where one of them is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub landed: Option<usize>,
    /// Newton iterations of a step, on average; of a batch those of the member that takes the most.
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// A whole fit, if one was timed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<super::fit::Fit>,
    /// Gradients by fields, if they were timed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fields: Option<super::fields::Fields>,
    /// Bodies.
    pub lines: Vec<Line>,
    /// What was asked for and is not among them, with the reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
}

/// Iterations with so many digits after the point; those of devices were not always counted.
fn counted(l: &Line, iterations: f64, digits: usize) -> String {
    if l.gpu.is_some() && l.newton == 0.0 { "-".into() } else { format!("{iterations:.digits$}") }
}

/// Steps that were timed, and whether the ground acted in one of them.
fn steps(l: &Line) -> String {
    match l.landed {
        _ if l.steps == 0 => "-".into(),
        Some(k) => format!("{} (lands in {k})", l.steps),
        None => format!("{} (flight)", l.steps),
    }
}

fn milliseconds(t: &Times) -> String {
    format!("{:.1} [{:.1}, {:.1}]", 1e3 * t.median, 1e3 * t.min, 1e3 * t.max)
}

impl Report {
    /// Prints the table.
    pub fn print(&self) {
        if let Some(f) = &self.fit {
            f.print();
        }
        if !self.lines.is_empty() {
            self.print_lines();
        }
    }

    fn print_lines(&self) {
        let head = [
            "body",
            "nodes",
            "cells",
            "steps",
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
                steps(l),
                format!("{:.2}", l.build),
                milliseconds(&l.forward),
                milliseconds(&l.cost),
                milliseconds(&l.adjoint),
                counted(l, l.newton, 1),
                counted(l, l.linear, 0),
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
                g.print(&l.name);
            }
            if let Some(f) = &l.failure {
                println!("  {}: {f}", l.name);
            }
        }
        self.print_sizes();
        self.left_out.iter().for_each(|l| println!("  left out: {l}"));
    }

    /// How time, iterations and memory of balls and blocks grow with their nodes.
    fn print_sizes(&self) {
        let mut sizes: Vec<&Line> = self
            .lines
            .iter()
            .filter(|l| l.gpu.is_none() && (l.name.starts_with("ball ") || l.name.starts_with("block ")))
            .collect();
        if sizes.len() < 2 {
            return;
        }
        sizes.sort_by_key(|l| l.nodes);
        let head = ["body", "nodes", "step ms", "µs a node", "newton", "cg", "peak"];
        let mut rows = vec![head.map(String::from).to_vec()];
        rows.extend(sizes.iter().map(|l| {
            vec![
                l.name.clone(),
                l.nodes.to_string(),
                format!("{:.1}", 1e3 * l.forward.median),
                format!("{:.1}", 1e6 * l.forward.median / l.nodes as f64),
                format!("{:.1}", l.newton),
                format!("{:.0}", l.linear),
                format!("{:.0} MB", l.peak as f64 / 1e6),
            ]
        }));
        table::print(
            "sizes: a step forward, its iterations, and the most memory from cutting the body to the last adjoint",
            &rows,
        );
    }
}

/// Prints the ratio of two earlier runs, body by body.
///
/// # Errors
/// A file that cannot be read or is no result of a benchmark.
pub fn compare(before: &Path, after: &Path) -> Result<(), String> {
    let (a, b) = (read(before)?, read(after)?);
    let of = |r: &Report| format!("{} ({} threads, {})", r.date, r.threads, r.adapter.as_deref().unwrap_or("no adapter"));
    println!("before: {}\nafter: {}", of(&a), of(&b));
    table::print("after over before; below 1 is faster; shares of a copy's bandwidth before → after", &rows(&a, &b));
    for l in &b.lines {
        if let Some(why) = find(&a, &l.name).and_then(|old| unlike(old, l)) {
            println!("  no ratio of {}: {why}", l.name);
        }
    }
    for (report, other, which) in [(&a, &b, "before"), (&b, &a, "after")] {
        let alone: Vec<&str> = report.lines.iter().map(|l| l.name.as_str()).filter(|n| find(other, n).is_none()).collect();
        if !alone.is_empty() {
            println!("  only in {which}: {}", alone.join(", "));
        }
    }
    if let (Some(x), Some(y)) = (&a.fit, &b.fit) {
        println!("  fit: {:.1} s → {:.1} s ({} → {} nodes)", x.seconds, y.seconds, x.nodes, y.nodes);
    }
    Ok(())
}

fn read(path: &Path) -> Result<Report, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    serde_json::from_str(&text).map_err(|e| format!("{}: no result of a benchmark: {e}", path.display()))
}

fn find<'a>(report: &'a Report, name: &str) -> Option<&'a Line> {
    report.lines.iter().find(|l| l.name == name)
}

/// Why two lines are not of the same work.
fn unlike(old: &Line, new: &Line) -> Option<String> {
    if old.nodes != new.nodes {
        return Some(format!("{} and {} nodes", old.nodes, new.nodes));
    }
    (old.steps != new.steps).then(|| match [old.steps, new.steps] {
        [0, n] | [n, 0] => format!("one of the files does not say which steps were timed, the other {n}"),
        [a, b] => format!("{a} and {b} steps were timed"),
    })
}

/// The table of [`compare`].
fn rows(a: &Report, b: &Report) -> Vec<Vec<String>> {
    let head = ["body", "nodes", "forward", "cost", "adjoint", "memory", "product", "share of CG"];
    let mut rows = vec![head.map(String::from).to_vec()];
    for l in &b.lines {
        let Some(old) = find(a, &l.name) else { continue };
        // A ratio of different bodies says nothing.
        let same = unlike(old, l).is_none();
        let ratio = |new: f64, old: f64| if same && old > 0.0 { format!("{:.2}", new / old) } else { "-".into() };
        let time = |new: &Times, old: &Times| ratio(new.median, old.median);
        // What is the same in both is said once.
        let both = |of: fn(&Line) -> String| {
            let (old, new) = (of(old), of(l));
            if old == new { new } else { format!("{old} → {new}") }
        };
        rows.push(vec![
            l.name.clone(),
            both(|l| l.nodes.to_string()),
            time(&l.forward, &old.forward),
            time(&l.cost, &old.cost),
            time(&l.adjoint, &old.adjoint),
            ratio(l.peak as f64, old.peak as f64),
            both(|l| l.gpu.as_ref().map_or("-".into(), |g| g.product.clone())),
            both(|l| l.gpu.as_ref().and_then(|g| g.iteration).map_or("-".into(), |t| format!("{:.0} %", 100.0 * t.share))),
        ]);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::gpu::{Device, Traffic};
    use super::*;

    fn line(name: &str, seconds: f64, share: f64) -> Line {
        let traffic = Traffic { seconds: 1e-4, bytes: 1e6, share };
        let times = Times { median: seconds, min: seconds, max: seconds };
        let device = Device {
            batch: 8,
            over_cpu: [1.0; 3],
            columns: Some([2e-3, 1e-3]),
            cpu: Some([times; 3]),
            counts: Some(super::super::model::Counts { steps: 5, ..Default::default() }),
            modelled: Some(super::super::model::H100.step(&super::super::model::Counts::default())),
            product: "csr, many workgroups".into(),
            iteration: Some(traffic),
            products: vec![("csr".into(), traffic), ("free".into(), traffic)],
            passes: vec![("press_cells".into(), 3, 0.5)],
        };
        Line {
            name: name.into(),
            nodes: 770,
            cells: 516,
            band_nodes: 2605,
            build: 0.1,
            forward: times,
            cost: times,
            adjoint: times,
            paper: Some([0.077, 0.199, 0.058]),
            tape: 1,
            matrix: 1,
            steps: 5,
            landed: Some(4),
            newton: 3.0,
            linear: 0.0,
            peak: 4,
            failure: None,
            gpu: Some(device),
        }
    }

    fn report(lines: Vec<Line>) -> Report {
        Report {
            date: "2026-01-01".into(),
            threads: 2,
            adapter: Some("a device".into()),
            copy: Some(1e10),
            fit: None,
            fields: None,
            lines,
            left_out: Vec::new(),
        }
    }

    #[test]
    fn a_report_comes_back_from_its_file_and_is_compared() {
        let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
        let (before, after) =
            (report(vec![line("ball", 2e-3, 0.3), line("torus", 1.0, 0.1)]), report(vec![line("ball", 1e-3, 0.6)]));
        let file = |name: &str, r: &Report| {
            let path = folder.path().join(name);
            let text = serde_json::to_string(r).unwrap_or_else(|e| panic!("{e}"));
            std::fs::write(&path, text).unwrap_or_else(|e| panic!("{e}"));
            path
        };
        let paths = [file("before", &before), file("after", &after)];
        for (path, report) in paths.iter().zip([&before, &after]) {
            assert_eq!(read(path).as_ref(), Ok(report));
        }
        assert_eq!(compare(&paths[0], &paths[1]), Ok(()));
        let rows = rows(&before, &after);
        assert_eq!(rows.len(), 2, "the torus is in one file alone");
        let expected = ["ball", "770", "0.50", "0.50", "0.50", "1.00", "csr, many workgroups", "30 % → 60 %"];
        assert_eq!(rows[1], expected);
        assert!(find(&after, "torus").is_none());
        let coarse = report(vec![Line { nodes: 432, ..line("ball", 1e-3, 0.6) }]);
        let expected = ["ball", "770 → 432", "-", "-", "-", "-", "csr, many workgroups", "30 % → 60 %"];
        assert_eq!(super::rows(&before, &coarse)[1], expected, "no ratio of bodies of different sizes");
        let shorter = report(vec![Line { steps: 4, ..line("ball", 1e-3, 0.6) }]);
        assert_eq!(super::rows(&before, &shorter)[1][2], "-", "no ratio of other steps");
        let silent = Line { steps: 0, ..line("ball", 1.0, 0.0) };
        assert!(unlike(&before.lines[0], &silent).is_some_and(|why| why.contains("does not say")));
        assert_eq!([counted(&before.lines[0], 3.0, 1), counted(&Line { newton: 0.0, ..silent }, 0.0, 1)], ["3.0", "-"]);
        let none = file("none", &before);
        std::fs::write(&none, "{}").unwrap_or_else(|e| panic!("{e}"));
        assert!(compare(&none, &paths[1]).is_err_and(|e| e.contains("no result of a benchmark")));
    }

    #[test]
    fn results_of_earlier_versions_are_read() {
        let files = std::fs::read_dir(table::root().join("bench")).unwrap_or_else(|e| panic!("{e}"));
        let named = |p: &Path| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("bench-"));
        let all: Vec<_> = files.filter_map(|f| Some(f.ok()?.path())).filter(|p| named(p)).collect();
        assert!(!all.is_empty());
        all.iter().for_each(|p| assert!(read(p).is_ok_and(|r| r.fit.is_some() || !r.lines.is_empty()), "{}", p.display()));
    }
}
