//! `palpate fit`: parameters that explain a recording.

use crate::cli::{Console, INTERRUPTED};
use crate::engine::Backend;
use crate::error::Error;
use crate::events::Stage;
use crate::experiment::Experiment;
use crate::fields;
use crate::fitting::{FitOptions, Fitted, check, demand, fit, free_parameters, usual};
use crate::options::{BackendName, count, out_folder};
use crate::progress::{Convergence, Track, UNITS};
use crate::report::{FRAMES, summary, write_fit, write_report};
use crate::results;
use crate::results::fit::{FitDocument, FitStatus};
use clap::{Args, ValueEnum};
use palpate_fit::Progress;
use palpate_io::output::make_folder;
use palpate_io::read_recording;
use palpate_io::recording::Recording;
use palpate_model::scene::Optimizer;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

const AFTER_HELP: &str = "\
Examples:
  palpate fit beam.toml                        result in out/beam-fit/
  palpate fit beam.toml --starts 20 --optimizer rprop --out found
  palpate fit a.toml b.toml --out joint        the same body recorded twice; parameters with the same path are shared
  palpate fit beam.toml --out found --resume   go on with an interrupted fit
  palpate fit beam.toml --from seen            start from what `palpate track beam.toml --out seen` found

What is free, and where starts are drawn from, is said by [[fit.parameter]] in the scene. The folder gets result.json
(format fit/2), model.toml (the scene with the values found; of several scenes model-1.toml, model-2.toml, … in their
order), history.csv, report.html and journal.jsonl. Results that are already there are moved to previous-1,
previous-2, … in the same folder.

Start values far from the truth lead depth images astray. warm_start = \"modal\" in [fit] reads stiffness and damping off the
vibrations of markers or tracked points; \"tracked\" tracks the body first where the stated values leave readings unmet.

What is printed, result.json and the report begin with a verdict: converged, interrupted, at-a-bound or
not-to-be-trusted, and why. ± holds noise, what the recording calls systematic, and what an evaluation on finer cells
and half the step shows that these leave open (--no-grid-check leaves that out).

Ctrl-C stops at the next time step, writes the best so far (\"status\": \"interrupted\") and exits with 130. A
graphics device that fails (out of memory, lost) ends the fit as well: the best so far is written (\"status\":
\"broken-off\"), the exit code is 1, and --resume goes on where it failed, also with another --batch: how many
simulations run at once changes no number. `palpate inspect` says how much memory they will take.";

/// Find the parameters that explain a recording
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene files; several are fitted together
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Output folder [default: out/SCENE-fit]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with the journal of an interrupted fit in the output folder
    #[arg(long)]
    resume: bool,
    /// What `palpate track` wrote: start from a fit of its points (several scenes: one folder each, in their order)
    #[arg(long, value_name = "DIR")]
    from: Vec<PathBuf>,
    #[command(flatten)]
    choices: Choices,
}

/// How to fit; shared by `fit` and `batch`.
#[derive(Clone, Debug, Args)]
pub struct Choices {
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    pub backend: BackendName,
    /// Number of starts [default: the scene's]
    #[arg(long, value_name = "N", value_parser = count(1..=1_000_000), allow_negative_numbers = true)]
    starts: Option<u64>,
    /// Most simulations at once, where memory is short (or plenty) [default: all starts, as far as 2 GB and the device's buffers go]
    #[arg(long, value_name = "N", value_parser = count(1..=1_000_000), allow_negative_numbers = true)]
    batch: Option<u64>,
    /// Most iterations per start [default: the scene's]
    #[arg(long, value_name = "N", value_parser = count(0..=1_000_000), allow_negative_numbers = true)]
    iterations: Option<u64>,
    /// Optimiser [default: the scene's]
    #[arg(long, value_enum, value_name = "NAME")]
    optimizer: Option<OptimizerName>,
    /// Seed of the starts [default: the scene's]
    #[arg(long, value_parser = count(0..=u64::MAX), allow_negative_numbers = true)]
    seed: Option<u64>,
    /// Threads; 0 = one per core [default: the scene's]
    #[arg(long, value_name = "N", value_parser = count(0..=4096), allow_negative_numbers = true)]
    threads: Option<u64>,
    /// Leave out the look at cells and time step half as large, which says what they add to ± (it costs about as much as ten
    /// evaluations, and says how long it took)
    #[arg(long)]
    no_grid_check: bool,
    /// Most frames that the report shows in space; 0: no motion is simulated for it
    #[arg(long, value_name = "N", default_value_t = FRAMES, hide_short_help = true)]
    pictures: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OptimizerName {
    Rprop,
    GradientDescent,
    Lbfgs,
    GaussNewton,
    GaussNewtonCg,
    NelderMead,
}

impl From<OptimizerName> for Optimizer {
    fn from(name: OptimizerName) -> Optimizer {
        match name {
            OptimizerName::Rprop => Optimizer::Rprop,
            OptimizerName::GradientDescent => Optimizer::GradientDescent,
            OptimizerName::Lbfgs => Optimizer::Lbfgs,
            OptimizerName::GaussNewton => Optimizer::GaussNewton,
            OptimizerName::GaussNewtonCg => Optimizer::GaussNewtonCg,
            OptimizerName::NelderMead => Optimizer::NelderMead,
        }
    }
}

/// Nodes times steps from which on a fit takes long enough for a word on what it takes.
const LONG: usize = 200_000;

const JOURNAL: &str = "journal.jsonl";

/// Moves the files of an earlier fit aside; a journal that is to be resumed stays. Returns where they went.
fn keep_previous(folder: &Path, scenes: usize, resume: bool) -> Result<Option<PathBuf>, Error> {
    let mut names = vec!["result.json".to_string(), "history.csv".into(), "report.html".into(), "model.toml".into()];
    names.extend((1..=scenes.max(64)).map(|n| format!("model-{n}.toml")));
    names.extend(fields::names(folder));
    if !resume {
        names.push(JOURNAL.into());
    }
    let there: Vec<&String> = names.iter().filter(|n| folder.join(n).exists()).collect();
    if there.is_empty() {
        return Ok(None);
    }
    let number = (1..).find(|n| !folder.join(format!("previous-{n}")).exists()).expect("some number is free");
    let aside = folder.join(format!("previous-{number}"));
    make_folder(&aside)?;
    for n in there {
        std::fs::rename(folder.join(n), aside.join(n)).map_err(|e| Error::write(&aside.join(n), e))?;
    }
    Ok(Some(aside))
}

/// The command line that gives the same result.
fn command(scenes: &[PathBuf], from: &[Recording], a: &Choices, fitted: &Fitted) -> String {
    let quote = |p: &Path| {
        let s = p.display().to_string();
        if s.contains(|c: char| c.is_whitespace() || "'\"\\$`;&|<>()*?!#".contains(c)) {
            format!("'{}'", s.replace('\'', "'\\''"))
        } else {
            s
        }
    };
    let mut words = vec!["palpate fit".to_string()];
    words.extend(scenes.iter().map(|s| quote(s)));
    words.extend(from.iter().filter_map(|r| r.path.parent()?.parent()).map(|f| format!("--from {}", quote(f))));
    words.push(format!("--backend {}", fitted.backend));
    let mut option = |name: &str, value: Option<String>| words.extend(value.map(|v| format!("--{name} {v}")));
    option("starts", a.starts.map(|n| n.to_string()));
    option("iterations", a.iterations.map(|n| n.to_string()));
    let name = |o: OptimizerName| o.to_possible_value().map(|v| v.get_name().to_string());
    option("optimizer", a.optimizer.and_then(name));
    option("seed", a.seed.map(|n| n.to_string()));
    words.extend(a.no_grid_check.then(|| "--no-grid-check".to_string()));
    words.join(" ")
}

/// A scene that is given twice counts twice: its noise is taken for less than it is.
fn warn_of_twins(paths: &[PathBuf], experiments: &mut [Experiment]) {
    let files: Vec<Option<PathBuf>> = paths.iter().map(|p| p.canonicalize().ok()).collect();
    for (i, e) in experiments.iter_mut().enumerate().filter(|(i, _)| files[..*i].contains(&files[*i])) {
        let path = paths[i].display();
        e.warn(format!("{path}: is given twice; its data count twice, and the standard errors are too small"));
    }
}

/// What `palpate track` wrote into these folders.
fn tracked(folders: &[PathBuf], scenes: usize) -> Result<Vec<Recording>, Error> {
    if !folders.is_empty() && folders.len() != scenes {
        let message = format!("{} folders are given for {scenes} scenes; give one for each, in their order", folders.len());
        return Err(Error::option("from", folders[0].display(), message));
    }
    let read = |f: &PathBuf| {
        let place = f.join("recording");
        if !place.exists() {
            return Err(Error::option(
                "from",
                f.display(),
                "holds no recording/: give what `palpate track --out` wrote".to_string(),
            ));
        }
        Ok(read_recording(place)?)
    };
    folders.iter().map(read).collect()
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scenes[0], "-fit");
    // Before anything that takes time.
    crate::folder::check(&folder)?;
    let mut track = console.progress(0, "fitting");
    track.on(0, "reading");
    let mut experiments = a.scenes.iter().map(Experiment::open).collect::<Result<Vec<_>, _>>()?;
    warn_of_twins(&a.scenes, &mut experiments);
    let from = tracked(&a.from, a.scenes.len())?;
    let (backend, note) = choose(&a.choices, &experiments, &mut track)?;
    track.aside(|| {
        note.iter().for_each(|n| console.note(n));
        expected(&a.choices, &experiments, backend).iter().for_each(|n| console.note(n));
    });
    let lock = crate::folder::take(&folder, console)?;
    console.interrupt.serve();
    console.interrupt = lock.guard(&console.interrupt);
    let may_write = || lock.check();
    let (fitted, result) =
        run_in(&a.scenes, &from, &a.choices, backend, &experiments, &folder, a.resume, &may_write, &mut track, console)?;
    track.finish();
    console.warn(&fitted.warnings);
    if console.json() {
        console.print(&results::line(&result));
    } else {
        console.print(&format!("{}\n  report: {}", summary(&fitted, &result.fields), folder.join("report.html").display()));
    }
    if let Some(why) = &fitted.result.broken {
        return Err(Error::BrokenOff { why: why.clone(), kept: "the best so far", folder });
    }
    Ok(if fitted.interrupted { INTERRUPTED } else { 0 })
}

/// The backend for a fit of these experiments, which runs all starts at once: what is faster for the first. The track shows what takes time.
pub fn choose(a: &Choices, experiments: &[Experiment], track: &mut Track) -> Result<(Backend, Option<String>), Error> {
    let (first, spec) = (&experiments[0], experiments[0].scene().fit.as_ref());
    let starts = a.starts.map_or(spec.map_or(1, |f| f.starts), |n| n as usize);
    let (_, free, _) = free_parameters(experiments)?;
    let asked = a.optimizer.map(Optimizer::from).or(spec.and_then(|f| f.optimizer));
    let optimizer = asked.unwrap_or_else(|| usual(&free));
    a.backend.choose_for(first.plan(), &demand(&free, 0, optimizer, starts), track)
}

/// What a fit on the CPU will take, where that is much.
fn expected(a: &Choices, experiments: &[Experiment], backend: Backend) -> Option<String> {
    let (first, spec) = (&experiments[0], experiments[0].scene().fit.as_ref()?);
    if backend == Backend::Gpu || first.plan().body.nodes.len() * first.plan().clock.steps.max(1) < LONG {
        return None;
    }
    let starts = a.starts.map_or(spec.starts, |n| n as usize);
    let (_, free, _) = free_parameters(experiments).ok()?;
    let optimizer = a.optimizer.map(Optimizer::from).or(spec.optimizer).unwrap_or_else(|| usual(&free));
    let (members, memory) = demand(&free, 0, optimizer, starts).on_cpu(first.plan(), a.threads.unwrap_or(0) as usize);
    let left = palpate_io::available().map_or(String::new(), |room| format!("; {room}"));
    let size = palpate_io::gigabytes(memory.total());
    Some(format!("memory: about {size} for {members} of {starts} starts at once{left}"))
}

impl Choices {
    /// What decides the result: a scene may be gone on with in smaller batches, and by fewer threads.
    pub fn lasting(&self) -> Choices {
        Choices { batch: None, threads: None, ..self.clone() }
    }
}

/// Fits, beginning with what was tracked where anything was, and writes everything into a folder, unless `may_write` then says that it is
/// another's by now; the progress goes to `track`. Returns the fit and its `result.json`.
pub fn run_in(
    scenes: &[PathBuf],
    from: &[Recording],
    a: &Choices,
    backend: Backend,
    experiments: &[Experiment],
    folder: &Path,
    resume: bool,
    may_write: &dyn Fn() -> Result<(), Error>,
    track: &mut Track,
    console: &mut Console,
) -> Result<(Fitted, FitDocument), Error> {
    check(experiments)?;
    make_folder(folder)?;
    track.measure(UNITS);
    track.on(0, "the first evaluations");
    let journal = folder.join(JOURNAL);
    if resume && !journal.exists() {
        // Not what was asked for: --quiet does not silence it.
        let warning = format!("{}: there is no journal to go on with; the fit begins anew", journal.display());
        track.aside(|| console.warn(&[warning]));
    }
    let make_room = |track: &Track, console: &mut Console| -> Result<(), Error> {
        if let Some(aside) = keep_previous(folder, experiments.len(), resume)? {
            let note = format!("the results that were in {} are now in {}", folder.display(), aside.display());
            track.aside(|| console.note(&note));
        }
        Ok(())
    };
    // A journal is begun at once. One that is gone on with may turn out to be of another fit, and then everything stays where it is.
    if !resume {
        make_room(track, console)?;
    }
    // The two that are told take turns, but the compiler cannot know.
    let shared = Mutex::new(track);
    let mut say = |text: &str| {
        if let Ok(mut track) = shared.lock() {
            track.on(0, text);
        }
    };
    let spec = experiments[0].scene().fit.as_ref();
    let mut come = Convergence::new(a.starts.map_or(spec.map_or(1, |f| f.starts), |n| n as usize));
    let mut hear = |p: &Progress| {
        come.hear(p);
        if let Ok(mut track) = shared.lock() {
            track.at(come.units(), &come.text());
        }
    };
    let mut fitted = fit(
        experiments,
        FitOptions {
            backend,
            optimizer: a.optimizer.map(Optimizer::from),
            iterations: a.iterations.map(|n| n as usize),
            starts: a.starts.map(|n| n as usize),
            batch: a.batch.map(|n| n as usize),
            seed: a.seed,
            tolerance: None,
            threads: a.threads.map(|n| n as usize),
            interrupt: console.interrupt.clone(),
            hurried: false,
            journal: Some((journal, resume)),
            tracked: from.to_vec(),
            on_stage: Some(&mut say),
            on_iteration: Some(&mut hear),
        },
    )
    .map_err(|e| e.with_kept(&folder.join(JOURNAL)))?;
    let track = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    may_write()?;
    if resume {
        make_room(track, console)?;
    }
    if !a.no_grid_check {
        track.at(UNITS, "looking at cells and step half as large");
        let _stage = Stage::begin("cells and step half as large");
        fitted.check_grid(experiments, backend, &console.interrupt);
    }
    may_write()?;
    let _stage = Stage::begin("results and report");
    let result = write_fit(folder, experiments, &fitted, backend)?;
    // Whoever interrupts does not want to wait for pictures, and a device that failed would make none.
    let pictures = if fitted.status() == FitStatus::Complete { a.pictures } else { 0 };
    write_report(folder, experiments, &fitted, &result, backend, pictures, command(scenes, from, a, &fitted))?;
    Ok((fitted, result))
}
