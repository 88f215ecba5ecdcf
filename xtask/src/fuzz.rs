//! `cargo xtask fuzz`: the readers against damaged files for as long as asked, on a stable compiler. The targets are those of `fuzz/`, which
//! `cargo +nightly fuzz run NAME` runs with coverage.

use std::path::Path;
use std::process::Command;

/// Runs all targets for so many minutes together.
///
/// # Errors
/// A reader panics or takes too long; the file is named in what the test prints.
pub fn run(root: &Path, minutes: f64) -> Result<(), String> {
    if !(minutes > 0.0 && minutes < 1e5) {
        return Err(format!("--minutes {minutes}: must be > 0 and below 100000"));
    }
    let status = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".into()))
        .args(["test", "--release", "-p", "palpate", "--test", "fuzz", "no_reader", "--", "--nocapture"])
        .env("PALPATE_FUZZ_MINUTES", minutes.to_string())
        .current_dir(root)
        .status()
        .map_err(|e| format!("cargo: {e}"))?;
    if status.success() { Ok(()) } else { Err("a reader panics or takes too long".into()) }
}
