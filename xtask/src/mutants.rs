//! `cargo xtask mutants`: effects and materials changed in one place at a time by cargo-mutants, and changes that no test notices.
//!
//! What is changed and which tests count stands in `.cargo/mutants.toml`. `bench/mutants.json` holds what `docs/mutants.md` shows: counts, and the
//! changes that stay alive, each with its reason.

use crate::table;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;

/// What was tried, and what came out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Day of the run.
    pub date: String,
    /// Commit that was changed.
    pub commit: String,
    /// Changes that no test noticed before tests were written for them.
    pub before: usize,
    /// Changes that cargo-mutants has built by itself; the others were compiled together.
    pub built: usize,
    /// Changes that were not tried, for want of time.
    pub left: usize,
    /// Counts by file.
    pub files: Vec<Count>,
    /// Changes that no test notices.
    pub alive: Vec<Alive>,
}

/// Changes of one file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Count {
    /// Below `crates/palpate-model/src`.
    pub file: String,
    /// Changes tried.
    pub tried: usize,
    /// Noticed by a test that fails.
    pub caught: usize,
    /// Noticed as a test takes too long.
    pub timeout: usize,
    /// No program: the compiler refuses them.
    pub unviable: usize,
    /// Noticed by no test.
    pub alive: usize,
}

/// A change that no test notices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alive {
    /// Below `crates/palpate-model/src`.
    pub file: String,
    /// As cargo-mutants words it, without its place.
    pub change: String,
    /// In how many places of the function.
    pub places: usize,
    /// Why nothing can be seen of it.
    pub why: String,
}

const ROOM: &str = "crates/palpate-model/src/";

/// Runs cargo-mutants, of which what earlier runs have caught is left out, and compares what stays alive with what is explained.
///
/// # Errors
/// cargo-mutants is not installed or does not come to its end, or a change is alive that nothing explains.
pub fn run(root: &Path, shard: Option<&str>) -> Result<(), String> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let version = Command::new(&cargo).args(["mutants", "--version"]).current_dir(root).output();
    if !version.is_ok_and(|o| o.status.success()) {
        return Err("cargo-mutants is not installed: cargo install --locked cargo-mutants".into());
    }
    let mut command = Command::new(cargo);
    command.args(["mutants", "--package", "palpate-model", "--iterate", "--output", "target"]).current_dir(root);
    if let Some(shard) = shard {
        command.args(["--shard", shard]);
    }
    let status = command.status().map_err(|e| format!("cargo mutants: {e}"))?;
    // 2 and 3 say that some are missed and that some took too long.
    if !matches!(status.code(), Some(0 | 2 | 3)) {
        return Err("cargo mutants did not come to its end: what it says stands above".into());
    }
    let missed = root.join("target/mutants.out/missed.txt");
    let missed = std::fs::read_to_string(&missed).map_err(|e| format!("{}: {e}", missed.display()))?;
    let new = unexplained(&missed, &stored(root)?.alive);
    if new.is_empty() {
        println!("no change is alive that docs/mutants.md does not explain");
        return Ok(());
    }
    Err(format!("alive, and not explained in bench/mutants.json:\n{}", new.join("\n")))
}

/// Lines of cargo-mutants, `FILE:LINE:COLUMN: CHANGE`, that are more than what is explained.
fn unexplained<'a>(missed: &'a str, alive: &[Alive]) -> Vec<&'a str> {
    let mut left: Vec<(&Alive, usize)> = alive.iter().map(|a| (a, a.places)).collect();
    let is_new = |line: &&str| {
        let parts: Vec<&str> = line.splitn(4, ':').collect();
        let [file, _, _, change] = parts[..] else { return true };
        let file = file.strip_prefix(ROOM).unwrap_or(file);
        let known = left.iter_mut().find(|(a, n)| *n > 0 && a.file == file && a.change == change.trim());
        known.map(|(_, n)| *n -= 1).is_none()
    };
    missed.lines().filter(|l| !l.trim().is_empty()).filter(is_new).collect()
}

fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// Tables of the page: counts, and what is alive. In a cell a bar would end it.
pub fn markdown(report: &Report) -> [String; 2] {
    let head = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|n| (*n).to_string()).collect();
        row(&names) + &row(&vec!["---".into(); names.len()])
    };
    let counts = |c: &Count| {
        let numbers = [c.tried, c.caught, c.timeout, c.unviable, c.alive].map(|n| n.to_string());
        row(&[[c.file.clone()].as_slice(), &numbers].concat())
    };
    let sum = report.files.iter().fold(Count { file: "all".into(), ..Count::default() }, |s, c| Count {
        file: s.file,
        tried: s.tried + c.tried,
        caught: s.caught + c.caught,
        timeout: s.timeout + c.timeout,
        unviable: s.unviable + c.unviable,
        alive: s.alive + c.alive,
    });
    let mut first = head(&["file", "tried", "caught", "timeout", "unviable", "alive"]);
    report.files.iter().chain([&sum]).for_each(|c| first += &counts(c));
    let Report { date, commit, before, built, left, .. } = report;
    first += &format!(
        "\n{date}, commit {commit}; {built} were built by cargo-mutants itself, and {left} of constants were not tried.\n"
    );
    first += &format!("Before tests were written for them, {before} changes were alive.\n");
    let mut second = head(&["file", "change", "places", "why nothing is seen of it"]);
    for a in &report.alive {
        let change = format!("`{}`", a.change.replace('|', "\\|"));
        second += &row(&[a.file.clone(), change, a.places.to_string(), a.why.clone()]);
    }
    [first, second]
}

/// Writes the tables of the page from what is stored.
///
/// # Errors
/// A file cannot be read or written.
pub fn report(root: &Path) -> Result<(), String> {
    let [counts, alive] = markdown(&stored(root)?);
    table::replace("docs/mutants.md", "mutants", &counts)?;
    table::replace("docs/mutants.md", "alive", &alive)
}

/// What `bench/mutants.json` holds.
///
/// # Errors
/// The file is there and is no report.
pub fn stored(root: &Path) -> Result<Report, String> {
    table::stored(root, "mutants")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_alive_is_stored_with_a_reason_and_more_of_it_is_new() {
        let stored = stored(&table::root()).unwrap();
        assert!(!stored.files.is_empty() && stored.alive.iter().all(|a| !a.why.is_empty()));
        for c in &stored.files {
            assert_eq!(c.tried, c.caught + c.timeout + c.unviable + c.alive, "{}", c.file);
            let explained: usize = stored.alive.iter().filter(|a| a.file == c.file).map(|a| a.places).sum();
            assert_eq!(c.alive, explained, "{}", c.file);
        }
        let alive =
            [Alive {
                file: "materials/curve.rs".into(), change: "replace < with <= in walk".into(), places: 2, why: "…".into()
            }];
        let line = |at: usize| format!("{ROOM}materials/curve.rs:{at}:86: replace < with <= in walk\n");
        assert!(unexplained(&(line(1) + &line(2)), &alive).is_empty());
        assert_eq!(unexplained(&(line(1) + &line(2) + &line(3)), &alive), [line(3).trim()]);
        let other = format!("{ROOM}materials/curve.rs:1:2: replace + with - in walk");
        assert_eq!(unexplained(&other, &alive), [&other]);
    }
}
