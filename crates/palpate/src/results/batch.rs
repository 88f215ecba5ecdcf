//! `summary.json` of a batch, that of a shard, and the row of a scene.

use super::Document;
use super::fit::{Parameter, Residual};
use serde::{Deserialize, Serialize};

/// What became of every scene (`batch/1`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BatchDocument {
    /// One row a scene, in the order in which they were given.
    pub scenes: Vec<BatchRow>,
    /// How many are complete.
    pub complete: usize,
    /// How many could not be read.
    pub bad_input: usize,
    /// How many could not be computed.
    pub failed: usize,
    /// How many were interrupted.
    pub interrupted: usize,
    /// How many were left to another process.
    #[serde(default)]
    pub busy: usize,
    /// How many no shard has finished.
    #[serde(default)]
    pub lost: usize,
    /// Which part of the scenes these are; `None` where they are all.
    pub shard: Option<ShardSummary>,
}

/// One of several parts of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Its number, from 1.
    pub number: usize,
    /// Of how many.
    pub of: usize,
}

/// What a shard knows of the whole.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShardSummary {
    /// Which one it is.
    #[serde(flatten)]
    pub shard: Shard,
    /// Names of all scenes of the batch, in the order in which they were given: the shard has that at its own number, and every `of`-th after it.
    pub all: Vec<String>,
}

impl Document for BatchDocument {
    const FORMAT: &'static str = "batch/1";
}

impl BatchDocument {
    /// A summary of rows, counted.
    pub fn of(scenes: Vec<BatchRow>) -> BatchDocument {
        let count = |s: RowStatus| scenes.iter().filter(|r| r.status == s).count();
        BatchDocument {
            complete: count(RowStatus::Complete),
            bad_input: count(RowStatus::BadInput),
            failed: count(RowStatus::Failed),
            interrupted: count(RowStatus::Interrupted),
            busy: count(RowStatus::Busy),
            lost: count(RowStatus::Lost),
            shard: None,
            scenes,
        }
    }
}

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RowStatus {
    /// Fitted, now or by an earlier run.
    Complete,
    /// Interrupted; the best until then is kept.
    Interrupted,
    /// It, or its recording, could not be read.
    BadInput,
    /// It could not be computed.
    Failed,
    /// Another process fits it.
    Busy,
    /// No shard has finished it.
    Lost,
}

impl RowStatus {
    /// As files and messages write it.
    pub fn name(self) -> &'static str {
        match self {
            RowStatus::Complete => "complete",
            RowStatus::Interrupted => "interrupted",
            RowStatus::BadInput => "bad-input",
            RowStatus::Failed => "failed",
            RowStatus::Busy => "busy",
            RowStatus::Lost => "lost",
        }
    }
}

/// One scene of a batch; by itself (`batch-row/1`) in the scene's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BatchRow {
    /// Name of its folder.
    pub name: String,
    /// Its file.
    pub scene: String,
    /// What became of it.
    pub status: RowStatus,
    /// Why, or what deserves attention first.
    pub message: String,
    /// Wall-clock time [s].
    pub seconds: f64,
    /// What computed; `None` where it did not come to that.
    pub backend: Option<String>,
    /// What was fitted and how: a later run takes the result over where it is the same.
    pub fingerprint: String,
    /// The numbers found; `None` where there are none.
    pub parameters: Option<Vec<Parameter>>,
    /// Cost per scalar residual at the best point.
    pub cost: Option<f64>,
    /// Distance between measurement and model.
    pub residual: Option<Residual>,
}

impl Document for BatchRow {
    const FORMAT: &'static str = "batch-row/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_summary_is_what_it_was_when_it_is_read_again() {
        let failed = BatchRow {
            name: "b".into(),
            scene: "b.toml".into(),
            status: RowStatus::BadInput,
            message: "b.toml: no such file".into(),
            seconds: 0.0,
            backend: None,
            fingerprint: String::new(),
            parameters: None,
            cost: None,
            residual: None,
        };
        let complete = BatchRow {
            status: RowStatus::Complete,
            backend: Some("cpu".into()),
            parameters: Some(vec![Parameter { path: "material.density".into(), value: Some(1.0 / 3.0), ..Parameter::default() }]),
            cost: Some(0.1),
            residual: Some(Residual { rms: Some(1e-3), noise: None, points: 5, unmatched: 1, scenes: Vec::new() }),
            ..failed.clone()
        };
        round_trip(&complete);
        let part = ShardSummary { shard: Shard { number: 2, of: 3 }, all: vec!["a".into(), "b".into()] };
        let of_shard = round_trip(&BatchDocument { shard: Some(part), ..BatchDocument::of(vec![failed.clone()]) });
        assert_eq!(of_shard["shard"], serde_json::json!({ "number": 2, "of": 3, "all": ["a", "b"] }));
        let file = round_trip(&BatchDocument::of(vec![complete, failed]));
        let all = ["bad_input", "busy", "complete", "failed", "format", "interrupted", "lost", "scenes", "shard"];
        assert_eq!(keys(&file), all);
        assert_eq!((&file["complete"], &file["bad_input"], &file["failed"]), (&1.into(), &1.into(), &0.into()));
        let [complete, interrupted] = [RowStatus::Complete, RowStatus::Interrupted];
        for status in [complete, interrupted, RowStatus::BadInput, RowStatus::Failed, RowStatus::Busy, RowStatus::Lost] {
            assert_eq!(serde_json::to_value(status).expect("it is a word"), status.name());
        }
        let row = &file["scenes"][1];
        assert!(row["backend"].is_null() && row["parameters"].is_null() && row["residual"].is_null() && row["cost"].is_null());
        let all = ["backend", "cost", "fingerprint", "message", "name", "parameters", "residual", "scene", "seconds", "status"];
        assert_eq!(keys(row), all);
    }
}
