//! `palpate batch`: many recordings, one after the other, none of which can stop the rest.

use crate::cli::{Console, INTERRUPTED};
use crate::commands::fit::{Choices, choose, rounds, run_in};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FNV_START, fingerprint, fnv1a};
use crate::options::stem;
use clap::Args;
use palpate_io::output::{make_folder, write_file};
use serde_json::{Value, json};
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

/// File in a scene's folder that says what its journal belongs to.
const MARK: &str = "fit.fingerprint";

/// What is said of a scene that an earlier run finished, before its warning if there was one.
const TAKEN_OVER: &str = "taken over";

/// What is said of a scene that was interrupted when it had something to keep.
const BEST_KEPT: &str = "the best so far is written; --resume goes on from there";

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    Complete,
    Interrupted,
    BadInput,
    Failed,
}

impl Status {
    fn name(self) -> &'static str {
        match self {
            Status::Complete => "complete",
            Status::Interrupted => "interrupted",
            Status::BadInput => "bad-input",
            Status::Failed => "failed",
        }
    }
}

/// One row of the summary.
struct Row {
    scene: PathBuf,
    name: String,
    status: Status,
    message: String,
    seconds: f64,
    /// What computed it; empty where it did not come to that.
    backend: String,
    /// What was fitted and how; a later run takes the result over when it is the same.
    fingerprint: String,
    /// `result.json`.
    result: Value,
}

impl Row {
    /// What computed it, in brackets behind the time that it took.
    fn by(&self) -> String {
        if self.backend.is_empty() { String::new() } else { format!(" ({})", self.backend) }
    }
}

fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|e| Error::Input(format!("{}: cannot be read: {e}", path.display())))
}

/// The scenes that the arguments name: folders in the order of names, lists in the order of lines.
fn scenes(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut out = Vec::new();
    for path in paths {
        if path.is_dir() {
            let list = std::fs::read_dir(path).map_err(|e| Error::Input(format!("{}: cannot be read: {e}", path.display())))?;
            let files: BTreeSet<PathBuf> = list.filter_map(|f| Some(f.ok()?.path())).collect();
            let toml = files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "toml"));
            // Other TOML files (recordings, settings) may lie beside the scenes; one that cannot be read is reported later.
            let before = out.len();
            out.extend(toml.filter(|f| std::fs::read_to_string(f).map_or(true, |t| t.contains("\"scene/1\""))));
            if out.len() == before {
                return Err(Error::Input(format!("{}: holds no scene (*.toml with format = \"scene/1\")", path.display())));
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
                return Err(Error::Input(format!("{}: names no scene; one path a line is expected", path.display())));
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
fn earlier(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("summary.json")).unwrap_or_default();
    let summary: Value = serde_json::from_str(&text).unwrap_or(Value::Null);
    summary["scenes"].as_array().cloned().unwrap_or_default()
}

/// A finished scene of an earlier run with the same fingerprint: what is said of it, with the warning that it ended with, and its result.
fn finished(earlier: &[Value], out: &Path, name: &str, fingerprint: &str) -> Option<(String, Value)> {
    let row = earlier.iter().find(|r| r["name"] == name && r["fingerprint"] == fingerprint)?;
    if row["status"] != Status::Complete.name() {
        return None;
    }
    let result = serde_json::from_str(&std::fs::read_to_string(out.join(name).join("result.json")).ok()?).ok()?;
    let said = row["message"].as_str().unwrap_or_default();
    let message = match said {
        "" => TAKEN_OVER.into(),
        again if again.starts_with(TAKEN_OVER) => again.into(),
        warning => format!("{TAKEN_OVER}: {warning}"),
    };
    Some((message, result))
}

/// Fits one scene; whatever goes wrong ends up in the row.
fn one(a: &Arguments, earlier: &[Value], scene: &Path, name: &str, label: &str, console: &mut Console) -> Row {
    let clock = Instant::now();
    let mut row = Row {
        scene: scene.to_path_buf(),
        name: name.to_string(),
        status: Status::Failed,
        message: String::new(),
        seconds: 0.0,
        backend: String::new(),
        fingerprint: String::new(),
        result: Value::Null,
    };
    let folder = a.out.join(name);
    let mut log = Vec::new();
    // A panic is a bug, but not a reason to lose the other scenes.
    let done = catch_unwind(AssertUnwindSafe(|| -> Result<Option<(String, Value)>, Error> {
        let experiment = Experiment::open(scene)?;
        let asked = format!("{:?} {:?}", a.choices.lasting(), experiment.scene().fit);
        row.fingerprint =
            format!("{} {:016x}", fingerprint(experiment.plan()), fnv1a(FNV_START, (asked + experiment.text()).as_bytes()));
        if let Some(done) = finished(earlier, &a.out, name, &row.fingerprint) {
            return Ok(Some(done));
        }
        let (backend, note) = choose(&a.choices, std::slice::from_ref(&experiment))?;
        row.backend = backend.name().into();
        let mut track = console.progress(rounds(&a.choices, &experiment), label);
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
            (Some(why), _) => (Status::Failed, why),
            (None, true) => (Status::Interrupted, BEST_KEPT.into()),
            (None, false) => (Status::Complete, fitted.warnings.into_iter().next().unwrap_or_default()),
        };
        row.result = result;
        Ok(None)
    }));
    match done {
        Ok(Ok(None)) => {}
        Ok(Ok(Some((message, result)))) => {
            row.seconds = result["seconds"].as_f64().unwrap_or(0.0);
            row.backend = result["backend"].as_str().unwrap_or_default().into();
            (row.status, row.message, row.result) = (Status::Complete, message, result);
            return row;
        }
        Ok(Err(e)) => {
            row.status = if e == Error::Interrupted {
                Status::Interrupted
            } else if e.exit_code() == 2 {
                Status::BadInput
            } else {
                Status::Failed
            };
            row.message = e.to_string();
        }
        Err(panic) => {
            let text = panic.downcast_ref::<String>().cloned().or(panic.downcast_ref::<&str>().map(|s| s.to_string()));
            row.message = format!("internal error: {}", text.unwrap_or_else(|| "unknown".into()));
        }
    }
    row.seconds = clock.elapsed().as_secs_f64();
    if row.status != Status::Complete {
        log.extend_from_slice(format!("{}: {}\n", row.status.name(), row.message).as_bytes());
    }
    if folder.is_dir()
        && let Err(e) = std::fs::write(folder.join("fit.log"), &log)
    {
        console.warn(&[format!("{}: {e}", folder.join("fit.log").display())]);
    }
    row
}

/// A row of `summary.json`.
fn entry(r: &Row) -> Value {
    json!({
        "name": r.name, "scene": r.scene.display().to_string(), "status": r.status.name(), "message": r.message,
        "seconds": r.seconds, "backend": Some(&r.backend).filter(|b| !b.is_empty()), "fingerprint": r.fingerprint,
        "parameters": r.result["parameters"], "cost": r.result["cost"]["final"], "residual": r.result["residual"],
    })
}

/// `summary.json`: the rows of this run, and those of the earlier one for scenes that this one has not reached yet, so that a run
/// that ends here can be gone on with.
fn summary(rows: &[Row], earlier: &[Value], ahead: &[String]) -> Value {
    let kept = ahead.iter().filter_map(|name| earlier.iter().find(|r| r["name"] == name.as_str()));
    let scenes: Vec<Value> = rows.iter().map(entry).chain(kept.cloned()).collect();
    let count = |s: Status| scenes.iter().filter(|r| r["status"] == s.name()).count();
    json!({
        "format": "batch/1", "scenes": scenes, "complete": count(Status::Complete),
        "bad_input": count(Status::BadInput), "failed": count(Status::Failed), "interrupted": count(Status::Interrupted),
    })
}

/// `summary.csv`: one row a scene, two columns a parameter (value and standard error), over the parameters of all scenes.
fn table(summary: &Value) -> String {
    let list = |v: &Value| v.as_array().cloned().unwrap_or_default();
    let text = |v: &Value| v.as_str().map_or_else(|| if v.is_null() { String::new() } else { v.to_string() }, str::to_string);
    let rows = list(&summary["scenes"]);
    let mut paths: Vec<String> = Vec::new();
    for p in rows.iter().flat_map(|r| list(&r["parameters"])) {
        let path = text(&p["path"]);
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    let mut csv = csv::Writer::from_writer(Vec::new());
    let mut head =
        ["name", "scene", "status", "seconds", "backend", "cost", "rms", "noise", "points"].map(str::to_string).to_vec();
    head.extend(paths.iter().flat_map(|p| [p.clone(), format!("{p} standard error")]));
    head.push("message".into());
    csv.write_record(&head).expect("writing to memory cannot fail");
    for r in &rows {
        let of = &r["residual"];
        let fixed = [
            &r["name"],
            &r["scene"],
            &r["status"],
            &r["seconds"],
            &r["backend"],
            &r["cost"],
            &of["rms"],
            &of["noise"],
            &of["points"],
        ];
        let mut row: Vec<String> = fixed.into_iter().map(&text).collect();
        for path in &paths {
            let p = list(&r["parameters"]).into_iter().find(|p| p["path"] == path.as_str()).unwrap_or(Value::Null);
            row.extend([text(&p["value"]), text(&p["standard_error"])]);
        }
        row.push(text(&r["message"]));
        csv.write_record(&row).expect("writing to memory cannot fail");
    }
    String::from_utf8(csv.into_inner().expect("writing to memory cannot fail")).expect("names and numbers are UTF-8")
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let scenes = scenes(&a.paths)?;
    make_folder(&a.out)?;
    let names = names(&scenes);
    let earlier = if a.resume { earlier(&a.out) } else { Vec::new() };
    let mut rows: Vec<Row> = Vec::new();
    let mut all = Value::Null;
    for (i, (scene, name)) in scenes.iter().zip(&names).enumerate() {
        if console.interrupt.is_raised() {
            break;
        }
        let label = format!("{}/{} {name}", i + 1, scenes.len());
        let row = one(a, &earlier, scene, name, &label, console);
        console.note(&match row.status {
            Status::Complete if row.message.starts_with(TAKEN_OVER) => format!("{label}: {TAKEN_OVER}"),
            Status::Complete => format!("{label}: complete in {:.1} s{}", row.seconds, row.by()),
            other => format!("{label}: {} in {:.1} s{}: {}", other.name(), row.seconds, row.by(), row.message),
        });
        rows.push(row);
        all = summary(&rows, &earlier, &names[i + 1..]);
        let text = serde_json::to_string_pretty(&all).map_err(|e| Error::write(&a.out, e))? + "\n";
        write_file(a.out.join("summary.json"), |w| w.write_all(text.as_bytes()))?;
        write_file(a.out.join("summary.csv"), |w| w.write_all(table(&all).as_bytes()))?;
    }
    if console.json() {
        console.print(&all.to_string());
    } else {
        let complete = rows.iter().filter(|r| r.status == Status::Complete).count();
        let place = a.out.join("summary.csv");
        console.print(&format!("{complete} of {} scenes complete: {}", scenes.len(), place.display()));
    }
    let interrupted = console.interrupt.is_raised() || rows.iter().any(|r| r.status == Status::Interrupted);
    Ok(match rows.iter().all(|r| r.status == Status::Complete) {
        _ if interrupted => INTERRUPTED,
        true => 0,
        false => 1,
    })
}
