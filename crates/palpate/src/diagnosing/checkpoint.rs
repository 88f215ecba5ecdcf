//! Fits of hypotheses that are already done, so that an interrupted diagnosis goes on where it stopped.

use crate::error::Error;
use palpate_diagnose::Fit;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// One fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Done {
    key: String,
    pub values: Vec<f64>,
    pub errors: Vec<Option<f64>>,
    pub cost: f64,
    pub gained: f64,
    pub reach: f64,
    pub settled: bool,
}

/// Fits by what was fitted.
#[derive(Debug, Default)]
pub(super) struct Checkpoint {
    path: Option<PathBuf>,
    done: HashMap<String, Done>,
}

impl Checkpoint {
    /// A file in a folder; without `resume` what it holds is dropped. Lines that were cut off by a crash are skipped.
    pub fn open(place: Option<(&Path, bool)>) -> Result<Checkpoint, Error> {
        let Some((folder, resume)) = place else { return Ok(Checkpoint::default()) };
        let path = folder.join("checkpoint.jsonl");
        let mut done = HashMap::new();
        if resume && let Ok(text) = std::fs::read_to_string(&path) {
            for d in text.lines().filter_map(|l| serde_json::from_str::<Done>(l).ok()) {
                done.insert(d.key.clone(), d);
            }
        } else {
            std::fs::write(&path, "").map_err(|e| Error::write(&path, e))?;
        }
        Ok(Checkpoint { path: Some(path), done })
    }

    /// A fit that was done before.
    pub fn find(&self, key: &str) -> Option<&Done> {
        self.done.get(key)
    }

    /// Keeps a fit. A disk that is full costs the checkpoint, not the diagnosis.
    pub fn keep(&mut self, key: String, fit: &Fit) {
        let (values, errors) = (fit.model.values.clone(), fit.model.errors.clone());
        let done = Done {
            key: key.clone(),
            values,
            errors,
            cost: fit.cost,
            gained: fit.gained,
            // JSON has no infinity.
            reach: fit.reach.min(f64::MAX),
            settled: fit.settled,
        };
        if let (Some(path), Ok(line)) = (&self.path, serde_json::to_string(&done)) {
            let file = std::fs::OpenOptions::new().append(true).create(true).open(path);
            let _ = file.and_then(|mut f| writeln!(f, "{line}"));
        }
        self.done.insert(key, done);
    }
}
