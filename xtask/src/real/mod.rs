//! The measured recordings: every scene of `assets/scenes` that fits one, and what its fit says beside what was measured. The tables of
//! `docs/real-data.md` and the README are printed by [`run`].

pub mod diagnoses;
pub mod models;
pub mod report;
pub(crate) mod studies;
pub mod swing;
pub mod tracks;

use crate::table;
use palpate::{Error, Experiment, FitOptions, Fitted};
use std::path::{Path, PathBuf};
use swing::Swing;
use tracks::track;

pub use studies::{run, tell};

/// A scene file of `assets/scenes`.
pub fn scene_path(name: &str) -> PathBuf {
    table::root().join("assets/scenes").join(format!("{name}.toml"))
}

/// A scene of `assets/scenes` whose recordings are those of `data`, with texts of the file replaced.
///
/// # Errors
/// The scene or its recording cannot be read.
///
/// # Panics
/// A text to be replaced is not there: a change that changes nothing would be taken for a result.
pub fn open(data: &Path, name: &str, changes: &[(&str, &str)]) -> Result<Experiment, Error> {
    let path = scene_path(name);
    let wrong = |e: std::io::Error| Error::Input(format!("{}: {e}", path.display()));
    let data = std::path::absolute(data).map_err(wrong)?;
    let mut text = std::fs::read_to_string(&path).map_err(wrong)?.replace("../../../shared/data", &data.display().to_string());
    for (old, new) in changes {
        assert!(text.contains(old), "{name} has no \"{old}\"");
        text = text.replace(old, new);
    }
    Experiment::from_toml(&text, &path)
}

/// The fit that a scene asks for.
///
/// # Errors
/// Those of [`Experiment::fit`].
pub fn fit(experiment: &Experiment) -> Result<Fitted, Error> {
    experiment.fit(FitOptions::default())
}

/// What a fit found for a parameter.
///
/// # Panics
/// The scene does not fit it.
pub fn found(fitted: &Fitted, path: &str) -> f64 {
    fitted.result.parameters.iter().find(|p| p.path == path).unwrap_or_else(|| panic!("{path} was not fitted")).value
}

/// Vertical swing of a marker [m], measured and simulated, at the parameters θ; `guess` of its frequency [Hz].
///
/// # Errors
/// The simulation fails, or the recording does not have the marker.
pub fn swings(experiment: &Experiment, theta: &[f64], marker: &str, guess: f64) -> Result<(Swing, Swing), Error> {
    let all = track(experiment, theta, marker)?;
    if all.is_empty() {
        return Err(Error::Input(format!("{}: the recording has no marker \"{marker}\"", experiment.scene().path.display())));
    }
    let up = experiment.up();
    let seen: Vec<(f64, f64)> = all.iter().map(|s| (s.time, s.seen.dot(up))).collect();
    let simulated: Vec<(f64, f64)> = all.iter().map(|s| (s.time, s.simulated.dot(up))).collect();
    Ok((Swing::fit(&seen, guess), Swing::fit(&simulated, guess)))
}

/// Where a marker is along the vertical as long as nothing moves it [m].
///
/// # Panics
/// The recording does not have the marker.
pub fn height_at_rest(experiment: &Experiment, marker: &str) -> f64 {
    let plan = experiment.plan();
    let site = plan.observation.markers.iter().find(|m| m.name == marker).unwrap_or_else(|| panic!("no marker {marker}"));
    (site.carry(|node| plan.body.nodes[node]).0 + site.stalk).dot(experiment.up())
}
