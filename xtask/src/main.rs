//! Developer verbs.

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use studies::{bench, blind, paper, real, same, table, test, tidy};

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
        /// One table alone: torus, finer, ball, gravity, cameras, image, band, optimiser or gradient
        #[arg(long, value_name = "TABLE")]
        only: Option<String>,
    },
    /// Time and memory of a step, forward and back
    Bench {
        /// With --gpu: leave out what would take longer than this [s], which on software adapters large bodies in batches do
        #[arg(long, requires = "gpu", value_name = "SECONDS", default_value_t = 180.0)]
        patience: f64,
        /// Only bodies whose name begins so, e.g. dragon or "ball 30k"; nothing is written
        #[arg(long, value_name = "NAME")]
        only: Option<String>,
        /// The GPU backend beside the CPU's, in batches, with times per pass
        #[arg(long)]
        gpu: bool,
        /// Without the bodies of 100 000 nodes; with --gpu: the small bodies alone, for software adapters
        #[arg(long)]
        quick: bool,
        /// With --gpu: instead of steps, a whole fit of the size of the paper's teddy; with --quick a tiny one
        #[arg(long, requires = "gpu")]
        fit: bool,
        /// Only compare two results of earlier runs
        #[arg(long, num_args = 2, value_names = ["BEFORE", "AFTER"])]
        compare: Option<Vec<PathBuf>>,
    },
    /// Hide every effect in recordings and see what the diagnosis says
    Blind {
        /// Only cases that hide this effect, or a group: null, pair, magnet; or one case by its name
        #[arg(long, value_name = "EFFECT")]
        only: Option<String>,
        /// Only this scene: beam, torus, ball, blob or plate
        #[arg(long, value_name = "NAME")]
        scene: Option<String>,
        /// Recordings with nothing hidden
        #[arg(long, value_name = "N", default_value_t = 20)]
        nulls: usize,
        /// A fixed small subset
        #[arg(long)]
        quick: bool,
        /// Time for the search of one case [s]
        #[arg(long, value_name = "SECONDS", default_value_t = 180.0)]
        budget: f64,
        /// Do cases again that are known already
        #[arg(long)]
        fresh: bool,
        /// Only print how strong each case is
        #[arg(long)]
        strengths: bool,
        /// Say what is being computed
        #[arg(long)]
        verbose: bool,
        /// Instead: recordings by a simulator that shares nothing with palpate (quadratic tetrahedra, neo-Hookean); --only takes a case, its
        /// first word, its scene or what is hidden
        #[arg(long, conflicts_with_all = ["scene", "quick", "strengths"])]
        independent: bool,
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
    },
    /// Run the tests, installing Mesa's software graphics adapter first where there is none and it may be installed
    Test {
        /// Also the slow ones: whole recoveries and blind cases
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
    /// Check rooms, imports, sizes of files
    Tidy,
}

fn run(verb: Verb) -> Result<(), String> {
    match verb {
        Verb::Paper { quick, only } => {
            let suffix = only.as_ref().map_or_else(String::new, |t| format!("-{t}"));
            let report = paper::tables::all(quick, only).map_err(|e| e.to_string())?;
            report.print();
            let name = format!("paper{}{suffix}", if quick { "-quick" } else { "" });
            println!("\nwritten to {}", table::save(&name, &report)?.display());
        }
        Verb::Bench { compare: Some(files), .. } => bench::report::compare(&files[0], &files[1])?,
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
        Verb::Bench { quick, only: Some(name), .. } => bench::all(quick, &name)?.print(),
        Verb::Bench { quick, only: None, .. } => {
            let report = bench::all(quick, "")?;
            report.print();
            println!("\nwritten to {}", table::save(&format!("bench-{}", report.date), &report)?.display());
        }
        Verb::Blind { only, scene, nulls, quick, budget, fresh, strengths, verbose, independent } => {
            blind::run(&blind::Options { only, scene, nulls, quick, budget, fresh, strengths, verbose, independent })?;
        }
        Verb::Same { only, backend, why, .. } => same::run(&same::Options { only, backend, why })?,
        Verb::Real { only } => println!("\nwritten to {}", real::run(&only)?.display()),
        Verb::Test { full, packages, checked, names } => {
            test::run(&table::root(), &test::Options { full, packages, names, checked })?;
        }
        Verb::Adapter { install } => println!("{}", test::find_adapter(install)?),
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
