//! Measured recordings: how they are compared, and the fits of their scenes, which must succeed.

use palpate::{Experiment, Fitted};
use palpate_model::observation::ReadingKind;
use palpate_model::scene::ObservationSpec;
use std::path::Path;
use studies::real;
use studies::real::swing::Swing;
use studies::real::tracks::Sighting;

/// All frames of a recording compared by one cost, in the default band.
pub fn compared(cost: ReadingKind) -> ObservationSpec {
    ObservationSpec::new("recording", vec![cost])
}

/// [`real::open`].
pub fn open(data: &Path, name: &str, changes: &[(&str, &str)]) -> Experiment {
    real::open(data, name, changes).unwrap_or_else(|e| panic!("{e}"))
}

/// [`real::fit`].
pub fn fit(experiment: &Experiment) -> Fitted {
    real::fit(experiment).unwrap_or_else(|e| panic!("{e}"))
}

/// [`real::swings`].
pub fn swings(experiment: &Experiment, theta: &[f64], marker: &str, guess: f64) -> (Swing, Swing) {
    real::swings(experiment, theta, marker, guess).unwrap_or_else(|e| panic!("{e}"))
}

/// [`real::tracks::track`].
pub fn track(experiment: &Experiment, theta: &[f64], marker: &str) -> Vec<Sighting> {
    real::tracks::track(experiment, theta, marker).unwrap_or_else(|e| panic!("{e}"))
}
