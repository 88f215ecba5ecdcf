//! All tests with one command: built once, run in as many lanes as there are cores, the slowest named at the end.
//!
//! Tests are timed by running every binary with one thread and noting when each of its lines arrives.

mod adapter;
mod build;
mod jobs;
mod lanes;

pub use adapter::find_adapter;

use jobs::Job;
use lanes::Outcome;
use std::path::Path;
use std::time::{Duration, Instant};

/// What to run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Also the tests that are ignored because they are slow, and unit tests with debug assertions and overflow checks.
    pub full: bool,
    /// Only tests of these packages; all where there is none.
    pub packages: Vec<String>,
    /// Only tests whose name holds one of these; all where there is none.
    pub names: Vec<String>,
    /// Only unit tests with debug assertions and overflow checks, of the packages that have such.
    pub checked: bool,
}

impl Options {
    /// True when nothing is left out by name or package.
    fn is_whole(&self) -> bool {
        self.packages.is_empty() && self.names.is_empty()
    }
}

/// How many of the slowest tests are named.
const SLOWEST: usize = 20;

/// Runs the tests of the workspace at `root`.
///
/// # Errors
/// No adapter although `PALPATE_GPU=require`, nothing was built, or a test fails.
pub fn run(root: &Path, options: &Options) -> Result<(), String> {
    let clock = Instant::now();
    let adapter = find_adapter(true);
    let required = std::env::var("PALPATE_GPU").is_ok_and(|v| v == "require");
    match &adapter {
        Ok(name) => println!("GPU tests run on {name}"),
        Err(e) if required => return Err(format!("PALPATE_GPU=require, but {e}")),
        Err(e) => println!("GPU tests are skipped: {e}"),
    }
    let mut binaries = Vec::new();
    if !options.checked {
        binaries.extend(build::plain(root, &options.packages)?);
    }
    // Everything is compiled once more for them, which takes longer than all quick tests of some packages.
    if options.checked || options.full && options.is_whole() {
        binaries.extend(build::checked(root, &options.packages)?);
    }
    println!("built after {:.0} s", clock.elapsed().as_secs_f64());
    let (jobs, left) = jobs::all(root, &binaries, options)?;
    let outcomes = lanes::run(&jobs, adapter.is_ok());
    report(&jobs, &outcomes, left, clock.elapsed());
    if let Err(e) = &adapter {
        println!("the tests of the GPU were skipped: {e}");
    }
    // Alone on its line, for whoever looks for it.
    let sum = |of: fn(&Outcome) -> usize| outcomes.iter().map(of).sum::<usize>();
    println!("{} passed, {} failed", sum(|o| o.passed), sum(|o| o.failed));
    match sum(|o| o.failed) {
        0 => Ok(()),
        _ => Err("some tests failed".into()),
    }
}

/// Prints the slowest tests, what failed, and how long it all took.
fn report(jobs: &[Job], outcomes: &[Outcome], left: usize, taken: Duration) {
    let mut times: Vec<(Duration, String)> = Vec::new();
    for (job, outcome) in jobs.iter().zip(outcomes) {
        times.extend(outcome.times.iter().map(|(name, t)| (*t, format!("{}: {name}", job.label))));
    }
    times.sort_by(|a, b| b.cmp(a));
    println!("\nthe slowest of {} tests:", times.len());
    times.iter().take(SLOWEST).for_each(|(t, name)| println!("  {:6.1} s  {name}", t.as_secs_f64()));
    let work: Duration = outcomes.iter().map(|o| o.taken).sum();
    println!("{:.0} s of tests in {:.0} s with building", work.as_secs_f64(), taken.as_secs_f64());
    if left > 0 {
        println!("{left} slow tests are left to `cargo xtask test --full`");
    }
    for (job, outcome) in jobs.iter().zip(outcomes).filter(|(_, o)| o.failed > 0) {
        println!("failed: {} {}", job.label, outcome.failures.join(", "));
    }
}
