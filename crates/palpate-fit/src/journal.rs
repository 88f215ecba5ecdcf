//! A journal of evaluations, so that an interrupted fit goes on exactly where it stopped.
//!
//! Optimisers are deterministic; a resumed fit runs them again from the start and takes evaluations from the journal until it
//! runs out. Line 1 describes the problem, every further line holds one round of evaluations (JSON; numbers as the 16 hex
//! digits of their bits, so that they come back exactly). A last line without its end is what a crash leaves, and is ignored.

use crate::optimise::Sample;
use crate::problem::Problem;
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

const FORMAT: &str = "palpate-journal/1";

/// Keys of line 1 and what is said where they are not those of the fit.
const HEAD: [(&str, &str); 5] = [
    ("optimizer", "its optimizer differs"),
    ("seed", "its seed differs"),
    ("options", "its steps or tolerances differ"),
    ("parameters", "its free parameters differ"),
    ("scenes", "its scenes or recordings differ"),
];

/// Where a fit keeps its journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalFile {
    /// The file; its folder must exist.
    pub path: PathBuf,
    /// Go on with what the file holds (if it exists); otherwise start it anew.
    pub resume: bool,
}

/// Why a journal cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file could not be read or written.
    #[error("{}: {error}", path.display())]
    Io {
        /// The journal.
        path: PathBuf,
        /// What went wrong.
        error: io::Error,
    },
    /// The file is not a journal, or belongs to another problem.
    #[error("{}, line {line}: {message}", path.display())]
    Content {
        /// The journal.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong and what can be done.
        message: String,
    },
}

/// One evaluation: which start, its how-maniest, where, and what came out.
#[derive(Serialize, Deserialize)]
struct Entry {
    start: usize,
    evaluation: usize,
    z: String,
    cost: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    gradient: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    curvature: String,
    residuals: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    failure: Option<String>,
}

fn to_hex(values: &[f64]) -> String {
    values.iter().map(|v| format!("{:016x}", v.to_bits())).collect()
}

fn from_hex(text: &str) -> Option<Vec<f64>> {
    if !text.is_ascii() || !text.len().is_multiple_of(16) {
        return None;
    }
    let number = |k: usize| u64::from_str_radix(&text[16 * k..16 * k + 16], 16).ok().map(f64::from_bits);
    (0..text.len() / 16).map(number).collect()
}

/// An open journal.
pub struct Journal {
    path: PathBuf,
    file: File,
    entries: BTreeMap<(usize, usize), (Vec<f64>, Sample, usize)>,
}

impl Journal {
    /// Opens the journal of a problem: new, or with the evaluations of an earlier run of the same problem.
    pub fn open(place: &JournalFile, problem: &Problem, settings: &Settings) -> Result<Journal, JournalError> {
        let path = place.path.clone();
        let io = |error| JournalError::Io { path: path.clone(), error };
        let head = describe(problem, settings);
        let mut entries = BTreeMap::new();
        let mut keep = 0;
        if place.resume && path.exists() {
            let text = std::fs::read(&path).map_err(io)?;
            keep = text.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
            entries = read(&path, &String::from_utf8_lossy(&text[..keep]), &head, problem.free().len())?;
        }
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(io)?;
        file.set_len(keep as u64).map_err(io)?;
        let mut journal = Journal { path: path.clone(), file, entries };
        io::Seek::seek(&mut journal.file, io::SeekFrom::End(0)).map_err(io)?;
        if keep == 0 {
            writeln!(journal.file, "{head}").map_err(io)?;
        }
        Ok(journal)
    }

    /// The recorded result of one evaluation; an error if it was made at another point.
    pub fn find(&mut self, start: usize, evaluation: usize, z: &[f64]) -> Result<Option<Sample>, JournalError> {
        let Some((at, sample, line)) = self.entries.remove(&(start, evaluation)) else { return Ok(None) };
        if to_hex(&at) != to_hex(z) {
            let message = format!(
                "evaluation {evaluation} of start {start} was made at another point; the journal comes from other options or \
                 another version: fit without resuming"
            );
            return Err(JournalError::Content { path: self.path.clone(), line, message });
        }
        Ok(Some(sample))
    }

    /// Appends a round of evaluations (start, number, z, result) as one line. None of them may be [broken](Sample::broken): a resumed
    /// fit would take the failure for the point's.
    pub fn add(&mut self, round: &[(usize, usize, &[f64], &Sample)]) -> Result<(), JournalError> {
        let entries: Vec<Entry> = round
            .iter()
            .map(|(start, evaluation, z, sample)| Entry {
                start: *start,
                evaluation: *evaluation,
                z: to_hex(z),
                cost: to_hex(&[sample.cost]),
                gradient: to_hex(&sample.gradient),
                curvature: to_hex(&sample.curvature),
                residuals: sample.residuals,
                failure: sample.failure.clone(),
            })
            .collect();
        let line = json!({ "round": entries }).to_string() + "\n";
        self.file.write_all(line.as_bytes()).map_err(|error| JournalError::Io { path: self.path.clone(), error })
    }
}

/// What must be equal for evaluations to be exchangeable. Limits that only end a run earlier or later are left out, so that
/// a fit can be resumed with more iterations or starts.
fn describe(problem: &Problem, settings: &Settings) -> Value {
    let parameters: Vec<Value> = problem
        .free()
        .iter()
        .map(|f| {
            let slots: Vec<Value> = f.slots.iter().map(|s| json!([s.scene, s.place, to_hex(&[s.factor])])).collect();
            json!({
                "path": f.path,
                "transform": format!("{:?}", f.transform),
                "typical": f.typical,
                "bounds": [f.bounds.0.to_string(), f.bounds.1.to_string()],
                "start": [f.start.0, f.start.1],
                "slots": slots,
            })
        })
        .collect();
    let scenes: Vec<Value> =
        problem.scenes().iter().map(|s| json!({ "fingerprint": s.fingerprint, "theta": to_hex(&s.base) })).collect();
    let steps = json!([
        settings.max_step,
        settings.first_step.to_string(),
        format!("{:?}", settings.rprop),
        format!("{:?}", settings.tolerance)
    ]);
    json!({
        "format": FORMAT,
        "optimizer": format!("{:?}", settings.optimizer),
        "seed": settings.seed,
        "options": steps,
        "parameters": parameters,
        "scenes": scenes,
    })
}

type Entries = BTreeMap<(usize, usize), (Vec<f64>, Sample, usize)>;

fn read(path: &Path, text: &str, head: &Value, q: usize) -> Result<Entries, JournalError> {
    let wrong = |line: usize, message: String| JournalError::Content { path: path.to_path_buf(), line, message };
    let mut entries = BTreeMap::new();
    for (k, text) in text.lines().enumerate() {
        let line = k + 1;
        let value: Value = serde_json::from_str(text).map_err(|e| wrong(line, format!("not a line of a fit's journal ({e})")))?;
        if line == 1 {
            if value.get("format").and_then(Value::as_str) != Some(FORMAT) {
                return Err(wrong(line, format!("not a fit's journal; its first line would name the format {FORMAT}")));
            }
            if let Some((_, what)) = HEAD.into_iter().find(|(key, _)| value.get(key) != head.get(key)) {
                let message = format!(
                    "the journal belongs to another fit ({what}); give the same scene, recording and options, or fit without \
                     resuming"
                );
                return Err(wrong(line, message));
            }
            continue;
        }
        let round = value.get("round").cloned().unwrap_or(Value::Null);
        let round: Vec<Entry> =
            serde_json::from_value(round).map_err(|e| wrong(line, format!("not a round of evaluations ({e})")))?;
        for e in round {
            let sample = (|| {
                let (z, cost) = (from_hex(&e.z)?, from_hex(&e.cost)?);
                let (gradient, curvature) = (from_hex(&e.gradient)?, from_hex(&e.curvature)?);
                let sizes =
                    z.len() == q && cost.len() == 1 && [0, q].contains(&gradient.len()) && [0, q * q].contains(&curvature.len());
                let residuals = e.residuals;
                sizes.then(|| {
                    (
                        z,
                        Sample {
                            cost: cost[0],
                            gradient,
                            curvature,
                            residuals,
                            failure: e.failure.clone(),
                            broken: false,
                            stopped: false,
                        },
                    )
                })
            })();
            let Some((z, sample)) = sample else {
                return Err(wrong(line, format!("evaluation {} of start {} is damaged", e.evaluation, e.start)));
            };
            entries.insert((e.start, e.evaluation), (z, sample, line));
        }
    }
    Ok(entries)
}
