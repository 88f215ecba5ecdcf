//! Fits of hypotheses that are already done, so that an interrupted diagnosis goes on where it stopped.

use super::laps::Lap;
use crate::error::Error;
use crate::results;
use crate::results::checkpoint::{CheckpointFit, CheckpointHead};
use palpate_diagnose::Fit;
use std::collections::HashMap;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Its file in the output folder.
pub(crate) const CHECKPOINTS: &str = "checkpoint.jsonl";

/// Fits by what was fitted.
#[derive(Debug, Default)]
pub(super) struct Checkpoint {
    path: Option<PathBuf>,
    done: HashMap<String, CheckpointFit>,
}

impl Checkpoint {
    /// A file in a folder; without `resume` what it holds is dropped. A last line that was cut off by a crash is skipped.
    pub fn open(place: Option<(&Path, bool)>) -> Result<Checkpoint, Error> {
        let Some((folder, resume)) = place else { return Ok(Checkpoint::default()) };
        let path = folder.join(CHECKPOINTS);
        let mut done = HashMap::new();
        let text = if resume { std::fs::read_to_string(&path).unwrap_or_default() } else { String::new() };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let mut lines = whole.lines();
        if let Some(head) = lines.next() {
            results::parse::<CheckpointHead>(head, &path)?;
        }
        for d in lines.filter_map(|l| serde_json::from_str::<CheckpointFit>(l).ok()) {
            done.insert(d.key.clone(), d);
        }
        if !resume || whole.len() < text.len() {
            std::fs::write(&path, whole).map_err(|e| Error::write(&path, e))?;
        }
        Ok(Checkpoint { path: Some(path), done })
    }

    /// A fit that was done before.
    pub fn find(&self, key: &str) -> Option<&CheckpointFit> {
        self.done.get(key)
    }

    /// Keeps a fit. A disk that is full costs the checkpoint, not the diagnosis.
    pub fn keep(&mut self, key: String, fit: &Fit, lap: &Lap) {
        let (values, errors) = (fit.model.values.clone(), fit.model.errors.clone());
        let done = CheckpointFit {
            key: key.clone(),
            values,
            errors,
            cost: fit.cost,
            promised: fit.promised,
            // JSON has no infinity.
            reach: fit.reach.min(f64::MAX),
            settled: fit.settled,
            lap: lap.to_document(),
        };
        if let Some(path) = &self.path {
            let _ = append(path, &done);
        }
        self.done.insert(key, done);
    }
}

/// Adds a fit to the file, behind its format.
fn append(path: &Path, fit: &CheckpointFit) -> io::Result<()> {
    let mut file = OpenOptions::new().append(true).create(true).open(path)?;
    let head = if file.metadata()?.len() == 0 { results::line(&CheckpointHead {}) + "\n" } else { String::new() };
    // In one piece: two programs in one folder mix no lines.
    file.write_all(format!("{head}{}\n", serde_json::to_string(fit)?).as_bytes())
}
