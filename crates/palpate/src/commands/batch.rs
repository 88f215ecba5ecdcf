//! `palpate batch`: many recordings, one after the other, none of which can stop the rest.

use crate::cli::{Console, INTERRUPTED};
use crate::commands::fit::{Choices, choose, run_in};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FNV_START, fingerprint, fnv1a};
use crate::options::stem;
use crate::results;
use crate::results::batch::{BatchDocument, BatchRow, RowStatus};
use crate::results::fit::{FitDocument, VerdictWord};
use clap::Args;
use palpate_io::InputError;
use palpate_io::output::{make_folder, write_file};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

const AFTER_HELP: &str = "\
Examples:
  palpate batch scenes/ --out found             every scene (*.toml with format \"scene/1\") of a folder
  palpate batch a.toml b.toml --starts 8        some scenes
  palpate batch list.txt --out found --resume   the scenes a text file names, one a line; go on where it was interrupted

Every scene is fitted by itself into OUT/NAME/, as by `palpate fit`, with its messages in fit.log. summary.csv and summary.json
(format batch/1) are written anew after every scene. A scene that cannot be read or computed is a row that says why; the others
go on. With --resume, scenes that are complete and have not changed are taken over. Exit codes: 0 all succeeded, 1 some did
not, 2 nothing to do, 130 interrupted.";

/// Fit many recordings, one by one
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Folders with scenes, scene files, or text files that name one scene a line
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Output folder
    #[arg(long, value_name = "DIR", default_value = "out/batch")]
    out: PathBuf,
    /// Take over what an earlier run finished, and go on with what it began
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    choices: Choices,
}

/// File that says what became of every scene.
const SUMMARY: &str = "summary.json";

/// File in a scene's folder that says what its journal belongs to.
const MARK: &str = "fit.fingerprint";

/// What is said of a scene that an earlier run finished, before its warning if there was one.
const TAKEN_OVER: &str = "taken over";

/// What is said of a scene that was interrupted when it had something to keep.
const BEST_KEPT: &str = "the best so far is written; --resume goes on from there";

impl BatchRow {
    /// What computed it, in brackets behind the time that it took.
    fn by(&self) -> String {
        self.backend.as_ref().map_or(String::new(), |b| format!(" ({b})"))
    }

    /// Takes what a fit found.
    fn take(&mut self, found: FitDocument) {
        self.parameters = Some(found.parameters);
        self.cost = found.cost.last;
        self.residual = Some(found.residual);
    }
}

fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| unreadable(path, &e))
}

fn unreadable(path: &Path, cause: &std::io::Error) -> Error {
    InputError::file(path, format!("cannot be read: {cause}")).into()
}

/// The scenes that the arguments name: folders in the order of names, lists in the order of lines.
fn scenes(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut out = Vec::new();
    for path in paths {
        if path.is_dir() {
            let list = std::fs::read_dir(path).map_err(|e| unreadable(path, &e))?;
            let files: BTreeSet<PathBuf> = list.filter_map(|f| Some(f.ok()?.path())).collect();
            let toml = files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "toml"));
            // Other TOML files (recordings, settings) may lie beside the scenes; one that cannot be read is reported later.
            let before = out.len();
            out.extend(toml.filter(|f| std::fs::read_to_string(f).map_or(true, |t| t.contains("\"scene/1\""))));
            if out.len() == before {
                return Err(InputError::file(path, "holds no scene (*.toml with format = \"scene/1\")").into());
            }
        } else if path.extension().is_some_and(|e| e == "toml") {
            out.push(path.clone());
        } else {
            let folder = path.parent().unwrap_or(Path::new(""));
            let lines = read(path)?;
            let named = lines.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
            let before = out.len();
            out.extend(named.map(|l| folder.join(l)));
            if out.len() == before {
                return Err(InputError::file(path, "names no scene; one path a line is expected").into());
            }
        }
    }
    Ok(out)
}

/// A folder name per scene: its file's name, numbered where two are the same.
fn names(scenes: &[PathBuf]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let free = |s: &PathBuf| {
        let name = stem(s);
        let numbered = |n: usize| if n == 1 { name.clone() } else { format!("{name}-{n}") };
        (1..).map(numbered).find(|n| taken.insert(n.clone())).expect("some number is free")
    };
    scenes.iter().map(free).collect()
}

/// Rows of an earlier run's summary, of which this run is a continuation; none where there is no such summary.
fn earlier(out: &Path) -> Result<Vec<BatchRow>, Error> {
    let path = out.join(SUMMARY);
    if !path.exists() {
        return Ok(Vec::new());
    }
    Ok(results::read::<BatchDocument>(path)?.scenes)
}

/// A finished scene of an earlier run with the same fingerprint: what is said of it, with the warning that it ended with, and its result.
fn finished(earlier: &[BatchRow], out: &Path, name: &str, fingerprint: &str) -> Result<Option<(String, FitDocument)>, Error> {
    let Some(row) = earlier.iter().find(|r| r.name == name && r.fingerprint == fingerprint) else { return Ok(None) };
    let result = out.join(name).join("result.json");
    if row.status != RowStatus::Complete || !result.exists() {
        return Ok(None);
    }
    let message = match row.message.as_str() {
        "" => TAKEN_OVER.into(),
        again if again.starts_with(TAKEN_OVER) => again.into(),
        warning => format!("{TAKEN_OVER}: {warning}"),
    };
    Ok(Some((message, results::read(result)?)))
}

/// Fits one scene; whatever goes wrong ends up in the row.
fn one(a: &Arguments, earlier: &[BatchRow], scene: &Path, name: &str, label: &str, console: &mut Console) -> BatchRow {
    let clock = Instant::now();
    let mut row = BatchRow {
        name: name.to_string(),
        scene: scene.display().to_string(),
        status: RowStatus::Failed,
        message: String::new(),
        seconds: 0.0,
        backend: None,
        fingerprint: String::new(),
        parameters: None,
        cost: None,
        residual: None,
    };
    let folder = a.out.join(name);
    let mut log = Vec::new();
    // A panic is a bug, but not a reason to lose the other scenes.
    let done = catch_unwind(AssertUnwindSafe(|| -> Result<Option<(String, FitDocument)>, Error> {
        // Before anything that takes time.
        let mut track = console.progress(0, label);
        track.on(0, "reading");
        let experiment = Experiment::open(scene)?;
        let asked = format!("{:?} {:?}", a.choices.lasting(), experiment.scene().fit);
        row.fingerprint =
            format!("{} {:016x}", fingerprint(experiment.plan()), fnv1a(FNV_START, (asked + experiment.text()).as_bytes()));
        if let Some(done) = finished(earlier, &a.out, name, &row.fingerprint)? {
            return Ok(Some(done));
        }
        let (backend, note) = choose(&a.choices, std::slice::from_ref(&experiment), &mut track)?;
        row.backend = Some(backend.name().into());
        let mut nothing = std::io::sink();
        let mut quiet = console.aside(&mut nothing, &mut log);
        // The journal of another problem is of no use; it is moved aside with the results.
        let mark = folder.join(MARK);
        note.iter().for_each(|n| quiet.note(n));
        let resume = a.resume && std::fs::read_to_string(&mark).is_ok_and(|m| m == row.fingerprint);
        make_folder(&folder)?;
        write_file(&mark, |w| w.write_all(row.fingerprint.as_bytes()))?;
        let scenes = [scene.to_path_buf()];
        let fitted =
            run_in(&scenes, &a.choices, backend, std::slice::from_ref(&experiment), &folder, resume, &mut track, &mut quiet);
        track.finish();
        let (fitted, result) = fitted?;
        quiet.warn(&fitted.warnings);
        (row.status, row.message) = match (fitted.result.broken, fitted.interrupted) {
            (Some(why), _) => (RowStatus::Failed, why),
            (None, true) => (RowStatus::Interrupted, BEST_KEPT.into()),
            (None, false) if result.verdict.word != VerdictWord::Converged => (RowStatus::Complete, result.verdict.to_string()),
            (None, false) => (RowStatus::Complete, fitted.warnings.into_iter().next().unwrap_or_default()),
        };
        row.take(result);
        Ok(None)
    }));
    match done {
        Ok(Ok(None)) => {}
        Ok(Ok(Some((message, result)))) => {
            (row.status, row.message, row.seconds) = (RowStatus::Complete, message, result.seconds);
            row.backend = Some(result.backend.clone());
            row.take(result);
            return row;
        }
        Ok(Err(e)) => {
            row.status = if matches!(e, Error::Interrupted) {
                RowStatus::Interrupted
            } else if e.exit_code() == 2 {
                RowStatus::BadInput
            } else {
                RowStatus::Failed
            };
            row.message = e.to_string();
        }
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned().or(panic.downcast_ref::<&str>().map(|s| s.to_string()));
            row.message = format!("internal error: {}", text.unwrap_or_else(|| "unknown".into()));
        }
    }
    row.seconds = clock.elapsed().as_secs_f64();
    if row.status != RowStatus::Complete {
        log.extend_from_slice(format!("{}: {}\n", row.status.name(), row.message).as_bytes());
    }
    if folder.is_dir()
        && let Err(e) = std::fs::write(folder.join("fit.log"), &log)
    {
        console.warn(&[format!("{}: {e}", folder.join("fit.log").display())]);
    }
    row
}

/// The rows of this run, and those of the earlier one for scenes that this one has not reached yet, so that a run that ends here can be
/// gone on with.
fn summary(rows: &[BatchRow], earlier: &[BatchRow], ahead: &[String]) -> BatchDocument {
    let kept = ahead.iter().filter_map(|name| earlier.iter().find(|r| r.name == *name));
    BatchDocument::of(rows.iter().chain(kept).cloned().collect())
}

/// `summary.csv`: one row a scene, two columns a parameter (value and standard error), over the parameters of all scenes.
fn table(summary: &BatchDocument) -> String {
    let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
    let parameters = |r: &BatchRow| r.parameters.clone().unwrap_or_default();
    let mut paths: Vec<String> = Vec::new();
    for p in summary.scenes.iter().flat_map(parameters) {
        if !paths.contains(&p.path) {
            paths.push(p.path);
        }
    }
    let mut csv = csv::Writer::from_writer(Vec::new());
    let mut head =
        ["name", "scene", "status", "seconds", "backend", "cost", "rms", "noise", "points"].map(str::to_string).to_vec();
    head.extend(paths.iter().flat_map(|p| [p.clone(), format!("{p} standard error")]));
    head.push("message".into());
    csv.write_record(&head).expect("writing to memory cannot fail");
    for r in &summary.scenes {
        let residual = r.residual.as_ref();
        let mut row = vec![r.name.clone(), r.scene.clone(), r.status.name().into(), number(Some(r.seconds))];
        row.extend([r.backend.clone().unwrap_or_default(), number(r.cost)]);
        row.extend([number(residual.and_then(|r| r.rms)), number(residual.and_then(|r| r.noise))]);
        row.push(residual.map_or(String::new(), |r| r.points.to_string()));
        for path in &paths {
            let found = parameters(r).into_iter().find(|p| p.path == *path).unwrap_or_default();
            row.extend([number(found.value), number(found.standard_error)]);
        }
        row.push(r.message.clone());
        csv.write_record(&row).expect("writing to memory cannot fail");
    }
    String::from_utf8(csv.into_inner().expect("writing to memory cannot fail")).expect("names and numbers are UTF-8")
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let scenes = scenes(&a.paths)?;
    make_folder(&a.out)?;
    let names = names(&scenes);
    let earlier = if a.resume { earlier(&a.out)? } else { Vec::new() };
    let mut rows: Vec<BatchRow> = Vec::new();
    let mut all = BatchDocument::default();
    for (i, (scene, name)) in scenes.iter().zip(&names).enumerate() {
        if console.interrupt.is_raised() {
            break;
        }
        let label = format!("{}/{} {name}", i + 1, scenes.len());
        let row = one(a, &earlier, scene, name, &label, console);
        console.note(&match row.status {
            RowStatus::Complete if row.message.starts_with(TAKEN_OVER) => format!("{label}: {TAKEN_OVER}"),
            RowStatus::Complete => format!("{label}: complete in {:.1} s{}", row.seconds, row.by()),
            other => format!("{label}: {} in {:.1} s{}: {}", other.name(), row.seconds, row.by(), row.message),
        });
        rows.push(row);
        all = summary(&rows, &earlier, &names[i + 1..]);
        results::write(a.out.join(SUMMARY), &all)?;
        write_file(a.out.join("summary.csv"), |w| w.write_all(table(&all).as_bytes()))?;
    }
    if console.json() {
        console.print(&results::line(&all));
    } else {
        let complete = rows.iter().filter(|r| r.status == RowStatus::Complete).count();
        let place = a.out.join("summary.csv");
        console.print(&format!("{complete} of {} scenes complete: {}", scenes.len(), place.display()));
    }
    let interrupted = console.interrupt.is_raised() || rows.iter().any(|r| r.status == RowStatus::Interrupted);
    Ok(match rows.iter().all(|r| r.status == RowStatus::Complete) {
        _ if interrupted => INTERRUPTED,
        true => 0,
        false => 1,
    })
}
