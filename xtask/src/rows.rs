//! Rows of measurements that are appended line by line, so that a run may be stopped at any time and goes on where it was.

use crate::real::report::Made;
use crate::table;
use serde::Serialize;
use serde::de::DeserializeOwned;
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

/// Today, and the last commit that changed what is measured: the crates, not the studies of them.
///
/// # Errors
/// Git does not answer.
pub fn measured() -> Result<Made, String> {
    let differs = !table::git(&["status", "--porcelain", "--untracked-files=no", "--", "crates", "shaders"])?.is_empty();
    let commit = table::git(&["log", "-1", "--format=%h", "--", "crates", "shaders"])?;
    Ok(Made { date: table::today(), commit: commit + if differs { "+" } else { "" } })
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
}
