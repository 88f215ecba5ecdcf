//! What the suite says: a line for every answer, a table by group and method, `bench/suite.json` and the table of `docs/suite.md`.

use super::case::GROUPS;
use super::score::Row;
use crate::{rows, table};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Strength below which nothing is to be seen [σ]: some effects cannot be made stronger in a scene within what they allow.
const FAINT: f64 = 2.0;
/// Error of a size that is good enough.
const GOOD: f64 = 0.15;

/// Relative error of a modulus beyond which its size says nothing.
const ASTRAY: f64 = 10.0;

/// One answer on one line.
pub fn line(r: &Row) -> String {
    let percent = |x: Option<f64>| x.map_or("–".to_string(), |v| format!("{:.0} %", 100.0 * v));
    let more = if r.as_good.is_empty() { String::new() } else { format!(" (as good: {})", r.as_good.join(", ")) };
    let apart = r.distance.map_or(String::new(), |[a, b, n]| format!(", {:.3} → {:.3} mm ({:.3})", 1e3 * a, 1e3 * b, 1e3 * n));
    let nats = r.missing.map_or(String::new(), |[a, b]| format!(", {a:.1} → {b:.1} nats missing"));
    let why = if r.verdict == "failed" { format!(" {}", r.sentence) } else { String::new() };
    format!(
        "{}: {:.1} σ: {} {}{more}{apart}{nats}, rank {}, size off {}, F1 {}, E off {} → {}, {:.1} s, score {}{why}",
        r.method,
        r.strength,
        r.verdict,
        r.named.join(" + "),
        r.rank.map_or("–".into(), |k| k.to_string()),
        percent(r.size_error),
        r.f1.map_or("–".into(), |f| format!("{f:.2}")),
        percent(r.modulus_error[0]),
        percent(r.modulus_error[1]),
        r.seconds,
        r.score,
    )
}

/// The group that a row counts for.
pub(super) fn group_of(r: &Row) -> &str {
    let shows = r.hidden.is_empty() || r.strength >= FAINT;
    if shows { &r.group } else { "faint" }
}

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Group.
    pub group: String,
    /// Method.
    pub method: String,
    /// Commits that were measured, in their order, with the cases that each one answered last.
    pub commits: Vec<(String, usize)>,
    /// Cases.
    pub cases: usize,
    /// Named first (nulls: called adequate; outside: unexplained).
    pub right: usize,
    /// Said to be as good as what is named first.
    pub as_good: usize,
    /// Right name among the first three of the ranking.
    pub among_three: usize,
    /// Verdicts that see something missing.
    pub alarms: usize,
    /// Median F1 over regions × time.
    pub f1: Option<f64>,
    /// Median relative error of the hidden numbers, and the share of those that are stated within 15 %.
    pub size: Option<[f64; 2]>,
    /// Median relative error of Young's modulus before and after.
    pub modulus: [Option<f64>; 2],
    /// Median and longest time [s].
    pub seconds: [f64; 2],
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut v: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    v.sort_by(f64::total_cmp);
    (!v.is_empty()).then(|| 0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2]))
}

/// The last row of every case and method.
pub(super) fn latest(all: &[Row]) -> Vec<&Row> {
    rows::newest(all.iter(), |r| (&r.case, &r.method))
}

/// The table: groups in their order, in each the methods in the order in which they were measured first.
pub fn lines(all: &[Row]) -> Vec<Line> {
    let mut methods: Vec<&str> = Vec::new();
    for r in all {
        if !methods.contains(&r.method.as_str()) {
            methods.push(&r.method);
        }
    }
    let all = latest(all);
    let of = |group: &str, method: &str| all.iter().copied().filter(|r| group_of(r) == group && r.method == method).collect();
    let mut out = Vec::new();
    for group in GROUPS.into_iter().chain(["faint"]) {
        for method in &methods {
            let rows: Vec<&Row> = of(group, method);
            if !rows.is_empty() {
                out.push(line_of(group, method, &rows));
            }
        }
    }
    out
}

fn line_of(group: &str, method: &str, of: &[&Row]) -> Line {
    let count = |f: &dyn Fn(&Row) -> bool| of.iter().filter(|r| f(r)).count();
    let sizes: Vec<f64> = of.iter().filter_map(|r| r.size_error).collect();
    let good = sizes.iter().filter(|s| **s <= GOOD).count() as f64 / sizes.len().max(1) as f64;
    let mut commits: Vec<(String, usize)> = Vec::new();
    for commit in of.iter().map(|r| &r.made.commit).filter(|c| !c.is_empty()) {
        match commits.iter_mut().find(|(c, _)| c == commit) {
            Some((_, n)) => *n += 1,
            None => commits.push((commit.clone(), 1)),
        }
    }
    Line {
        group: group.into(),
        method: method.into(),
        commits,
        cases: of.len(),
        right: count(&|r| r.score == 1.0),
        as_good: count(&|r| r.score == 0.5),
        among_three: count(&|r| r.rank.is_some_and(|k| k <= 3)),
        alarms: count(&|r| r.verdict != "adequate"),
        f1: median(of.iter().filter_map(|r| r.f1)),
        size: median(sizes.iter().copied()).map(|m| [m, good]),
        modulus: [0, 1].map(|k| median(of.iter().filter_map(|r| r.modulus_error[k]))),
        seconds: [median(of.iter().map(|r| r.seconds)).unwrap_or(0.0), of.iter().map(|r| r.seconds).fold(0.0, f64::max)],
    }
}

const HEAD: [&str; 11] = [
    "group",
    "method",
    "measured",
    "cases",
    "right",
    "as good",
    "among three",
    "see something missing",
    "F1",
    "size off (within 15 %)",
    "E off, before → after",
];

fn cells(l: &Line) -> Vec<String> {
    let percent = |x: Option<f64>| match x {
        None => "–".to_string(),
        Some(v) if v > ASTRAY => "astray".into(),
        Some(v) => format!("{:.1} %", 100.0 * v),
    };
    vec![
        l.group.clone(),
        l.method.clone(),
        rows::commits(l.commits.iter().map(|c| c.0.as_str())),
        l.cases.to_string(),
        format!("{} ({:.0} %)", l.right, 100.0 * l.right as f64 / l.cases as f64),
        l.as_good.to_string(),
        l.among_three.to_string(),
        l.alarms.to_string(),
        l.f1.map_or("–".into(), |f| format!("{f:.2}")),
        l.size.map_or("–".into(), |[m, good]| format!("{:.0} % ({:.0} %)", 100.0 * m, 100.0 * good)),
        format!("{} → {}", percent(l.modulus[0]), percent(l.modulus[1])),
    ]
}

/// Prints the table of some rows.
pub fn print(all: &[Row]) {
    let lines = lines(all);
    let head = HEAD.iter().chain(&["time / s (longest)"]).map(|h| h.to_string()).collect();
    let row = |l: &Line| {
        let mut row = cells(l);
        row.push(format!("{:.1} ({:.0})", l.seconds[0], l.seconds[1]));
        row
    };
    let rows: Vec<Vec<String>> = std::iter::once(head).chain(lines.iter().map(row)).collect();
    table::print("The suite (medians but for counts)", &rows);
}

/// The table as `docs/suite.md` holds it.
pub fn markdown(lines: &[Line]) -> String {
    let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let head = row(HEAD.map(String::from).to_vec());
    let rule = row(HEAD.map(|_| "---".into()).to_vec());
    lines.iter().fold(head + &rule, |all, l| all + &row(cells(l)))
}

/// Prints the table, stores it, and writes it into its page.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(all: &[Row]) -> Result<(), String> {
    print(all);
    let lines = lines(all);
    println!();
    table::publish("docs/suite.md", "suite", &lines, &markdown(&lines))
}

/// What `bench/suite.json` holds.
///
/// # Errors
/// The file is there and is no table.
pub fn stored(root: &Path) -> Result<Vec<Line>, String> {
    table::stored(root, "suite")
}
