//! What runs as one process: a binary with few or short tests, or one long test.

use super::Options;
use super::build::{Binary, cargo};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

/// One process.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// For people.
    pub label: String,
    /// What is run.
    pub program: OsString,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// Where it is run.
    pub folder: PathBuf,
}

/// One thread a process: lanes fill the cores, and the device's tests take turns anyway.
const ONE: &str = "--test-threads=1";

/// All jobs in the order in which they begin, and how many slow tests are left out. The longest come first, so that no lane is still at
/// one of them when the others are done: the device's tests, which share one device in one process, then other whole binaries, then
/// single tests, those of the ladder's upper rungs before the quick ones of bad input.
///
/// # Errors
/// A binary cannot be asked for its tests.
pub fn all(root: &Path, binaries: &[Binary], options: &Options) -> Result<(Vec<Job>, usize), String> {
    let (mut device, mut single, mut rest, mut left) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for binary in binaries {
        let slow = names(binary, &["--ignored"], options)?;
        let mut wanted = names(binary, &[], options)?;
        if !options.full {
            left += slow.len();
            wanted.retain(|name| !slow.contains(name));
        }
        let job = |label: String, more: &[&str]| Job {
            label,
            program: binary.path.clone().into(),
            arguments: more.iter().chain(&[ONE]).map(|a| a.to_string()).collect(),
            folder: binary.folder.clone(),
        };
        let ignored: &[&str] = if options.full { &["--include-ignored"] } else { &[] };
        if wanted.is_empty() {
            continue;
        }
        if binary.splits {
            let one = |name: &String| job(binary.label.clone(), &[&[name.as_str(), "--exact"], ignored].concat());
            single.extend(wanted.iter().map(one));
            continue;
        }
        let names: Vec<&str> = options.names.iter().map(String::as_str).collect();
        let whole = job(binary.label.clone(), &[&names, ignored].concat());
        if binary.label.starts_with("palpate-gpu") { device.push(whole) } else { rest.push(whole) }
    }
    if options.is_whole() && !options.checked {
        let arguments = ["test", "--release", "--workspace", "--doc", "--", ONE].map(String::from).to_vec();
        device.push(Job { label: "examples in the documentation".into(), program: cargo(), arguments, folder: root.into() });
    }
    single.reverse();
    Ok(([device, rest, single].concat(), left))
}

/// Names of a binary's tests; with `--ignored` in `more` of those that are left out unless asked for.
fn names(binary: &Binary, more: &[&str], options: &Options) -> Result<BTreeSet<String>, String> {
    let wrong = |e: std::io::Error| format!("{}: {e}", binary.path.display());
    let mut command = Command::new(&binary.path);
    command.current_dir(&binary.folder).args(["--list", "--format", "terse"]).args(more).args(&options.names);
    let text = command.output().map_err(wrong)?.stdout;
    let name = |line: &str| line.strip_suffix(": test").map(str::to_string);
    Ok(String::from_utf8_lossy(&text).lines().filter_map(name).collect())
}
