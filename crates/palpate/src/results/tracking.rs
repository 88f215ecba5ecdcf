//! What `palpate track` writes as `tracked.json`; arrays lie beside it in `tracked.npz`.

use super::Document;
use serde::{Deserialize, Serialize};

/// A tracked body (`tracking/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackingDocument {
    /// The scene's file.
    pub scene: String,
    /// `tracked`, `interrupted` or `doubtful`.
    pub verdict: String,
    /// Why, in a sentence; empty where nothing is wrong.
    pub reason: String,
    /// `dynamic` or `elastic`.
    pub prior: String,
    /// Frames of the recording.
    pub recorded: usize,
    /// Nodes of the body.
    pub nodes: usize,
    /// Places of its surface.
    pub places: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
    /// Fits to what was tracked, where they were asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rounds: Vec<RoundRow>,
    /// Every tracked frame.
    pub frames: Vec<FrameRow>,
}

/// A fit to what was tracked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundRow {
    /// The numbers found.
    pub values: Vec<RoundNumber>,
    /// By how many standard errors the one moved that moved most; nothing in the first round.
    pub moved: Option<f64>,
    /// Root mean square of the readings' residuals before it [m].
    pub rms: Option<f64>,
    /// Mean temperature of the prior before it [J].
    pub temperature: Option<f64>,
}

/// A number of a round.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundNumber {
    /// Path in the scene file.
    pub path: String,
    /// Value in SI.
    pub value: Option<f64>,
    /// Its standard error, by noise alone.
    pub standard_error: Option<f64>,
}

/// One frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameRow {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Scalar readings.
    pub readings: usize,
    /// Those that met the body.
    pub matched: usize,
    /// Root mean square of their residuals [m].
    pub rms: Option<f64>,
    /// Median standard deviation of a coordinate of the places that were seen [m]; nothing where none was.
    pub deviation_seen: Option<f64>,
    /// The same of those that were not.
    pub deviation_hidden: Option<f64>,
    /// Places that were seen.
    pub seen: usize,
    /// Directions that the readings determine.
    pub determined: Option<f64>,
    /// Temperature of the prior [J].
    pub temperature: Option<f64>,
    /// Steps of Gauss–Newton's method.
    pub steps: usize,
    /// True where correspondences had to be found first.
    pub cold: bool,
    /// What is wrong, in words.
    pub doubts: Vec<String>,
}

impl Document for TrackingDocument {
    const FORMAT: &'static str = "tracking/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_tracked_body_is_what_it_was_when_it_is_read_again() {
        let row = FrameRow {
            time: 0.1,
            readings: 100,
            matched: 97,
            rms: Some(1.0 / 3.0),
            deviation_seen: Some(0.001),
            deviation_hidden: None,
            seen: 40,
            determined: Some(12.5),
            temperature: Some(1e-3),
            steps: 7,
            cold: true,
            doubts: vec!["2.5 % of the rays pass through the body".into()],
        };
        let file = round_trip(&TrackingDocument {
            scene: "a.toml".into(),
            verdict: "doubtful".into(),
            reason: "1 of 2 frames".into(),
            prior: "dynamic".into(),
            recorded: 2,
            nodes: 45,
            places: 90,
            seconds: 0.5,
            rounds: vec![RoundRow {
                values: vec![RoundNumber { path: "material.youngs_modulus".into(), value: Some(1e4), standard_error: None }],
                moved: Some(0.1),
                rms: Some(1e-3),
                temperature: Some(2e-3),
            }],
            frames: vec![row],
        });
        assert_eq!(
            keys(&file),
            ["format", "frames", "nodes", "places", "prior", "reason", "recorded", "rounds", "scene", "seconds", "verdict"]
        );
    }
}
