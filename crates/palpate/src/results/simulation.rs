//! What `palpate simulate --json` prints.

use super::Document;
use serde::{Deserialize, Serialize};

/// What was simulated and written (`simulation/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulationDocument {
    /// The scene's file.
    pub scene: String,
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// Time steps; 0 for a static problem.
    pub steps: usize,
    /// The last step that was reached, where somebody stopped it before the end.
    #[serde(default)]
    pub interrupted: Option<usize>,
    /// Nodes of the body.
    pub nodes: usize,
    /// Frames written.
    pub frames: usize,
    /// Files written.
    pub files: usize,
    /// Folder that they are in.
    pub out: String,
    /// Largest displacement of a point of the surface [m].
    pub largest_displacement: Option<f64>,
    /// Wall-clock time [s].
    pub seconds: f64,
}

impl Document for SimulationDocument {
    const FORMAT: &'static str = "simulation/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_simulation_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&SimulationDocument {
            scene: "a.toml".into(),
            backend: "cpu".into(),
            steps: 10,
            interrupted: Some(7),
            nodes: 45,
            frames: 3,
            files: 9,
            out: "out/a".into(),
            largest_displacement: Some(1.0 / 3.0),
            seconds: 0.5,
        });
        let all = [
            "backend",
            "files",
            "format",
            "frames",
            "interrupted",
            "largest_displacement",
            "nodes",
            "out",
            "scene",
            "seconds",
            "steps",
        ];
        assert_eq!(keys(&file), all);
    }
}
