//! `palpate diagnose`: what a model lacks.

use crate::cli::{Console, INTERRUPTED};
use crate::diagnosing::checkpoint::CHECKPOINTS;
use crate::diagnosing::{DiagnoseOptions, Diagnosed, demand, diagnose};
use crate::engine::Backend;
use crate::error::Error;
use crate::events::Stage;
use crate::experiment::Experiment;
use crate::interrupt::{Clock, Interrupt};
use crate::options::{BackendName, out_folder};
use crate::report::{
    Compared, DiagnosisInput, FRAMES, Simulated, diagnosis_document, diagnosis_html, diagnosis_summary, diagnosis_title,
    report_data,
};
use crate::results;
use crate::results::diagnosis::DiagnosisDocument;
use crate::results::report::ReportData;
use clap::Args;
use palpate_engine::FailureKind;
use palpate_io::output::write_file;
use std::path::{Path, PathBuf};
use std::time::Duration;

const AFTER_HELP: &str = "\
Examples:
  palpate diagnose ball.toml                          result in out/ball-diagnosis/
  palpate diagnose ball.toml --held-out ball-2.toml   decide on a second recording of the same body
  palpate diagnose ball.toml --budget 10 --out why    answer within ten minutes and say what was not tried
  palpate diagnose ball.toml --out why --resume       go on with an interrupted diagnosis

The scene's [fit] says what is free in the baseline. The folder gets diagnosis.json (format diagnosis/2), model.toml (the scene with
the effects that were found, readable by simulate, fit and diagnose), report.html, and checkpoints. Ctrl-C writes what is known within
two seconds, and exits with 130.";

/// Find out whether a model lacks something, where, and what
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene files; several are diagnosed together
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    /// Output folder [default: out/SCENE-diagnosis]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    /// A scene with another recording of the same body, that no fit sees
    #[arg(long, value_name = "SCENE2")]
    held_out: Option<PathBuf>,
    /// Minutes that all of it may take, fit and report among it [default: no limit]
    #[arg(long, value_name = "MIN", allow_negative_numbers = true)]
    budget: Option<f64>,
    /// Go on with the checkpoints in the output folder
    #[arg(long)]
    resume: bool,
    /// Most frames that the report shows in space; 0: no motion is simulated for it
    #[arg(long, value_name = "N", default_value_t = FRAMES, hide_short_help = true)]
    pictures: usize,
}

fn command(a: &Arguments) -> String {
    let scenes = a.scenes.iter().map(|s| s.display().to_string()).collect::<Vec<_>>().join(" ");
    let held_out = a.held_out.as_ref().map_or(String::new(), |h| format!(" --held-out {}", h.display()));
    let budget = a.budget.map_or(String::new(), |b| format!(" --budget {b}"));
    format!("palpate diagnose {scenes}{held_out}{budget}")
}

fn write_all(
    a: &Arguments,
    folder: &Path,
    experiments: &[Experiment],
    done: &Diagnosed,
    backend: Backend,
    limits: &Interrupt,
) -> Result<DiagnosisDocument, Error> {
    let text = |name: &str, content: &str| write_file(folder.join(name), |w| w.write_all(content.as_bytes()));
    let result = diagnosis_document(done);
    // Results first: a report that fails must not cost them.
    results::write(folder.join("diagnosis.json"), &result)?;
    for (s, e) in experiments.iter().enumerate() {
        let changed = palpate_io::append_effects(e.text(), e.scene(), &done.added)?;
        let model = palpate_io::write_scene(&changed, done.experiments[s].scene(), &done.values[s], folder)?;
        let name = if experiments.len() == 1 { "model.toml".to_string() } else { format!("model-{}.toml", s + 1) };
        text(&name, &model)?;
    }
    // The page without motions, which take simulations: there may be no time for them.
    let page = |data| diagnosis_html(&DiagnosisInput { done, data, command: command(a) });
    text("report.html", &page(ReportData { title: diagnosis_title(&done.diagnosis).into(), ..ReportData::default() }))?;
    if let Some(data) = motions(a, experiments, done, backend, limits)? {
        text("report.html", &page(data))?;
    }
    Ok(result)
}

/// The motions of every scene before and after, beside what was measured; `None` where they were stopped.
fn motions(
    a: &Arguments,
    experiments: &[Experiment],
    done: &Diagnosed,
    backend: Backend,
    limits: &Interrupt,
) -> Result<Option<ReportData>, Error> {
    let d = &done.diagnosis;
    // Whoever interrupts does not want to wait, and neither does who has set a limit.
    if a.pictures == 0 || d.interrupted || limits.is_raised() {
        return Ok(None);
    }
    // A device that failed may fail again; the report needs none.
    let backend = if done.broken.is_some() { Backend::Cpu } else { backend };
    let both = experiments.iter().zip(&done.theta_before).zip(&done.experiments);
    let compared: Vec<Compared> = both
        .map(|((experiment, theta), after)| Compared {
            before: Some(Simulated { experiment, theta }),
            after: Some(Simulated { experiment: after, theta: &after.plan().theta }),
            experiment,
            noise: d.before.noise,
            rms: [Vec::new(), Vec::new()],
            // What the baseline lacks is what is to be seen.
            measure: 0,
        })
        .collect();
    match report_data(diagnosis_title(d), ["before", "after"], &compared, backend, a.pictures, &limits.at_once()) {
        Ok(data) => Ok(Some(data)),
        Err(Error::Simulation(f)) if f.kind == FailureKind::Stopped => Ok(None),
        Err(e) => Err(e),
    }
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    if let Some(b) = a.budget
        && !(b > 0.0 && b < 1e6)
    {
        return Err(Error::option("budget", b, "must be > 0 and below 1000000 (minutes)"));
    }
    let _stage = Stage::begin("diagnose");
    // Opening the scenes counts as well.
    let clock = Clock::start();
    let budget = a.budget.map(|m| Duration::from_secs_f64(60.0 * m));
    let folder = out_folder(&a.out, &a.scenes[0], "-diagnosis");
    crate::folder::check(&folder)?;
    let mut track = console.progress(0, "diagnosing");
    track.on(0, "reading");
    let experiments = a.scenes.iter().map(Experiment::open).collect::<Result<Vec<_>, _>>()?;
    let statistics = palpate_diagnose::Options::default();
    let (backend, note) = a.backend.choose_for(experiments[0].plan(), &demand(&experiments, &statistics)?, &mut track)?;
    let held_out = a.held_out.as_ref().map(Experiment::open).transpose()?;
    track.aside(|| {
        experiments.iter().chain(&held_out).for_each(|e| console.warn(e.warnings()));
        note.iter().for_each(|n| console.note(n));
    });
    let lock = crate::folder::take(&folder, console)?;
    console.interrupt.serve();
    console.interrupt = lock.guard(&console.interrupt);
    track.on(0, "the first evaluations");
    let mut hear = |what: &str| track.at(0, what);
    let done = diagnose(
        &experiments,
        held_out.as_ref(),
        DiagnoseOptions {
            backend,
            statistics,
            budget,
            clock: clock.clone(),
            interrupt: console.interrupt.clone(),
            checkpoints: Some((folder.clone(), a.resume)),
            on_progress: Some(&mut hear),
        },
    )
    .map_err(|e| e.with_kept(&folder.join(CHECKPOINTS)))?;
    track.finish();
    lock.check()?;
    let limits = budget.map_or_else(|| console.interrupt.clone(), |end| console.interrupt.until(&clock, end));
    let result = write_all(a, &folder, &experiments, &done, backend, &limits)?;
    if console.json() {
        console.print(&results::line(&result));
    } else {
        console.print(&diagnosis_summary(&done, &folder));
    }
    if let Some(why) = &done.broken {
        return Err(Error::BrokenOff { why: why.clone(), kept: "what was known by then", folder });
    }
    Ok(if done.diagnosis.interrupted { INTERRUPTED } else { 0 })
}
