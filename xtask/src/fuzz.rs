//! `cargo xtask fuzz`: the readers against damaged files for as long as asked: drawn ones on a stable compiler, or by cargo-fuzz those that
//! reach code which none has reached before. The targets are those of `fuzz/`.
//!
//! A run goes on where the runs before it ended: `bench/fuzz.jsonl` counts them, and each has a seed of its own.

use crate::{rows, table};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::{Command, Stdio};

/// Files of one target in one go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the target.
    pub target: String,
    /// What its damages were drawn with.
    pub seed: u64,
    /// How long a processor worked for it [min].
    pub minutes: f64,
    /// Damaged files that it read.
    pub files: u64,
    /// True where cargo-fuzz made them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub guided: bool,
    /// Day of the run.
    pub date: String,
    /// Commit whose readers they were.
    pub commit: String,
}

/// Runs targets for so many minutes together, all of them or those that are named.
///
/// # Errors
/// A reader panics or takes too long; the file is named in what the test prints.
pub fn run(root: &Path, minutes: f64, only: &[String], guided: bool) -> Result<(), String> {
    if !(minutes > 0.0 && minutes < 1e5) {
        return Err(format!("--minutes {minutes}: must be > 0 and below 100000"));
    }
    let targets = targets(root)?;
    if let Some(other) = only.iter().find(|o| !targets.contains(o)) {
        return Err(format!("--only {other}: no target; there are {}", targets.join(", ")));
    }
    let chosen: Vec<&String> = targets.iter().filter(|t| only.is_empty() || only.contains(t)).collect();
    let path = rows::path("fuzz");
    for target in &chosen {
        let seed = rows::load::<Row>(&path)?.iter().filter(|r| r.target == **target).count() as u64;
        let share = minutes / chosen.len() as f64;
        let (files, minutes) =
            if guided { reaching(root, target, seed, share)? } else { (one(root, target, seed, share)?, share) };
        let commit = table::git(&["log", "-1", "--format=%h"])?;
        println!("{target}: {files} files in {minutes:.1} minutes");
        let row = Row { target: (*target).clone(), seed, minutes, files, guided, date: table::today(), commit };
        rows::append(&path, &row)?;
    }
    Ok(())
}

/// Files that one target read in so many minutes.
fn one(root: &Path, target: &str, seed: u64, minutes: f64) -> Result<u64, String> {
    // All of the workspace, so that crates keep the features that the other tests were built with.
    let done = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
        .args(["test", "--release", "--workspace", "--test", "fuzz", "no_reader", "--", "--nocapture"])
        .env("PALPATE_FUZZ_MINUTES", minutes.to_string())
        .env("PALPATE_FUZZ_ONLY", target)
        .env("PALPATE_FUZZ_SEED", seed.to_string())
        .stderr(Stdio::inherit())
        .current_dir(root)
        .output()
        .map_err(|e| format!("cargo: {e}"))?;
    let told = String::from_utf8_lossy(&done.stdout);
    if !done.status.success() {
        return Err(format!("a reader panics or takes too long:\n{told}"));
    }
    let line = told.lines().find_map(|l| l.split_once(&format!("{target}: ")));
    let files = line.and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok());
    files.ok_or_else(|| format!("{target}: the test does not say how many files it read:\n{told}"))
}

/// Files that cargo-fuzz made for a target in so many minutes of the clock, and the minutes that a processor worked for it. What it finds on the
/// way stays in `target/fuzz`, and the next run begins with it.
fn reaching(root: &Path, target: &str, seed: u64, minutes: f64) -> Result<(u64, f64), String> {
    let found = root.join("target/fuzz").join(target);
    std::fs::create_dir_all(&found).map_err(|e| format!("{}: {e}", found.display()))?;
    let cargo = |verb: &str| {
        let mut command = Command::new("cargo");
        // No sanitizer: the readers are safe code, and twice as many files are read.
        command.args(["+nightly", "fuzz", verb, "--sanitizer", "none", target]).current_dir(root);
        // A cargo that runs this program names its own compiler.
        command.env_remove("CARGO").env_remove("RUSTUP_TOOLCHAIN");
        command
    };
    let built = cargo("build").status().map_err(|e| format!("cargo: {e}"))?;
    if !built.success() {
        return Err("cargo-fuzz is needed: cargo install cargo-fuzz, and rustup toolchain install nightly".into());
    }
    let before = of_children()?;
    let done = cargo("run")
        .args([&found, &root.join("fuzz/corpus").join(target)])
        .arg("--")
        .args([format!("-max_total_time={:.0}", 60.0 * minutes), format!("-seed={}", seed + 1)])
        .args(["-print_final_stats=1", "-timeout=60", "-rss_limit_mb=2048"])
        .output()
        .map_err(|e| format!("cargo: {e}"))?;
    let told = String::from_utf8_lossy(&done.stderr);
    if !done.status.success() {
        let last: Vec<&str> = told.lines().rev().take(60).collect();
        return Err(format!(
            "a reader panics, or takes too much time or memory:\n{}",
            last.into_iter().rev().collect::<Vec<_>>().join("\n")
        ));
    }
    let files = told.lines().find_map(|l| l.strip_prefix("stat::number_of_executed_units:")?.trim().parse().ok());
    let files = files.ok_or_else(|| format!("{target}: cargo-fuzz does not say how many files it read:\n{told}"))?;
    Ok((files, ((of_children()? - before) / 0.6).round() / 100.0))
}

/// Time of a processor that ended children of this process have taken [s].
fn of_children() -> Result<f64, String> {
    const PATH: &str = "/proc/self/stat";
    // Ticks of Linux, whatever its own clock does.
    const TICKS: f64 = 100.0;
    let text = std::fs::read_to_string(PATH).map_err(|e| format!("{PATH}: {e}; --guided counts processors on Linux only"))?;
    // The name in parentheses may hold anything; behind it fields 3 and on.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let number = |k: usize| fields.get(k - 3).and_then(|f| f.parse::<f64>().ok()).ok_or_else(|| format!("{PATH}: no field {k}"));
    Ok((number(16)? + number(17)?) / TICKS)
}

/// Names of the targets, a folder of files to begin with each.
fn targets(root: &Path) -> Result<Vec<String>, String> {
    let corpus = root.join("fuzz/corpus");
    let entries = std::fs::read_dir(&corpus).map_err(|e| format!("{}: {e}", corpus.display()))?;
    let mut names: Vec<String> = entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    Ok(names)
}

/// Table of what was run, a line a target.
///
/// # Errors
/// The rows cannot be read.
pub fn markdown(root: &Path) -> Result<String, String> {
    let rows: Vec<Row> = rows::load(&root.join("bench/fuzz.jsonl"))?;
    let mut out = String::from(
        "| target | drawn files | minutes | guided files | minutes | last run |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    let mut line = |name: &str, of: &[&Row]| {
        let sums = [false, true].map(|guided| {
            let of = of.iter().filter(|r| r.guided == guided);
            let (files, minutes) = of.fold((0, 0.0), |(files, minutes), r| (files + r.files, minutes + r.minutes));
            format!("{files} | {minutes:.1}")
        });
        let last = of.iter().map(|r| &r.date).max().map_or("never", |d| d);
        out += &format!("| {name} | {} | {last} |\n", sums.join(" | "));
    };
    for target in targets(root)? {
        line(&target, &rows.iter().filter(|r| r.target == target).collect::<Vec<_>>());
    }
    line("all", &rows.iter().collect::<Vec<_>>());
    Ok(out)
}

/// Writes the table of the page from what is stored.
///
/// # Errors
/// A file cannot be read or written.
pub fn report(root: &Path) -> Result<(), String> {
    table::replace("docs/fuzzing.md", "fuzz", &markdown(root)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_a_target_are_counted_together_and_have_different_seeds() {
        let root = table::root();
        let rows: Vec<Row> = rows::load(&rows::path("fuzz")).unwrap();
        let known = targets(&root).unwrap();
        for (i, row) in rows.iter().enumerate() {
            assert!(known.contains(&row.target) && row.minutes > 0.0, "{row:?}");
            assert!(rows[..i].iter().all(|r| (&r.target, r.seed) != (&row.target, row.seed)), "{row:?}");
        }
        let all: u64 = rows.iter().filter(|r| !r.guided).map(|r| r.files).sum();
        assert!(markdown(&root).unwrap().contains(&format!("| all | {all} |")));
        assert!(run(&root, 0.0, &[], false).unwrap_err().contains("--minutes 0"));
        assert!(run(&root, 1.0, &["plyy".into()], true).unwrap_err().contains("no target; there are c3d"));
    }
}
