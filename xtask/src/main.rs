//! Developer verbs.

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use studies::{bench, coverage, dawn, fuzz, mutants, paper, real, same, suite, table, test, tidy, verify};

/// Counts what the benchmarks allocate.
#[global_allocator]
static MEMORY: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// Developer verbs of palpate.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Repeat the published recovery experiments
    Paper {
        /// Coarser cells, fewer starts and cases
        #[arg(long)]
        quick: bool,
        /// One table alone: torus, finer, ball, gravity, cameras, image, band, optimiser or gradient; or a study,
        /// real2sim or capture, of which one case alone is real2sim-NAME and what this commit has measured is not run again
        #[arg(long, value_name = "TABLE")]
        only: Option<String>,
        /// With --only and a study: print what was measured and write the tables of its page, and run nothing
        #[arg(long, requires = "only")]
        report: bool,
    },
    /// Time and memory of a step, forward and back
    Bench {
        /// With --gpu: leave out what would take longer than this [s], which on software adapters large bodies in batches do
        #[arg(long, requires = "gpu", value_name = "SECONDS", default_value_t = 180.0)]
        patience: f64,
        /// Only bodies whose name begins so, e.g. dragon or "ball 30k"; nothing is written unless --save asks for it
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// With --only: write what was measured to bench/
        #[arg(long, requires = "only", conflicts_with = "gpu")]
        save: bool,
        /// The GPU backend beside the CPU's, in batches, with times per pass
        #[arg(long)]
        gpu: bool,
        /// Without the bodies of 100 000 nodes; with --gpu: the small bodies alone, for software adapters
        #[arg(long)]
        quick: bool,
        /// With --gpu: instead of steps, a whole fit of the size of the paper's teddy; with --quick a tiny one
        #[arg(long, requires = "gpu")]
        fit: bool,
        /// With --gpu: instead of times, what steps come to, beside the CPU's: iterations, dispatches, bytes, and a model of a graphics
        /// processor; without --only all but "dragon × 60" and "ball 100k"; rows are kept in bench/counts.json
        #[arg(long, requires = "gpu", conflicts_with = "fit")]
        counts: bool,
        /// Only compare two results of earlier runs
        #[arg(long, num_args = 2, value_names = ["BEFORE", "AFTER"])]
        compare: Option<Vec<PathBuf>>,
    },
    /// Fit recordings of another simulator with drawn truths and count those inside the intervals that fits state (docs/coverage.md)
    Coverage {
        /// Only bodies of this kind (beam, plate, block, bouncing ball, resting ball), or sets of free numbers that hold this word
        #[arg(long, value_name = "WORD")]
        only: Option<String>,
        /// Stop after so many seconds; the next run goes on
        #[arg(long, value_name = "SECONDS")]
        slice: Option<f64>,
        /// Stop after so many fits
        #[arg(long, value_name = "N")]
        fits: Option<usize>,
        /// Fit again what this commit has fitted already
        #[arg(long)]
        fresh: bool,
        /// Instead: print the table of all that was measured, and store it
        #[arg(long)]
        report: bool,
    },
    /// Hide every effect, and what nobody knows, in recordings and see what palpate and methods beside it say (benchmark/README.md)
    Suite {
        /// Only these: groups (strong, weak, pair, outside, null), names of cases, scenes, kinds of drawn scenes, or what is hidden
        #[arg(long, value_name = "A,B")]
        only: Option<String>,
        /// Who answers
        #[arg(long, value_name = "A,B", default_value = "palpate")]
        method: String,
        /// At most so many cases of every group, spread over all of them
        #[arg(long, value_name = "N")]
        first: Option<usize>,
        /// Stop after so many minutes; the next run goes on
        #[arg(long, value_name = "MINUTES")]
        slice: Option<f64>,
        /// Time for the search of one case, of all its processors together [s]: three minutes of two of them
        #[arg(long, value_name = "SECONDS", default_value_t = 360.0)]
        budget: f64,
        /// Measure again what this commit has measured already
        #[arg(long)]
        fresh: bool,
        /// Let rows of other commits count as measured
        #[arg(long)]
        keep: bool,
        /// Say what is being computed
        #[arg(long)]
        verbose: bool,
        /// Instead: find amplitudes of cases in benchmark/cases.toml that have none
        #[arg(long, conflicts_with_all = ["record", "score", "report"])]
        calibrate: bool,
        /// Instead: write recordings and scenes of the cases for other methods
        #[arg(long, value_name = "FOLDER", conflicts_with_all = ["score", "report"])]
        record: Option<PathBuf>,
        /// Instead: score answers of another method
        #[arg(long, value_name = "FILE", conflicts_with = "report")]
        score: Option<PathBuf>,
        /// Instead: measure the cases once more for every number of the search, changed (--first 3 keeps it affordable)
        #[arg(long, conflicts_with_all = ["calibrate", "record", "score", "report", "method"])]
        ablate: bool,
        /// Instead: of cases that end in a tie, make the measurement that is proposed next, and diagnose both recordings
        #[arg(long, conflicts_with_all = ["calibrate", "record", "score", "report", "method", "ablate"])]
        settle: bool,
        /// Instead: print the tables of all that was measured, and store them
        #[arg(long)]
        report: bool,
    },
    /// Compare states, costs, derivatives and a fit of small scenes, bit by bit, with bench/same.json
    Same {
        /// Only cases whose name holds this
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// Only this backend
        #[arg(long, value_name = "NAME", value_parser = ["cpu", "gpu"])]
        backend: Option<String>,
        /// Store what is computed instead
        #[arg(long, requires = "why")]
        bless: bool,
        /// Why bits had to change, and how far they did
        #[arg(long, value_name = "TEXT", requires = "bless", value_parser = clap::builder::NonEmptyStringValueParser::new())]
        why: Option<String>,
    },
    /// Fit every measured recording and print what docs/real-data.md says of them
    Real {
        /// Only these tables; the others stay in bench/real.json as they are
        #[arg(long, value_name = "TABLE", num_args = 1..)]
        only: Vec<real::report::Slice>,
        /// Instead: print the tables of all that was measured, and write those of docs/real-data.md
        #[arg(long)]
        report: bool,
    },
    /// Check the equations against theory: orders in space and time, the gradient, and benchmarks with known answers
    ///
    /// Each study is stored in bench/verify.json as it ends, and docs/verification.md is written from that file. Fails where a figure
    /// is not what it has to be.
    Verify {
        /// Only these studies, the others stay as stored: space, time, taylor, cantilever, cook, vibration, hertz, bounce, friction, spin
        #[arg(long, value_name = "STUDY", num_args = 1..)]
        only: Vec<String>,
    },
    /// Run the tests, installing Mesa's software graphics adapter first where there is none and it may be installed
    Test {
        /// Also the slow ones: whole recoveries, cases of the suite, and unit tests with debug assertions and overflow checks
        #[arg(long)]
        full: bool,
        /// Only those of this package
        #[arg(long = "package", short, value_name = "NAME")]
        packages: Vec<String>,
        /// Only unit tests with debug assertions and overflow checks
        #[arg(long)]
        checked: bool,
        /// Only tests whose name holds one of these
        names: Vec<String>,
    },
    /// Say which graphics adapter would be used
    Adapter {
        /// Install Mesa's software adapter where there is none and it may be installed
        #[arg(long)]
        install: bool,
    },
    /// Ask Dawn, the WebGPU of Chromium, whether its compiler takes every kernel, and compare a step that it computes with the CPU's
    ///
    /// Needs Node.js with npm. Where Dawn does not take the system's Vulkan driver, a newer Mesa is fetched on Debian into target/dawn.
    Dawn {
        /// Only the compiler
        #[arg(long)]
        compile: bool,
    },
    /// Damaged files against every reader (docs/fuzzing.md)
    ///
    /// A run draws other damages than the runs before it, and is counted in bench/fuzz.jsonl when a target has had its time.
    Fuzz {
        /// How long, all targets together
        #[arg(long, default_value_t = 5.0)]
        minutes: f64,
        /// Targets to run, by name; all of them without
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
        /// By cargo-fuzz, which seeks files that reach other code; it needs a nightly compiler
        #[arg(long)]
        guided: bool,
        /// Write the table of the page from what is stored, and run nothing
        #[arg(long)]
        report: bool,
    },
    /// Change effects and materials in one place at a time and see whether a test notices (docs/mutants.md)
    ///
    /// Needs cargo-mutants, which builds the crate once for every change: many hours for all of them. What was caught before is left out, so that it can
    /// be stopped and goes on. Fails where a change is alive that the page does not explain.
    Mutants {
        /// Only a part of the changes, spread over all files, e.g. 0/20
        #[arg(long, value_name = "K/N")]
        shard: Option<String>,
        /// Instead: write the tables of docs/mutants.md from bench/mutants.json
        #[arg(long, conflicts_with = "shard")]
        report: bool,
    },
    /// Check rooms, imports, sizes of files
    Tidy,
}

fn run(verb: Verb) -> Result<(), String> {
    match verb {
        Verb::Paper { quick, only, report } => {
            if let Some((set, only)) = only.as_ref().and_then(|o| Some((paper::SETS.iter().find(|s| s.is_asked(o))?, o))) {
                return if report { set.report() } else { set.run(only) };
            }
            let suffix = only.as_ref().map_or_else(String::new, |t| format!("-{t}"));
            let report = paper::tables::all(quick, only).map_err(|e| e.to_string())?;
            report.print();
            let name = format!("paper{}{suffix}", if quick { "-quick" } else { "" });
            println!("\nwritten to {}", table::save(&name, &report)?.display());
        }
        Verb::Bench { compare: Some(files), .. } => bench::report::compare(&files[0], &files[1])?,
        Verb::Bench { gpu: true, counts: true, only, .. } => bench::counts::run(only.as_deref())?,
        Verb::Bench { gpu: true, fit: true, quick, .. } => {
            let report = bench::fit::run(quick)?;
            report.print();
            let name = format!("bench-gpu-fit{}-{}", if quick { "-quick" } else { "" }, report.date);
            println!("\nwritten to {}", table::save(&name, &report)?.display());
        }
        Verb::Bench { patience, gpu: true, quick, only, .. } => {
            let report = bench::gpu::all(quick, only.as_deref().unwrap_or(""), patience)?;
            report.print();
            if only.is_none() {
                let name = format!("bench-gpu{}-{}", if quick { "-quick" } else { "" }, report.date);
                println!("\nwritten to {}", table::save(&name, &report)?.display());
            }
        }
        Verb::Bench { quick, only: Some(name), save, .. } => {
            let report = bench::all(quick, &name)?;
            report.print();
            if save {
                let name = format!("bench-{}-{}", name.replace(' ', "-"), report.date);
                println!("\nwritten to {}", table::save(&name, &report)?.display());
            }
        }
        Verb::Bench { quick, only: None, .. } => {
            let report = bench::all(quick, "")?;
            report.print();
            println!("\nwritten to {}", table::save(&format!("bench-{}", report.date), &report)?.display());
        }
        Verb::Coverage { only, slice, fits, fresh, report } => {
            coverage::run(&coverage::Options { only, slice, fits, fresh, report })?;
        }
        Verb::Suite {
            only,
            method,
            first,
            slice,
            budget,
            fresh,
            keep,
            verbose,
            calibrate,
            record,
            score,
            ablate,
            settle,
            report,
        } => {
            let instead = match (calibrate, record, score, report) {
                _ if ablate => suite::Instead::Ablate,
                _ if settle => suite::Instead::Settle,
                (true, ..) => suite::Instead::Calibrate,
                (_, Some(folder), ..) => suite::Instead::Record(folder),
                (_, _, Some(file), _) => suite::Instead::Score(file),
                (.., true) => suite::Instead::Report,
                _ => suite::Instead::Nothing,
            };
            suite::run(&suite::Options { only, method, first, slice, budget, fresh, keep, verbose, instead })?;
        }
        Verb::Same { only, backend, why, .. } => same::run(&same::Options { only, backend, why })?,
        Verb::Real { only, report: true } => real::tell(&only)?,
        Verb::Real { only, .. } => println!("\nwritten to {}", real::run(&only)?.display()),
        Verb::Verify { only } => verify::run(&only)?,
        Verb::Test { full, packages, checked, names } => {
            test::run(&table::root(), &test::Options { full, packages, names, checked })?;
        }
        Verb::Adapter { install } => println!("{}", test::find_adapter(install)?),
        Verb::Dawn { compile } => dawn::run(dawn::Options { compile })?,
        Verb::Fuzz { report: true, .. } => fuzz::report(&table::root())?,
        Verb::Fuzz { minutes, only, guided, .. } => fuzz::run(&table::root(), minutes, &only, guided)?,
        Verb::Mutants { report: true, .. } => mutants::report(&table::root())?,
        Verb::Mutants { shard, .. } => mutants::run(&table::root(), shard.as_deref())?,
        Verb::Tidy => {
            let found = tidy::check(&table::root());
            found.iter().for_each(|f| println!("{f}"));
            if !found.is_empty() {
                return Err(format!("tidy: {} findings", found.len()));
            }
            println!("tidy: nothing to report");
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    // Inside the pool, as the product runs: from outside every parallel loop would wait for a thread to wake up.
    match rayon::scope(|_| run(Arguments::parse().verb)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}
