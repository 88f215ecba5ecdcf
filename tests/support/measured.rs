//! Measured recordings: how they are compared, the scenes of `assets/scenes` that fit them, and the swings that both show.

use crate::swing::Swing;
use crate::tracks::track;
use palpate::{Experiment, FitOptions, Fitted};
use palpate_model::scene::{CostKind, ObservationSpec};
use std::path::{Path, PathBuf};

/// All frames of a recording compared by one cost, in the default band.
pub fn compared(cost: CostKind) -> ObservationSpec {
    ObservationSpec {
        recording: "recording".into(),
        file: "recording.toml".into(),
        costs: vec![cost],
        band: 4.0,
        from: f64::NEG_INFINITY,
        to: f64::INFINITY,
        every: 1,
        pixel_stride: 1,
        markers: Vec::new(),
    }
}

/// A scene file of `assets/scenes`.
pub fn scene_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/scenes").join(format!("{name}.toml"))
}

/// A scene of `assets/scenes` whose recordings are those of `data`, with texts of the file replaced.
pub fn open(data: &Path, name: &str, changes: &[(&str, &str)]) -> Experiment {
    let path = scene_path(name);
    let mut text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text = text.replace("../../../shared/data", &data.canonicalize().expect("the folder exists").display().to_string());
    for (old, new) in changes {
        assert!(text.contains(old), "{name} has no \"{old}\"");
        text = text.replace(old, new);
    }
    Experiment::from_toml(&text, &path).unwrap_or_else(|e| panic!("{e}"))
}

/// The fit that a scene asks for.
pub fn fit(experiment: &Experiment) -> Fitted {
    experiment.fit(FitOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// What a fit found for a parameter.
pub fn found(fitted: &Fitted, path: &str) -> f64 {
    fitted.result.parameters.iter().find(|p| p.path == path).unwrap_or_else(|| panic!("{path} was not fitted")).value
}

/// Vertical swing of a marker, measured and simulated, at the parameters θ; `guess` of its frequency [Hz].
pub fn swings(experiment: &Experiment, theta: &[f64], marker: &str, guess: f64) -> (Swing, Swing) {
    let all = track(experiment, theta, marker);
    let up = experiment.up();
    let seen: Vec<(f64, f64)> = all.iter().map(|s| (s.time, s.seen.dot(up))).collect();
    let simulated: Vec<(f64, f64)> = all.iter().map(|s| (s.time, s.simulated.dot(up))).collect();
    (Swing::fit(&seen, guess), Swing::fit(&simulated, guess))
}
