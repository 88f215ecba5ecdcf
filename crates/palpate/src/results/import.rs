//! What `palpate import --json` prints.

use super::Document;
use serde::{Deserialize, Serialize};

/// What was imported (`import/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImportDocument {
    /// The recording's file.
    pub recording: String,
    /// The scene's file.
    pub scene: String,
    /// Name of the source's format.
    pub source_format: String,
    /// Why it was taken for that.
    pub why: String,
    /// Cameras.
    pub cameras: usize,
    /// Depth images.
    pub images: usize,
    /// Point clouds.
    #[serde(default)]
    pub clouds: usize,
    /// Depth readings of the object.
    pub depth_readings: usize,
    /// Readings of markers.
    pub marker_readings: usize,
    /// Readings of tracked points.
    pub tracked_readings: usize,
    /// First and last time [s].
    pub times: [f64; 2],
    /// What was assumed.
    pub guesses: Vec<GuessDocument>,
    /// What is known.
    pub facts: Vec<String>,
    /// What the source holds and the recording does not.
    pub losses: Vec<String>,
}

/// An assumption.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GuessDocument {
    /// What it is about: `unit`, `axis`, `pose`, `floor`, `release time`, …
    pub about: String,
    /// What was assumed, and why.
    pub text: String,
    /// The flag that replaces it.
    pub fix: String,
}

impl Document for ImportDocument {
    const FORMAT: &'static str = "import/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn an_import_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&ImportDocument {
            recording: "a/recording.toml".into(),
            scene: "a/scene.toml".into(),
            source_format: "tum".into(),
            why: "depth.txt".into(),
            cameras: 1,
            images: 12,
            clouds: 0,
            depth_readings: 4000,
            marker_readings: 0,
            tracked_readings: 0,
            times: [0.0, 0.4],
            guesses: vec![GuessDocument { about: "unit".into(), text: "mm".into(), fix: "--unit".into() }],
            facts: vec!["x".into()],
            losses: Vec::new(),
        });
        let all = [
            "cameras",
            "clouds",
            "depth_readings",
            "facts",
            "format",
            "guesses",
            "images",
            "losses",
            "marker_readings",
            "recording",
            "scene",
            "source_format",
            "times",
            "tracked_readings",
            "why",
        ];
        assert_eq!(keys(&file), all);
    }
}
