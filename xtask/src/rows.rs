//! Rows of measurements that are appended line by line, so that a run may be stopped at any time and goes on where it was.

use crate::real::report::Made;
use crate::table;
use cpu_time::ProcessTime;
use palpate::Clock;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// `bench/NAME.jsonl`.
pub fn path(name: &str) -> PathBuf {
    table::root().join("bench").join(format!("{name}.jsonl"))
}

/// All rows of a file; none where there is no file.
///
/// # Errors
/// A line is no row.
pub fn load<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, String> {
    let Ok(text) = std::fs::read_to_string(path) else { return Ok(Vec::new()) };
    let row = |(i, line): (usize, &str)| serde_json::from_str(line).map_err(|e| format!("{}:{}: {e}", path.display(), i + 1));
    text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty()).map(row).collect()
}

/// Appends a row in one write, so that several processes may share a file.
///
/// # Errors
/// The file cannot be written.
pub fn append(path: &Path, row: &impl Serialize) -> Result<(), String> {
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    let line = serde_json::to_string(row).map_err(|e| e.to_string())? + "\n";
    let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
    file.write_all(line.as_bytes()).map_err(fail)
}

/// The last row of every key, in the order in which they were measured: what a later state of the code has not answered stands as it was answered
/// before.
pub fn newest<T: Copy, K: Ord>(all: impl DoubleEndedIterator<Item = T>, key: impl Fn(T) -> K) -> Vec<T> {
    let mut seen = BTreeSet::new();
    let mut out: Vec<T> = all.rev().filter(|row| seen.insert(key(*row))).collect();
    out.reverse();
    out
}

/// What a study measures, by the files that can move its figures: studies run on the CPU and read no pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// Fits.
    Fits,
    /// Diagnoses, and the fits that they begin with.
    Diagnoses,
    /// Tracking, and fits that it leads.
    Tracking,
}

impl Measured {
    fn paths(self) -> Vec<&'static str> {
        // Tests move no figure either: folders of them, and files whose name ends so.
        const NEITHER: [&str; 13] = [
            "crates",
            ":!crates/palpate-gpu",
            ":!crates/palpate-import",
            ":!crates/palpate-export",
            ":!crates/palpate/src/commands/import.rs",
            ":!crates/palpate/src/results/import.rs",
            ":!crates/palpate/src/commands/export.rs",
            ":!crates/palpate/src/results/export.rs",
            ":!crates/palpate/src/exporting.rs",
            ":!crates/palpate/src/report",
            ":!crates/*/src/tests",
            ":!crates/*/tests/*",
            ":!crates/*tests.rs",
        ];
        const TRACKING: [&str; 9] = [
            ":!crates/palpate-cpu/src/tracking",
            ":!crates/palpate-engine/src/tracking",
            ":!crates/palpate-fit/src/vibrations",
            ":!crates/palpate-io/src/scene/track.rs",
            ":!crates/palpate/src/fitting/warm",
            ":!crates/palpate/src/tracking.rs",
            ":!crates/palpate/src/tracking",
            ":!crates/palpate/src/commands/track.rs",
            ":!crates/palpate/src/results/tracking.rs",
        ];
        const DIAGNOSES: [&str; 2] = [":!crates/palpate-diagnose", ":!crates/palpate/src/diagnosing"];
        let more: Vec<&str> = match self {
            Measured::Fits => [&TRACKING[..], &DIAGNOSES].concat(),
            Measured::Diagnoses => TRACKING.to_vec(),
            Measured::Tracking => DIAGNOSES.to_vec(),
        };
        NEITHER.into_iter().chain(more).collect()
    }
}

/// Today, the last commit that changed what is measured, and a fingerprint of it: commits get other names when they are carried elsewhere, and the
/// same files do not.
///
/// # Errors
/// Git does not answer.
pub fn measured(of: Measured) -> Result<Made, String> {
    let git = |first: &[&'static str]| table::git(&[first, &["--"], &of.paths()].concat());
    let differs = if git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty() { "" } else { "+" };
    let (commit, files) = (git(&["log", "-1", "--format=%h"])?, git(&["ls-files", "--stage"])?);
    Ok(Made { date: table::today(), commit: commit + differs, code: format!("{:016x}{differs}", hash(&files)) })
}

/// The commit of rows in the order in which they were measured, or the first and the last of several; a dash of none.
pub fn commits<'a>(mut all: impl DoubleEndedIterator<Item = &'a str>) -> String {
    match (all.next(), all.next_back()) {
        (None, _) => "–".into(),
        (Some(first), Some(last)) if first != last => format!("{first} to {last}"),
        (Some(one), _) => one.into(),
    }
}

/// Time that all processors together have spent on this process: what else a machine does must not decide what is found.
pub fn processor_clock() -> Clock {
    let began = ProcessTime::now();
    Clock::new(move || began.elapsed())
}

/// A number that spreads names evenly, the order in which slices run: FNV-1a with the finaliser of MurmurHash3, without which names that
/// differ in their last letter would stay together.
pub fn hash(name: &str) -> u64 {
    let mix = |h: u64, by: u64| (h ^ (h >> 33)).wrapping_mul(by);
    let h = name.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    let h = mix(mix(h, 0xff51_afd7_ed55_8ccd), 0xc4ce_b9fe_1a85_ec53);
    h ^ (h >> 33)
}

#[cfg(test)]
mod tests {
    use super::{Measured, measured};

    #[test]
    fn the_same_files_have_the_same_fingerprint_and_others_another() {
        let of = |what| measured(what).unwrap().code;
        assert_eq!(of(Measured::Fits), of(Measured::Fits));
        assert_ne!(of(Measured::Fits), of(Measured::Diagnoses));
        assert_ne!(of(Measured::Fits), of(Measured::Tracking));
    }

    #[test]
    fn rows_that_are_appended_are_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.jsonl");
        assert!(super::load::<[u32; 2]>(&path).unwrap().is_empty());
        [[1, 2], [3, 4]].iter().for_each(|row| super::append(&path, row).unwrap());
        assert_eq!(super::load::<[u32; 2]>(&path).unwrap(), [[1, 2], [3, 4]]);
        std::fs::write(&path, "[1,2]\nnothing\n").unwrap();
        assert!(super::load::<[u32; 2]>(&path).unwrap_err().contains(":2:"));
    }

    #[test]
    fn the_last_row_of_every_key_stays_in_its_order() {
        let rows = [("b", 1), ("a", 2), ("b", 3), ("c", 4), ("a", 5)];
        assert_eq!(super::newest(rows.iter(), |r| r.0), [&("b", 3), &("c", 4), &("a", 5)]);
    }
}
