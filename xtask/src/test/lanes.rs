//! Runs jobs side by side, one in each lane, and notes when their tests end.

use super::jobs::Job;
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// What came of a job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Tests that passed.
    pub passed: usize,
    /// Tests that failed; one where the process itself did.
    pub failed: usize,
    /// Names of those.
    pub failures: Vec<String>,
    /// How long each test took, by name.
    pub times: Vec<(String, Duration)>,
    /// How long all of it took.
    pub taken: Duration,
}

/// Runs all jobs, as many at once as there are cores; the first come first.
pub fn run(jobs: &[Job], has_adapter: bool) -> Vec<Outcome> {
    let lanes = std::thread::available_parallelism().map_or(1, usize::from).min(jobs.len().max(1));
    let next = AtomicUsize::new(0);
    let outcomes = Mutex::new(vec![Outcome::default(); jobs.len()]);
    let lane = || {
        while let Some((k, job)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|k| Some((k, jobs.get(k)?))) {
            let outcome = one(job, has_adapter);
            let mut all = outcomes.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            all[k] = outcome;
        }
    };
    std::thread::scope(|scope| (0..lanes).for_each(|_| drop(scope.spawn(lane))));
    outcomes.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The process of a job, with the surroundings that tests expect.
fn command(job: &Job, has_adapter: bool) -> Command {
    let mut command = Command::new(&job.program);
    command.args(&job.arguments).current_dir(&job.folder).env("CARGO_MANIFEST_DIR", &job.folder);
    // The other lanes have the other cores. Bits do not depend on it, and tests that are about threads make their own.
    command.env("RAYON_NUM_THREADS", "1");
    if has_adapter {
        command.env("PALPATE_GPU", "require");
        // Lavapipe's own threads cost more per dispatch than small problems compute.
        if std::env::var_os("LP_NUM_THREADS").is_none() {
            command.env("LP_NUM_THREADS", "0");
        }
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn one(job: &Job, has_adapter: bool) -> Outcome {
    let clock = Instant::now();
    let mut child = match command(job, has_adapter).spawn() {
        Ok(child) => child,
        Err(e) => {
            println!("{}: {} cannot be started: {e}", job.label, job.program.display());
            return Outcome { failed: 1, ..Outcome::default() };
        }
    };
    let (out, err) = (child.stdout.take(), child.stderr.take());
    let mut said = String::new();
    let mut outcome = std::thread::scope(|scope| {
        let aside = scope.spawn(|| {
            let mut bytes = Vec::new();
            // Words for whoever looks into a failure; a pipe that breaks takes nothing from the result.
            err.map(|mut e| e.read_to_end(&mut bytes));
            String::from_utf8_lossy(&bytes).into_owned()
        });
        let lines = out.into_iter().flat_map(|o| BufReader::new(o).split(b'\n')).map_while(Result::ok);
        let outcome = heard(lines.map(|l| String::from_utf8_lossy(&l).into_owned()), &mut said);
        said += &aside.join().unwrap_or_default();
        outcome
    });
    let succeeded = child.wait().is_ok_and(|s| s.success());
    if !succeeded && outcome.failed == 0 {
        outcome.failed = 1;
    }
    outcome.taken = clock.elapsed();
    tell(job, &outcome, &said);
    outcome
}

fn tell(job: &Job, outcome: &Outcome, said: &str) {
    let name = if let [(name, _)] = &outcome.times[..] { format!(": {name}") } else { String::new() };
    let seconds = outcome.taken.as_secs_f64();
    println!("{}{name}: {} passed, {} failed, {seconds:.1} s", job.label, outcome.passed, outcome.failed);
    if outcome.failed > 0 {
        println!("{said}");
    }
}

/// Reads what a test binary prints while it runs.
fn heard(lines: impl Iterator<Item = String>, said: &mut String) -> Outcome {
    let mut outcome = Outcome::default();
    let mut before = Instant::now();
    for line in lines {
        let (name, end) = line.strip_prefix("test ").and_then(|l| l.rsplit_once(" ... ")).unwrap_or_default();
        let now = Instant::now();
        match end {
            "ok" => outcome.passed += 1,
            "FAILED" => {
                outcome.failed += 1;
                outcome.failures.push(name.into());
            }
            _ => {}
        }
        if matches!(end, "ok" | "FAILED") {
            outcome.times.push((name.into(), now - before));
            before = now;
        }
        said.push_str(&line);
        said.push('\n');
    }
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_and_failures_are_counted_by_name() {
        let text = "\nrunning 4 tests\ntest a::b ... ok\ntest c - should panic ... ok\ntest d ... FAILED\ntest e ... ignored, slow\n\n\
                    failures:\n\n---- d stdout ----\nno\n\ntest result: FAILED. 2 passed; 1 failed; 1 ignored";
        let mut said = String::new();
        let outcome = heard(text.lines().map(String::from), &mut said);
        assert_eq!((outcome.passed, outcome.failed, outcome.failures), (2, 1, vec!["d".to_string()]));
        let names: Vec<&str> = outcome.times.iter().map(|t| t.0.as_str()).collect();
        assert_eq!(names, ["a::b", "c - should panic", "d"]);
        assert!(said.contains("no"));
    }

    #[test]
    fn a_process_that_dies_is_a_failure() {
        let job = |program: &str| Job {
            label: "x".into(),
            program: program.into(),
            arguments: Vec::new(),
            folder: std::env::temp_dir(),
        };
        let outcomes = run(&[job("false"), job("true"), job("no such program")], false);
        assert_eq!(outcomes.iter().map(|o| o.failed).collect::<Vec<_>>(), [1, 0, 1]);
    }
}
