//! How many truths lie inside intervals: `bench/coverage.json` and the table of `docs/coverage.md`.

use super::bodies;
use crate::real::report::Made;
use crate::{rows, table};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Intervals: their probability, and how many standard errors of a normal law they reach.
const INTERVALS: [(f64, f64); 3] = [(0.5, 0.674_490), (0.8, 1.281_552), (0.95, 1.959_964)];

/// One fitted number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// When, and by what.
    #[serde(flatten)]
    pub made: Made,
    /// Name of the trial.
    pub case: String,
    /// Kind of the body.
    pub body: String,
    /// Seed of the trial.
    pub seed: u64,
    /// What was free.
    pub set: String,
    /// What watched.
    pub sensors: String,
    /// Noise [m].
    pub noise: f64,
    /// Path of the number.
    pub parameter: String,
    /// Its truth.
    pub truth: f64,
    /// What the fit found.
    pub value: Option<f64>,
    /// The value on the scene's own cells, where that found is corrected to the limit of fine ones.
    #[serde(default)]
    pub uncorrected: Option<f64>,
    /// Its standard error, all parts together.
    pub standard_error: Option<f64>,
    /// Of noise, of discretisation and of what the recording calls systematic, where the fit tells them apart.
    pub parts: Option<[f64; 3]>,
    /// How the fit ended: only what converged counts.
    pub verdict: String,
    /// Time of the fit [s].
    pub seconds: f64,
}

impl Row {
    /// Standard errors between value and truth, where the fit converged.
    pub fn off(&self) -> Option<f64> {
        let (value, error) = (self.value?, self.standard_error?);
        (self.verdict == "converged" && error > 0.0).then(|| (value - self.truth) / error)
    }
}

/// One row on one line.
pub fn line(r: &Row) -> String {
    let value = r.value.map_or("no value".into(), |v| format!("{v:.5} ± {:.5}", r.standard_error.unwrap_or(f64::NAN)));
    let off = r.off().map_or(String::new(), |z| format!(", {z:+.2} σ"));
    format!(
        "{} ({}, {}): {} {value}, truth {:.5}{off}, {}, {:.1} s",
        r.case, r.set, r.sensors, r.parameter, r.truth, r.verdict, r.seconds
    )
}

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// What is counted: a number, a body, sensors, or everything.
    pub of: String,
    /// Commit that was measured, or the first and the last of several.
    pub commit: String,
    /// Numbers that were found by fits that converged.
    pub numbers: usize,
    /// Distinct truths among them.
    pub truths: usize,
    /// Numbers of fits that failed, did not converge or ended at a bound.
    pub others: usize,
    /// Share of truths inside each interval.
    pub inside: [f64; 3],
    /// Root mean square of (value − truth) / standard error; 1 where errors are right.
    pub spread: f64,
    /// Median of |value − truth| / |truth| where the truth is not 0.
    pub error: Option<f64>,
    /// Median share of the variance that stands for cells and step.
    #[serde(default)]
    pub discretisation: Option<f64>,
    /// Median time of a fit [s].
    pub seconds: f64,
}

fn median(mut v: Vec<f64>) -> Option<f64> {
    v.sort_by(f64::total_cmp);
    (!v.is_empty()).then(|| 0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2]))
}

/// A line of rows, the newest first.
fn count(of: &str, all: &[&Row]) -> Line {
    let z: Vec<f64> = all.iter().filter_map(|r| r.off()).collect();
    let n = z.len().max(1) as f64;
    let inside = INTERVALS.map(|(_, reach)| z.iter().filter(|z| z.abs() <= reach).count() as f64 / n);
    let mut truths: Vec<String> =
        all.iter().filter(|r| r.off().is_some()).map(|r| format!("{} {}", r.seed / 100, r.parameter)).collect();
    truths.sort_unstable();
    truths.dedup();
    let relative = |r: &&&Row| Some((r.value? / r.truth - 1.0).abs()).filter(|_| r.off().is_some() && r.truth != 0.0);
    Line {
        of: of.into(),
        commit: rows::commits(all.iter().rev().map(|r| r.made.commit.as_str())),
        numbers: z.len(),
        truths: truths.len(),
        others: all.len() - z.len(),
        inside,
        spread: (z.iter().map(|z| z * z).sum::<f64>() / n).sqrt(),
        error: median(all.iter().filter_map(|r| relative(&r)).collect()),
        discretisation: median(all.iter().filter_map(|r| Some(r.parts?[1].powi(2) / r.standard_error?.powi(2))).collect()),
        seconds: median(all.iter().map(|r| r.seconds).collect()).unwrap_or(0.0),
    }
}

/// The table of the last row of every trial and number: scenes with the recording's material, all and by number, by body and by sensors; then those
/// with another material, all and by body.
pub fn lines(all: &[Row]) -> Vec<Line> {
    let mut of: Vec<&Row> = Vec::new();
    for r in all.iter().rev() {
        if !of.iter().any(|o| (&o.case, &o.parameter) == (&r.case, &r.parameter)) {
            of.push(r);
        }
    }
    let (own, other): (Vec<&Row>, Vec<&Row>) = of.into_iter().partition(|r| bodies::states_its_material(r.seed / 100));
    let by: [fn(&Row) -> &str; 3] = [|r| &r.parameter, |r| &r.body, |r| &r.sensors];
    let mut out = Vec::new();
    for (title, prefix, all, by) in [("all", "", &own, &by[..]), ("another material", "another material: ", &other, &by[1..2])] {
        out.extend((!all.is_empty()).then(|| count(title, all)));
        for key in by {
            let mut parts: Vec<&str> = all.iter().map(|r| key(r)).collect();
            parts.sort_unstable();
            parts.dedup();
            for part in parts {
                let rows: Vec<&Row> = all.iter().copied().filter(|r| key(r) == part).collect();
                out.push(count(&format!("{prefix}{part}"), &rows));
            }
        }
    }
    out
}

const HEAD: [&str; 10] = [
    "of",
    "numbers (distinct truths)",
    "not converged",
    "inside 50 %",
    "inside 80 %",
    "inside 95 %",
    "rms / ±",
    "median error",
    "of ±² cells and step",
    "commit",
];

fn cells(l: &Line) -> Vec<String> {
    let n = l.numbers.max(1) as f64;
    // Binomial standard error, at the probability that the interval states.
    let share = |k: usize| {
        let p = INTERVALS[k].0;
        format!("{:.1} ± {:.1} %", 100.0 * l.inside[k], 100.0 * (p * (1.0 - p) / n).sqrt())
    };
    vec![
        l.of.clone(),
        format!("{} ({})", l.numbers, l.truths),
        l.others.to_string(),
        share(0),
        share(1),
        share(2),
        format!("{:.2}", l.spread),
        l.error.map_or("–".into(), |e| format!("{:.2} %", 100.0 * e)),
        l.discretisation.map_or("–".into(), |d| format!("{:.0} %", 100.0 * d)),
        l.commit.clone(),
    ]
}

/// The table as `docs/coverage.md` holds it.
pub fn markdown(lines: &[Line]) -> String {
    let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let head = row(HEAD.map(String::from).to_vec()) + &row(HEAD.map(|_| "---".into()).to_vec());
    lines.iter().fold(head, |all, l| all + &row(cells(l)))
}

/// Prints the table, stores it, and writes it into its page.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(from: &Path) -> Result<(), String> {
    let all: Vec<Row> = rows::load(from)?;
    let lines = lines(&all);
    let head = HEAD.map(String::from).to_vec();
    let cells: Vec<Vec<String>> = std::iter::once(head).chain(lines.iter().map(cells)).collect();
    table::print("Truths inside stated intervals", &cells);
    println!();
    table::publish("docs/coverage.md", "coverage", &lines, &markdown(&lines))
}

/// What `bench/coverage.json` holds.
///
/// # Errors
/// The file is there and is no table.
pub fn stored(root: &Path) -> Result<Vec<Line>, String> {
    table::stored(root, "coverage")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truths_inside_intervals_are_counted_and_failures_apart() {
        let row = |k: u64, value: f64, verdict: &str| Row {
            made: Made::default(),
            case: format!("case {k}"),
            body: "ball".into(),
            seed: 100 * (2 * k + 1),
            set: "E".into(),
            sensors: "markers".into(),
            noise: 1e-3,
            parameter: "material.youngs_modulus".into(),
            truth: 10.0,
            value: Some(value),
            uncorrected: None,
            standard_error: Some(1.0),
            parts: None,
            verdict: verdict.into(),
            seconds: 1.0,
        };
        let all = [
            row(1, 10.5, "converged"),
            row(2, 9.0, "converged"),
            row(3, 11.9, "converged"),
            row(4, 12.5, "converged"),
            row(5, 99.0, "failed: no start"),
        ];
        let l = &lines(&all)[0];
        assert_eq!((l.numbers, l.truths, l.others, l.inside), (4, 4, 1, [0.25, 0.5, 0.75]));
        // A trial that was measured again counts once, as it was last.
        let again: Vec<Row> = all.iter().cloned().chain([row(4, 10.0, "converged")]).collect();
        assert_eq!(lines(&again)[0].inside, [0.5, 0.75, 1.0]);
        // Bodies whose scenes state another material stand apart.
        let other = Row { seed: 1400, ..row(9, 99.0, "converged") };
        let apart = lines(&again.into_iter().chain([other]).collect::<Vec<_>>());
        let named = |l: &Line| (l.of.clone(), l.numbers, l.inside[2]);
        assert_eq!((named(&apart[0]), apart[0].others), (("all".into(), 4, 1.0), 1));
        let last: Vec<_> = apart[apart.len() - 2..].iter().map(named).collect();
        assert_eq!(last, [("another material".into(), 1, 0.0), ("another material: ball".into(), 1, 0.0)]);
    }
}
