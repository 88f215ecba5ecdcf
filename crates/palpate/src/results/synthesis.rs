//! What `palpate synthesize` writes as `synthesis.json` and prints with `--json`.

use super::Document;
use super::simulation::SimulationDocument;
use serde::{Deserialize, Serialize};

/// A motion that was made and written (`synthesis/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SynthesisDocument {
    /// The motion's files.
    pub motion: SimulationDocument,
    /// The scene that `palpate simulate` makes the same motion of.
    pub model: String,
    /// How the forces of free handles were found; `None` without any.
    pub search: Option<SearchDocument>,
}

/// A search for forces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchDocument {
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// Optimiser.
    pub optimizer: String,
    /// Free coefficients.
    pub coefficients: usize,
    /// Evaluations.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
    /// Somebody stopped it before its end.
    pub interrupted: bool,
    /// Cost of the start and of the motion found, per coordinate of the wishes.
    pub cost: [Option<f64>; 2],
    /// Largest coefficient of a force [N].
    pub largest_force: f64,
    /// How keyframes are met, by time.
    pub keyframes: Vec<KeyframeDocument>,
    /// How a loop closes.
    #[serde(rename = "loop")]
    pub closed: Option<LoopDocument>,
}

/// How a keyframe is met.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyframeDocument {
    /// When [s].
    pub time: f64,
    /// Its points.
    pub points: usize,
    /// Root mean square distance of the points from where they shall be [m].
    pub rms: Option<f64>,
    /// Largest distance [m].
    pub worst: Option<f64>,
}

/// How a loop closes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoopDocument {
    /// Largest distance of a node from where it began [m].
    pub gap: Option<f64>,
    /// Largest difference of a node's velocity from that at the start [m/s].
    pub speed: Option<f64>,
}

impl Document for SynthesisDocument {
    const FORMAT: &'static str = "synthesis/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_synthesis_is_what_it_was_when_it_is_read_again() {
        let motion = SimulationDocument {
            scene: "a.toml".into(),
            backend: "cpu".into(),
            steps: 10,
            interrupted: None,
            nodes: 45,
            frames: 3,
            files: 9,
            out: "out/a".into(),
            largest_displacement: Some(1.0 / 3.0),
            seconds: 0.5,
        };
        let search = SearchDocument {
            backend: "cpu".into(),
            optimizer: "gauss-newton".into(),
            coefficients: 24,
            evaluations: 7,
            seconds: 1.5,
            interrupted: false,
            cost: [None, Some(0.1)],
            largest_force: 2.0,
            keyframes: vec![KeyframeDocument { time: 0.5, points: 4, rms: Some(1e-4), worst: Some(2e-4) }],
            closed: Some(LoopDocument { gap: Some(1e-5), speed: None }),
        };
        let file = round_trip(&SynthesisDocument { motion, model: "out/a/scene.toml".into(), search: Some(search) });
        assert_eq!(keys(&file), ["format", "model", "motion", "search"]);
    }
}
