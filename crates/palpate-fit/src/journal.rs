//! A journal of evaluations, so that an interrupted fit goes on exactly where it stopped.
//!
//! Optimisers are deterministic; a resumed fit runs them again from the start and takes evaluations from the journal until it
//! runs out. Line 1 describes the problem, every further line holds one round of evaluations (JSON; numbers as the 16 hex
//! digits of their bits, so that they come back exactly). A last line without its end is what a crash leaves, and is ignored.

use crate::optimise::Sample;
use crate::priors::choose::Choice;
use crate::priors::{FieldPrior, Hyper, Tried};
use crate::problem::{FitScene, FreeParameter, Problem};
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

const FORMAT: &str = "palpate-journal/1";

/// Beginning of line 1.
#[derive(Deserialize)]
struct Tag {
    format: Option<String>,
}

/// Line 1: what must be equal for evaluations to be exchangeable. Limits that only end a run earlier or later are left out, so that a fit
/// can be resumed with more iterations or starts. Numbers that may be infinite are texts.
#[derive(Serialize, Deserialize)]
struct Head {
    format: String,
    optimizer: String,
    seed: u64,
    /// Longest step, where Gauss–Newton goes on from, steps of Rprop, tolerances.
    options: (f64, String, String, String),
    parameters: Vec<HeadParameter>,
    scenes: Vec<HeadScene>,
}

/// A free parameter, as the head describes it.
#[derive(PartialEq, Serialize, Deserialize)]
struct HeadParameter {
    path: String,
    transform: String,
    typical: f64,
    bounds: [String; 2],
    start: [f64; 2],
    /// Value and standard deviation known beforehand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    known: Option<[f64; 2]>,
    /// Prior of a field in a text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    prior: Option<String>,
    /// Number of values, of a field.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    count: usize,
    /// Scene, place in its θ, and bits of the factor.
    slots: Vec<(usize, usize, String)>,
}

fn one() -> usize {
    1
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

/// A scene, as the head describes it.
#[derive(PartialEq, Serialize, Deserialize)]
struct HeadScene {
    fingerprint: String,
    theta: String,
}

/// Any further line.
#[derive(Serialize, Deserialize)]
struct Round {
    round: Vec<Entry>,
}

/// The line that ends the search for hyperparameters of priors; see [`Choice`].
#[derive(Serialize, Deserialize)]
struct Chosen {
    chosen: ChosenEntry,
}

/// Its content; numbers are hexadecimal digits of pairs, triples and vectors.
#[derive(Serialize, Deserialize)]
struct ChosenEntry {
    /// Length and deviation of every prior.
    hypers: String,
    temper: String,
    /// Length, deviation and evidence of all that were tried, by prior.
    tried: Vec<String>,
    start: String,
    values: String,
    start_cost: String,
    /// Fits, iterations, evaluations, products.
    effort: [usize; 4],
    settled: bool,
}

impl ChosenEntry {
    fn new(c: &Choice) -> ChosenEntry {
        let hyper = |h: &Hyper| [h.length, h.deviation];
        let tried = |t: &Vec<Tried>| {
            let all: Vec<f64> = t.iter().flat_map(|t| [t.hyper.length, t.hyper.deviation, t.evidence]).collect();
            to_hex(&all)
        };
        ChosenEntry {
            hypers: to_hex(&c.hypers.iter().flat_map(hyper).collect::<Vec<f64>>()),
            temper: to_hex(&[c.temper]),
            tried: c.tried.iter().map(tried).collect(),
            start: to_hex(&c.start),
            values: to_hex(&c.values),
            start_cost: to_hex(&[c.start_cost]),
            effort: [c.fits, c.iterations, c.evaluations, c.products],
            settled: c.settled,
        }
    }

    /// `None` where it is damaged, or not one of q values.
    fn choice(&self, q: usize) -> Option<Choice> {
        let one = |text: &str| from_hex(text).and_then(|v| v.first().copied());
        let tried = |text: &String| {
            let rows = from_hex(text)?;
            let row = |r: &[f64]| Tried { hyper: Hyper { length: r[0], deviation: r[1] }, evidence: r[2] };
            rows.len().is_multiple_of(3).then(|| rows.chunks(3).map(row).collect::<Vec<Tried>>())
        };
        let hypers = from_hex(&self.hypers).filter(|h| h.len() == 2 * self.tried.len())?;
        let (start, values) = (from_hex(&self.start)?, from_hex(&self.values)?);
        let [fits, iterations, evaluations, products] = self.effort;
        (start.len() == q && values.len() == q).then_some(())?;
        Some(Choice {
            hypers: hypers.chunks(2).map(|h| Hyper { length: h[0], deviation: h[1] }).collect(),
            temper: one(&self.temper)?,
            tried: self.tried.iter().map(tried).collect::<Option<_>>()?,
            start,
            values,
            start_cost: one(&self.start_cost)?,
            fits,
            iterations,
            evaluations,
            products,
            settled: self.settled,
        })
    }
}

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
    #[serde(default)]
    unmatched: usize,
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
    entries: Entries,
    chosen: Option<Choice>,
}

impl Journal {
    /// Opens the journal of a problem: new, or with the evaluations of an earlier run of the same problem.
    pub fn open(place: &JournalFile, problem: &Problem, settings: &Settings) -> Result<Journal, JournalError> {
        let path = place.path.clone();
        let io = |error: io::Error| JournalError::Io { path: path.clone(), error };
        let head = Head::new(problem, settings);
        let (mut entries, mut chosen) = (BTreeMap::new(), None);
        let mut keep = 0;
        if place.resume && path.exists() {
            let text = std::fs::read(&path).map_err(io)?;
            keep = text.iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
            (entries, chosen) = read(&path, &String::from_utf8_lossy(&text[..keep]), &head, problem.values_count())?;
        }
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(io)?;
        file.set_len(keep as u64).map_err(io)?;
        let mut journal = Journal { path: path.clone(), file, entries, chosen };
        io::Seek::seek(&mut journal.file, io::SeekFrom::End(0)).map_err(io)?;
        if keep == 0 {
            writeln!(journal.file, "{}", text(&head).map_err(io)?).map_err(io)?;
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

    /// The hyperparameters that an earlier run has found.
    pub(crate) fn chosen(&mut self) -> Option<Choice> {
        self.chosen.take()
    }

    /// Appends hyperparameters that were found.
    pub(crate) fn choose(&mut self, choice: &Choice) -> Result<(), JournalError> {
        let io = |error| JournalError::Io { path: self.path.clone(), error };
        let line = text(&Chosen { chosen: ChosenEntry::new(choice) }).map_err(io)? + "\n";
        self.file.write_all(line.as_bytes()).map_err(io)
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
                unmatched: sample.unmatched,
                failure: sample.failure.clone(),
            })
            .collect();
        let io = |error| JournalError::Io { path: self.path.clone(), error };
        let line = text(&Round { round: entries }).map_err(io)? + "\n";
        self.file.write_all(line.as_bytes()).map_err(io)
    }
}

fn text(line: &impl Serialize) -> io::Result<String> {
    Ok(serde_json::to_string(line)?)
}

impl Head {
    fn new(problem: &Problem, settings: &Settings) -> Head {
        let parameter = |f: &FreeParameter| HeadParameter {
            path: f.path.clone(),
            transform: format!("{:?}", f.transform),
            typical: f.typical,
            bounds: [f.bounds.0.to_string(), f.bounds.1.to_string()],
            start: [f.start.0, f.start.1],
            known: f.known.map(|(value, sd)| [value, sd]),
            prior: f.prior.as_ref().map(FieldPrior::text),
            count: f.count,
            slots: f.slots.iter().map(|s| (s.scene, s.place, to_hex(&[s.factor]))).collect(),
        };
        let scene = |s: &FitScene| HeadScene { fingerprint: s.fingerprint.clone(), theta: to_hex(&s.base) };
        Head {
            format: FORMAT.into(),
            optimizer: format!("{:?}", settings.optimizer),
            seed: settings.seed,
            options: (
                settings.max_step,
                format!("{:?}", settings.walk),
                format!("{:?}", settings.rprop),
                format!("{:?}", settings.tolerance),
            ),
            parameters: problem.free().iter().map(parameter).collect(),
            scenes: problem.scenes().iter().map(scene).collect(),
        }
    }

    /// What is not that of another journal, if anything.
    fn difference(&self, other: &Head) -> Option<&'static str> {
        let same = [
            (self.optimizer == other.optimizer, "its optimizer differs"),
            (self.seed == other.seed, "its seed differs"),
            (self.options == other.options, "its steps or tolerances differ"),
            (self.parameters == other.parameters, "its free parameters differ"),
            (self.scenes == other.scenes, "its scenes or recordings differ"),
        ];
        same.into_iter().find(|(same, _)| !same).map(|(_, what)| what)
    }
}

/// Where an evaluation was made, what came out, and in which line it stands.
type Known = (Vec<f64>, Sample, usize);
type Entries = BTreeMap<(usize, usize), Known>;

impl Entry {
    /// The evaluation for q parameters; `None` where it is damaged.
    fn sample(self, q: usize) -> Option<(Vec<f64>, Sample)> {
        let (z, cost) = (from_hex(&self.z)?, from_hex(&self.cost)?);
        let (gradient, curvature) = (from_hex(&self.gradient)?, from_hex(&self.curvature)?);
        let sizes = z.len() == q && cost.len() == 1 && [0, q].contains(&gradient.len()) && [0, q * q].contains(&curvature.len());
        let (residuals, unmatched, failure) = (self.residuals, self.unmatched, self.failure);
        let sample = Sample { cost: cost[0], gradient, curvature, residuals, unmatched, failure, broken: false, stopped: false };
        sizes.then_some((z, sample))
    }
}

/// Reads the whole lines of a journal of a problem with this head and q free parameters.
fn read(path: &Path, text: &str, own: &Head, q: usize) -> Result<(Entries, Option<Choice>), JournalError> {
    let wrong = |line: usize, message: String| JournalError::Content { path: path.to_path_buf(), line, message };
    let (mut entries, mut chosen) = (BTreeMap::new(), None);
    for (k, text) in text.lines().enumerate() {
        let line = k + 1;
        let not = |what: &str, e: serde_json::Error| wrong(line, format!("not a {what} ({e})"));
        if line == 1 {
            let tag: Tag = serde_json::from_str(text).map_err(|e| not("line of a fit's journal", e))?;
            if tag.format.as_deref() != Some(FORMAT) {
                return Err(wrong(line, format!("not a fit's journal; its first line would name the format {FORMAT}")));
            }
            let head: Head = serde_json::from_str(text).map_err(|e| not("line of a fit's journal", e))?;
            if let Some(what) = own.difference(&head) {
                let message = format!(
                    "the journal belongs to another fit ({what}); give the same scene, recording and options, or fit without \
                     resuming"
                );
                return Err(wrong(line, message));
            }
            continue;
        }
        if text.starts_with("{\"chosen\"") {
            let line_of: Chosen = serde_json::from_str(text).map_err(|e| not("line of chosen priors", e))?;
            let damaged = || wrong(line, "the chosen numbers of priors are damaged".into());
            chosen = Some(line_of.chosen.choice(q).ok_or_else(damaged)?);
            continue;
        }
        let Round { round } = serde_json::from_str(text).map_err(|e| not("round of evaluations", e))?;
        for e in round {
            let (start, evaluation) = (e.start, e.evaluation);
            let (z, sample) =
                e.sample(q).ok_or_else(|| wrong(line, format!("evaluation {evaluation} of start {start} is damaged")))?;
            entries.insert((start, evaluation), (z, sample, line));
        }
    }
    Ok((entries, chosen))
}
