//! `palpate batch`: many recordings, one after the other, none of which can stop the rest; on many machines, each of which takes a part.

mod merge;
mod scenes;
mod shard;
mod summary;

use crate::cli::{Console, INTERRUPTED};
use crate::commands::fit::{Choices, choose, run_in};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FNV_START, fingerprint, fnv1a};
use crate::lock::{Held, Lock, PATIENCE, Taken};
use crate::results;
use crate::results::batch::{BatchDocument, BatchRow, RowStatus, Shard, ShardSummary};
use crate::results::fit::{FitDocument, VerdictWord};
use clap::Args;
use palpate_io::output::{make_folder, write_file};
use shard::Asked;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

const AFTER_HELP: &str = "\
Examples:
  palpate batch scenes/ --out found             every scene (*.toml with format \"scene/1\") of a folder
  palpate batch a.toml b.toml --starts 8        some scenes
  palpate batch list.txt --out found --resume   the scenes a text file names, one a line; go on where it was interrupted
  palpate batch scenes/ --out found --resume --shard 2/3      the second of three parts, each on a machine of its own
  palpate batch scenes/ --out found --resume --shard auto/3   the part that a Slurm array (--array=1-3) or an indexed
                                                              Kubernetes job (completions: 3) says
  palpate batch --merge found                   one summary of all parts, and what is missing

Every scene is fitted by itself into OUT/NAME/, as by `palpate fit`, with its messages in fit.log. summary.csv and summary.json
(format batch/1) are written anew after every scene. A scene that cannot be read or computed is a row that says why; the others
go on. With --resume, scenes that are complete and have not changed are taken over.

Shard K of N (K from 1 to N) has the K-th scene of the list and every N-th after it. Its summary is OUT/shards/K-of-N.csv and
.json. A scene that another process fits at this time, on whichever machine, is left to it (docs/batch.md).

Exit codes: 0 all succeeded, 1 some did not, 2 nothing to do, 130 interrupted.";

/// Fit many recordings, one by one
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Folders with scenes, scene files, or text files that name one scene a line
    #[arg(required_unless_present = "merge", value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Output folder
    #[arg(long, value_name = "DIR", default_value = "out/batch")]
    out: PathBuf,
    /// Take over what an earlier run finished, and go on with what it began
    #[arg(long)]
    resume: bool,
    /// Fit a part of the scenes: K/N with K from 1 to N; auto or auto/N: K, or both, are what the variables of a Slurm array
    /// (SLURM_ARRAY_TASK_ID, …_COUNT) or of an indexed Kubernetes job (JOB_COMPLETION_INDEX) say [without a value: auto]
    #[arg(long, value_name = "K/N", value_parser = shard::parse, num_args = 0..=1, default_missing_value = "auto")]
    shard: Option<Asked>,
    /// Fit nothing: write OUT/summary.csv and summary.json from what the shards left in OUT, and name what is missing
    #[arg(long, value_name = "OUT", conflicts_with_all = ["paths", "resume", "shard"])]
    merge: Option<PathBuf>,
    #[command(flatten)]
    choices: Choices,
}

/// File in a scene's folder that says what its journal belongs to.
const MARK: &str = "fit.fingerprint";

/// What is said of a scene that an earlier run finished, before its warning if there was one.
const TAKEN_OVER: &str = "taken over";

/// What is said of a scene that was interrupted when it had something to keep.
const BEST_KEPT: &str = "the best so far is written; --resume goes on from there";

impl BatchRow {
    /// Of a scene with which nothing was done yet.
    fn begun(name: &str, scene: &Path) -> BatchRow {
        BatchRow {
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
        }
    }

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

/// A scene that was finished with this fingerprint: what is said of it, with the warning that it ended with, and its result.
fn finished(earlier: Option<&BatchRow>, folder: &Path, fingerprint: &str) -> Result<Option<(String, FitDocument)>, Error> {
    let Some(row) = earlier.filter(|r| r.fingerprint == fingerprint) else { return Ok(None) };
    let result = folder.join("result.json");
    if row.status != RowStatus::Complete || !result.exists() {
        return Ok(None);
    }
    let message = if row.message.is_empty() { TAKEN_OVER.into() } else { format!("{TAKEN_OVER}: {}", row.message) };
    Ok(Some((message, results::read(result)?)))
}

/// The row of a scene's folder. One that cannot be read is of no use, and is replaced.
fn row_in(folder: &Path, console: &mut Console) -> Option<BatchRow> {
    summary::row(folder).unwrap_or_else(|e| {
        console.warn(&[e.to_string()]);
        None
    })
}

/// What is said when a scene is read while somebody asks to stop.
const READING: &str = "the scene that was being read is not begun; what is complete stands in the summary";

/// Fits one scene under its lock; whatever goes wrong ends up in the row. Where another process has the lock, that is given back.
fn one(a: &Arguments, scene: &Path, name: &str, label: &str, console: &mut Console) -> Result<BatchRow, Held> {
    let clock = Instant::now();
    let mut row = BatchRow::begun(name, scene);
    let folder = a.out.join(name);
    let taken = make_folder(&folder).map_err(Error::from).and_then(|()| Lock::take(&folder, PATIENCE));
    let lock = match taken {
        Ok(Taken::Mine(lock)) => lock,
        Ok(Taken::Held(held)) => return Err(held),
        Err(e) => {
            row.message = e.to_string();
            return Ok(row);
        }
    };
    // Without --resume there was none when this run began: another process has finished the scene since.
    let earlier = row_in(&folder, console);
    let mut log = Vec::new();
    // A panic is a bug, but not a reason to lose the other scenes.
    let done = catch_unwind(AssertUnwindSafe(|| -> Result<Option<(String, FitDocument)>, Error> {
        // Before anything that takes time.
        let mut track = console.progress(0, label);
        track.on(0, "reading");
        console.interrupt.read(Some(lock.path().into()), READING);
        let experiment = Experiment::open(scene)?;
        let asked = format!("{:?} {:?}", a.choices.lasting(), experiment.scene().fit);
        row.fingerprint =
            format!("{} {:016x}", fingerprint(experiment.plan()), fnv1a(FNV_START, (asked + experiment.text()).as_bytes()));
        if let Some(done) = finished(earlier.as_ref(), &folder, &row.fingerprint)? {
            return Ok(Some(done));
        }
        let (backend, note) = choose(&a.choices, std::slice::from_ref(&experiment), &mut track)?;
        row.backend = Some(backend.name().into());
        let mut nothing = std::io::sink();
        let mut quiet = console.aside(&mut nothing, &mut log);
        quiet.interrupt = lock.guard(&console.interrupt);
        console.interrupt.serve();
        // The journal of another problem is of no use; it is moved aside with the results.
        let mark = folder.join(MARK);
        note.iter().for_each(|n| quiet.note(n));
        let resume = a.resume && std::fs::read_to_string(&mark).is_ok_and(|m| m == row.fingerprint);
        // From here on the folder holds no finished scene, whatever happens.
        summary::remove_row(&folder)?;
        write_file(&mark, |w| w.write_all(row.fingerprint.as_bytes()))?;
        let scenes = [scene.to_path_buf()];
        let experiments = std::slice::from_ref(&experiment);
        let may_write = || lock.check();
        let fitted = run_in(&scenes, &[], &a.choices, backend, experiments, &folder, resume, &may_write, &mut track, &mut quiet);
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
    console.interrupt.serve();
    match done {
        Ok(Ok(None)) => {}
        Ok(Ok(Some((message, result)))) => {
            (row.status, row.message, row.seconds) = (RowStatus::Complete, message, result.seconds);
            row.backend = Some(result.backend.clone());
            row.take(result);
            return Ok(row);
        }
        Ok(Err(e)) => {
            row.status = if e.is_interrupt() {
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
    if lock.is_lost() {
        (row.status, row.message) = (RowStatus::Busy, lock.loss());
        return Ok(row);
    }
    if row.status != RowStatus::Complete {
        log.extend_from_slice(format!("{}: {}\n", row.status.name(), row.message).as_bytes());
    }
    if let Err(e) = std::fs::write(folder.join("fit.log"), &log) {
        console.warn(&[format!("{}: {e}", folder.join("fit.log").display())]);
    }
    if let Err(e) = summary::write_row(&folder, &row) {
        console.warn(&[e.to_string()]);
    }
    Ok(row)
}

/// The scenes of this run, and what became of them so far.
struct Batch<'a> {
    a: &'a Arguments,
    shard: Option<Shard>,
    scenes: Vec<PathBuf>,
    /// Names of all scenes, also of those that other shards have.
    names: Vec<String>,
    /// Places of this run's scenes in the list.
    mine: Vec<usize>,
    /// What their folders held when this run began, where it goes on with that.
    before: BTreeMap<usize, BatchRow>,
    rows: BTreeMap<usize, BatchRow>,
}

impl<'a> Batch<'a> {
    fn begin(a: &'a Arguments, console: &mut Console) -> Result<Batch<'a>, Error> {
        let shard = a.shard.map(|asked| asked.shard(&|name| std::env::var(name).ok())).transpose()?;
        let scenes = scenes::scenes(&a.paths)?;
        let names = scenes::names(&scenes);
        let mine = shard.map_or_else(|| (0..scenes.len()).collect(), |s| s.part(scenes.len()));
        if let (Some(s), false) = (shard, a.resume)
            && let Some((file, other)) = summary::of_shards(&a.out)?.into_iter().find(|(_, other)| other.shard.of != s.of)
        {
            let message = format!(
                "{} is of {} shards; with --resume another number of shards takes over what those finished, else give another --out",
                file.display(),
                other.shard.of
            );
            return Err(Error::option("shard", s, message));
        }
        make_folder(&a.out)?;
        let mut before = BTreeMap::new();
        for &i in &mine {
            let folder = a.out.join(&names[i]);
            if a.resume {
                before.extend(row_in(&folder, console).map(|row| (i, row)));
            } else {
                summary::remove_row(&folder)?;
            }
        }
        Ok(Batch { a, shard, scenes, names, mine, before, rows: BTreeMap::new() })
    }

    /// The rows of this run, and those of an earlier one for scenes that this one has not reached yet, so that a run that ends here can be
    /// gone on with.
    fn summary(&self) -> BatchDocument {
        let rows = self.mine.iter().filter_map(|i| self.rows.get(i).or_else(|| self.before.get(i))).cloned().collect();
        let all = || self.names.clone();
        BatchDocument { shard: self.shard.map(|shard| ShardSummary { shard, all: all() }), ..BatchDocument::of(rows) }
    }

    fn write(&self) -> Result<(), Error> {
        let place = summary::place(&self.a.out, self.shard);
        if let Some(folder) = place.parent() {
            make_folder(folder)?;
        }
        summary::write(&place, &self.summary())
    }

    /// Number among this run's scenes, and name.
    fn label(&self, turn: usize) -> String {
        format!("{}/{} {}", turn + 1, self.mine.len(), self.names[self.mine[turn]])
    }

    fn one(&self, turn: usize, console: &mut Console) -> Result<BatchRow, Held> {
        let i = self.mine[turn];
        one(self.a, &self.scenes[i], &self.names[i], &self.label(turn), console)
    }

    /// Tells of a row, and writes the summary with it.
    fn add(&mut self, turn: usize, row: BatchRow, console: &mut Console) -> Result<(), Error> {
        let label = self.label(turn);
        console.note(&match row.status {
            RowStatus::Complete if row.message.starts_with(TAKEN_OVER) => format!("{label}: {TAKEN_OVER}"),
            RowStatus::Complete => format!("{label}: complete in {:.1} s{}", row.seconds, row.by()),
            other => format!("{label}: {} in {:.1} s{}: {}", other.name(), row.seconds, row.by(), row.message),
        });
        self.rows.insert(self.mine[turn], row);
        self.write()
    }

    /// A scene that another process had when it was its turn: until then it may have been finished, or its process have died.
    fn again(&self, turn: usize, console: &mut Console) -> Result<BatchRow, Error> {
        let (i, clock) = (self.mine[turn], Instant::now());
        let mut found = self.one(turn, console);
        if let Err(held) = &found {
            console.note(&format!("{}: waiting for a sign of life of {held}", self.label(turn)));
            if held.watch(&console.interrupt)? {
                found = self.one(turn, console);
            }
        }
        Ok(found.unwrap_or_else(|held| BatchRow {
            status: RowStatus::Busy,
            message: format!("{held} fits it"),
            seconds: clock.elapsed().as_secs_f64(),
            ..BatchRow::begun(&self.names[i], &self.scenes[i])
        }))
    }
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    if let Some(out) = &a.merge {
        return merge::run(out, console);
    }
    let mut batch = Batch::begin(a, console)?;
    if let Some(shard) = batch.shard {
        console.note(&format!("shard {shard}: {} of {} scenes", batch.mine.len(), batch.scenes.len()));
    }
    // So that others know of this shard, whatever happens to it.
    batch.write()?;
    let mut later = Vec::new();
    for turn in 0..batch.mine.len() {
        if console.interrupt.is_raised() {
            break;
        }
        match batch.one(turn, console) {
            Ok(row) => batch.add(turn, row, console)?,
            Err(held) => {
                console.note(&format!("{}: left to {held}", batch.label(turn)));
                later.push(turn);
            }
        }
    }
    for turn in later {
        if console.interrupt.is_raised() {
            break;
        }
        let row = batch.again(turn, console)?;
        batch.add(turn, row, console)?;
    }
    let rows = &batch.rows;
    if console.json() {
        console.print(&results::line(&batch.summary()));
    } else {
        let complete = rows.values().filter(|r| r.status == RowStatus::Complete).count();
        let place = summary::place(&a.out, batch.shard).with_extension("csv");
        console.print(&format!("{complete} of {} scenes complete: {}", batch.mine.len(), place.display()));
    }
    let interrupted = console.interrupt.is_raised() || rows.values().any(|r| r.status == RowStatus::Interrupted);
    Ok(match rows.values().all(|r| r.status == RowStatus::Complete) {
        _ if interrupted => INTERRUPTED,
        true => 0,
        false => 1,
    })
}
