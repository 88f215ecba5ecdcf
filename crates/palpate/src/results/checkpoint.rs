//! `checkpoint.jsonl` of a diagnosis: fits that are done. The first line names the format, every further one is a fit.

use super::Document;
use serde::{Deserialize, Serialize};

/// First line of the file (`checkpoint/1`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointHead {}

impl Document for CheckpointHead {
    const FORMAT: &'static str = "checkpoint/1";
}

/// A fit of a hypothesis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CheckpointFit {
    /// What was fitted, from where and for how long.
    pub key: String,
    /// Values of its free numbers.
    pub values: Vec<f64>,
    /// Their standard errors, where known.
    pub errors: Vec<Option<f64>>,
    /// Cost per scalar residual.
    pub cost: f64,
    /// By how much the curvature there promises to lower its cost further.
    pub promised: f64,
    /// Longest step that it would try next; the largest finite number where there is no limit.
    pub reach: f64,
    /// False when more iterations would go on.
    pub settled: bool,
    /// How its optimiser stood, for a fit that goes on from there.
    #[serde(default)]
    pub lap: CheckpointLap,
}

/// How the optimiser of a fit stood at its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointLap {
    /// Damping; `None` before the first step.
    pub damping: Option<f64>,
    /// Rejected steps in a row that changed nothing.
    pub level: u32,
    /// Sizes that steps count in, of every number.
    pub typical: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_checkpoint_is_what_it_was_when_it_is_read_again() {
        assert_eq!(keys(&round_trip(&CheckpointHead {})), ["format"]);
        let fit = CheckpointFit {
            key: "a".into(),
            values: vec![1.0 / 3.0, 1e-300],
            errors: vec![None, Some(0.1)],
            cost: 0.5,
            promised: 0.0,
            reach: f64::MAX,
            settled: true,
            lap: CheckpointLap { damping: Some(0.1), level: 1, typical: vec![1.0 / 3.0, 1.0] },
        };
        let text = serde_json::to_string(&fit).expect("it can be written");
        assert_eq!(serde_json::from_str::<CheckpointFit>(&text).expect("it can be read"), fit);
    }
}
