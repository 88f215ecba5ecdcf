//! The laboratory: what a diagnosis asks of whoever simulates and fits.

use crate::change::Change;
use crate::judgement::prior::Strange;
use crate::separation::Separation;
use glam::DVec3;
use palpate_engine::ResidualRow;
use palpate_model::params::Transform;
use std::sync::Arc;

/// Why the laboratory has no answer.
#[derive(Clone, Debug, thiserror::Error)]
pub enum LabError {
    /// This hypothesis cannot be computed, for this reason; others may.
    #[error("{0}")]
    Failed(#[source] Arc<dyn std::error::Error + Send + Sync>),
    /// Asked to stop.
    #[error("interrupted")]
    Interrupted,
    /// The time that was allowed is over.
    #[error("no time left")]
    NoTime,
}

impl LabError {
    /// A hypothesis that cannot be computed, for a reason that is an error or a text.
    pub fn failed(cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> LabError {
        LabError::Failed(cause.into().into())
    }
}

/// What a scene is like, as far as hypotheses are made from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Centre of the body [m].
    pub center: DVec3,
    /// Lowest and highest corner of the rest shape [m].
    pub bounds: (DVec3, DVec3),
    /// Up in the world.
    pub up: DVec3,
    /// Points spread over the rest surface [m], where something may be attached.
    pub places: Vec<DVec3>,
    /// Size of the smallest region that may carry a load: half a cell [m].
    pub spot: f64,
    /// Number of cameras that saw the body.
    pub cameras: usize,
    /// False where all that was seen are points of the surface without lines of sight: effects on depth readings change nothing then.
    pub sight: bool,
    /// Number of markers.
    pub markers: usize,
    /// True where every body is made of cells, which some effects need.
    pub cells: bool,
    /// Paths of numbers that the scene holds fixed.
    pub held: Vec<String>,
    /// Per scene: times [s] during which the baseline touches a plane.
    pub contact: Vec<Vec<(f64, f64)>>,
    /// Per scene: frames until the next of which the baseline moves by less than a tenth of the noise of a depth reading.
    pub still: Vec<Vec<usize>>,
    /// Planes that the measured body does not cross and the baseline does.
    pub walls: Vec<Wall>,
}

/// A plane beside the measured body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Normal, towards the body.
    pub normal: DVec3,
    /// Distance from the body's centre [m], against the normal.
    pub distance: f64,
}

/// One number of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// Path in the scene file.
    pub path: String,
    /// SI unit, `1` for none.
    pub unit: String,
    /// Value where it starts: of a number that the scene leaves free the middle of its starts, of a freed one the scene's, of an effect's what
    /// its change says.
    pub start: f64,
    /// Smallest and largest allowed value.
    pub bounds: (f64, f64),
    /// A change that matters.
    pub scale: f64,
    /// How a fit sees it.
    pub transform: Transform,
    /// Value and standard deviation that are known beforehand: a prior that costs and fits of a [`Laboratory`] contain, and readings do not.
    pub known: Option<(f64, f64)>,
}

impl Number {
    /// How far it may go down and up from its start. Where a linear estimate of a relative change goes far, only the logarithm of what is
    /// there can follow: its steps are counted along that, in the number's own unit at the start.
    pub fn room(&self) -> (f64, f64) {
        let (low, high) = self.bounds;
        match self.transform {
            Transform::Relative => {
                let whole = 1.0 + self.start;
                (whole * ((1.0 + low) / whole).ln(), whole * ((1.0 + high) / whole).ln())
            }
            _ => (low - self.start, high - self.start),
        }
    }

    /// Its value after a step from its start, counted as [`Number::room`] does.
    pub fn after(&self, step: f64) -> f64 {
        match self.transform {
            Transform::Relative => (1.0 + self.start) * (step / (1.0 + self.start)).exp() - 1.0,
            _ => self.start + step,
        }
    }
}

/// A fitted model: changes of the scene, and the value of every free number (the scene's own first, then change by change).
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What was changed.
    pub changes: Vec<Change>,
    /// Its free numbers.
    pub numbers: Vec<Number>,
    /// Their values.
    pub values: Vec<f64>,
    /// Standard errors, where known.
    pub errors: Vec<Option<f64>>,
}

impl Model {
    /// One of its numbers, as an answer states it.
    pub fn found(&self, k: usize) -> crate::diagnosis::FoundNumber {
        (self.numbers[k].path.clone(), self.values[k], self.errors[k], self.numbers[k].unit.clone())
    }
}

/// Where the fit of a hypothesis starts.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// What is changed.
    pub changes: Vec<Change>,
    /// Values of all free numbers.
    pub values: Vec<f64>,
    /// Longest first step, as the fit before it said ([`Fit::reach`]); infinite where there was none.
    pub reach: f64,
}

/// A fit of a hypothesis, finished or not.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// Where it is.
    pub model: Model,
    /// Its cost per scalar residual.
    pub cost: f64,
    /// By how much the curvature there promises to lower its cost further.
    pub promised: f64,
    /// Longest step that it would try next.
    pub reach: f64,
    /// False when more iterations would go on.
    pub settled: bool,
}

/// One scalar residual in its scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Number of the scene.
    pub scene: usize,
    /// Time of its frame [s].
    pub time: f64,
    /// The residual.
    pub row: ResidualRow,
}

/// All residuals of a model, in the same order for every model of the same scenes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Readings {
    /// The residuals `[R]`; hypotheses that are absent share them.
    pub rows: Arc<Vec<Reading>>,
    /// Cost per scalar residual.
    pub cost: f64,
    /// Number of columns Q.
    pub columns: usize,
    /// Derivatives by the model's numbers, `[R, Q]`.
    pub sensitivity: Vec<f64>,
}

/// An error that every model has, up to a factor of about one and either sign: what a finer computation would add to every residual,
/// carried on to the limit, or one of the recording's systematic errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// What was refined, or what is not known better.
    pub name: &'static str,
    /// Change of every residual [m]; `None` where it cannot be said.
    pub change: Vec<Option<f64>>,
    /// How many times the field is in the residuals, before any is read: its mean and standard deviation.
    pub times: (f64, f64),
    /// Share of the field that is not known, independently in every block.
    pub rough: f64,
}

impl Field {
    /// What a finer computation of the same model adds to the residuals. What one refinement says is trusted to its own size as a whole, and
    /// to half of it in every block: contact and edges follow no order of convergence.
    pub fn refined(name: &'static str, change: Vec<Option<f64>>) -> Field {
        Field { name, change, times: (1.0, 1.0), rough: 0.5 }
    }

    /// One of the recording's systematic errors, by its standard deviation.
    pub fn systematic(name: &'static str, change: Vec<Option<f64>>) -> Field {
        Field { name, change, times: (0.0, 1.0), rough: 0.0 }
    }

    /// The same field for another model of the same recording: its size is known, its sign is not.
    pub fn borrowed(&self) -> Field {
        Field { times: (0.0, self.times.0.abs().max(self.times.1)), ..self.clone() }
    }

    /// Mean square of the changes that can be said [m²].
    pub fn mean_square(&self) -> f64 {
        let known = || self.change.iter().flatten();
        known().map(|c| c * c).sum::<f64>() / known().count().max(1) as f64
    }
}

/// The fitted model that a diagnosis begins with.
#[derive(Clone, Debug, PartialEq)]
pub struct Baseline {
    /// The best that its fit found.
    pub model: Model,
    /// Why its fit ended before its end, if it did.
    pub cut: Option<String>,
}

/// Whoever simulates and fits. What is asked of it ends with [`LabError::NoTime`] or [`LabError::Interrupted`] as soon as its time is over or
/// somebody asks to stop, wherever it is.
pub trait Laboratory {
    /// True where the scene's own numbers are still to be fitted.
    fn is_fitted(&self) -> bool {
        true
    }
    /// Fits the scene's own numbers. It leaves the time that the same sensitivities as before take once more; the scene's character is that of
    /// the fitted scene from then on.
    ///
    /// # Errors
    /// The fit has no result.
    fn baseline(&mut self, start: Model) -> Result<Baseline, LabError> {
        Ok(Baseline { model: start, cut: None })
    }
    /// Residuals and derivatives of a model, also where somebody has asked to stop, if that is a matter of a second.
    ///
    /// # Errors
    /// It cannot be computed, or it takes too long.
    fn last_look(&mut self, model: &Model) -> Result<Readings, LabError> {
        let all = self.linearise(&[(model.changes.clone(), model.values.clone())]);
        all.into_iter().next().unwrap_or(Err(LabError::Interrupted))
    }
    /// Time since the beginning [s].
    fn seconds(&self) -> f64 {
        0.0
    }
    /// Keeps time of the search's for what whoever asks computes himself before the answer [s].
    fn keep_back(&mut self, _seconds: f64) {}
    /// The scene's character.
    fn setting(&self) -> &Setting;
    /// Free numbers of the scene with these changes.
    fn numbers(&self, changes: &[Change]) -> Result<Vec<Number>, LabError>;
    /// Cost per scalar residual of each set of changes at these values; infinite where there is none.
    fn costs(&mut self, tries: &[(Vec<Change>, Vec<f64>)]) -> Vec<f64>;
    /// Fits each hypothesis from its start for so many iterations at most and until an iteration lowers the cost by less than
    /// this share of it; one answer each.
    fn fit(&mut self, tries: &[Start], iterations: usize, tolerance: f64) -> Vec<Result<Fit, LabError>>;
    /// Residuals and derivatives of each set of changes at these values.
    fn linearise(&mut self, tries: &[(Vec<Change>, Vec<f64>)]) -> Vec<Result<Readings, LabError>>;
    /// As [`Laboratory::linearise`], with derivatives by the numbers from place `from` on alone.
    fn linearise_new(&mut self, tries: &[(Vec<Change>, Vec<f64>)], from: usize) -> Vec<Result<Readings, LabError>>;
    /// What finer computations would change.
    fn finer(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError>;
    /// What the recording's systematic errors (`noise_systematic`: places of markers, zero points of cameras) would change, each of them
    /// by its standard deviation; none where the recording states none.
    fn systematic(&mut self, _changes: &[Change], _values: &[f64]) -> Result<Vec<Field>, LabError> {
        Ok(Vec::new())
    }
    /// Residuals of data that no fit has seen, with the numbers that are not shared with them fitted; `None` when there are none. Columns are
    /// the model's numbers, zero where they say nothing there, then those that were fitted there.
    fn held_out(&mut self, model: &Model) -> Result<Option<Readings>, LabError>;
    /// What finer computations of the same model would change in those residuals, `coarse` as [`Laboratory::held_out`] gave them.
    ///
    /// # Errors
    /// The finer scene cannot be computed.
    fn held_out_finer(&mut self, _model: &Model, _coarse: &Readings) -> Result<Vec<Field>, LabError> {
        Ok(Vec::new())
    }
    /// What other measurements would read of each of several rivals, fitted to them as well, compared with what they would read of the model that
    /// is named; those that there is time to simulate.
    fn separations(&mut self, named: &Model, rivals: &[&Model]) -> Vec<Separation>;
    /// Numbers of a model that lie outside the world as it is known, once they are `corrected` by what errors of grid and step make of them, or that
    /// a fit left at a bound.
    fn strange(&self, _model: &Model, _corrected: &[f64]) -> Vec<Strange> {
        Vec::new()
    }
    /// True when the time that was allowed is over.
    fn out_of_time(&self) -> bool;
    /// Iterations of fits that there is time for, about; with no limit of the time all that can be counted.
    fn iterations_left(&self) -> usize {
        usize::MAX
    }
    /// True when asked to stop.
    fn interrupted(&self) -> bool;
    /// Hears what is going on.
    fn say(&mut self, what: &str);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relative_change_goes_as_far_as_its_logarithm() {
        let number = |start, transform| Number {
            path: "effect.0.change".into(),
            unit: "1".into(),
            start,
            bounds: (-0.999, 1e3),
            scale: 0.5,
            transform,
            known: None,
        };
        for start in [-0.9, 0.0, 4.0] {
            let n = number(start, Transform::Relative);
            let (low, high) = n.room();
            assert!((n.after(low) + 0.999).abs() < 1e-12 && (n.after(high) / 1e3 - 1.0).abs() < 1e-12, "{low} {high}");
            // A small step is one of the number itself.
            assert!((n.after(1e-6) - start - 1e-6).abs() < 1e-10);
        }
        assert_eq!(number(0.5, Transform::Linear).room(), (-1.499, 999.5));
        assert_eq!(number(0.5, Transform::Linear).after(0.25), 0.75);
    }
}
