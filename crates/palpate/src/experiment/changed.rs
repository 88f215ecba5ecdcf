//! The same experiment with something changed: values, recording, cells and step.

use super::Experiment;
use crate::error::Error;
use palpate_io::parse_scene;
use palpate_io::recording::Recording;
use palpate_model::observation::ReadingKind;
use palpate_model::plan::Plan;
use palpate_model::scene::{FitSpec, ObservationSpec, Resolution, Scene, TrainFrames};
use std::sync::Arc;

impl Experiment {
    /// The same experiment with other values: dotted path, as for `[[fit.parameter]]`, and value in SI units.
    ///
    /// # Errors
    /// As [`Experiment::open`]; a path that is no number of the scene; a scene that was built in code and has no text.
    pub fn with_values(&self, values: &[(String, f64)]) -> Result<Experiment, Error> {
        self.reworded(palpate_io::scene_with_values(&self.text, &self.scene, values)?)
    }

    /// The same experiment with another text of its scene.
    pub(crate) fn reworded(&self, text: String) -> Result<Experiment, Error> {
        let loaded = parse_scene(&text, &self.scene.path)?;
        // An observation that was given or left out in code is not that of the text.
        let scene = Scene { observation: self.scene.observation.clone(), ..loaded.value };
        Experiment::build(scene, text, loaded.warnings, self.recording.clone())
    }

    /// The same experiment with parameters θ `[P]`; its text keeps what it says.
    ///
    /// # Errors
    /// [`Error::Input`] for a θ of another length.
    pub fn at(&self, theta: &[f64]) -> Result<Experiment, Error> {
        let expected = self.plan.theta.len();
        if theta.len() != expected {
            return Err(Error::Input(format!("{} parameters are given, this scene has {expected}", theta.len())));
        }
        let plan = Plan { theta: theta.to_vec(), ..self.plan.clone() };
        Ok(Experiment { plan, ..self.clone() })
    }

    /// The same experiment compared with another recording, as its `[observation]` says, or with all that the recording holds. `costs`
    /// says which of its readings count; without it those that the scene names, or all where that names none that there are.
    ///
    /// # Errors
    /// As [`Experiment::open`].
    pub fn with_recording(
        &self,
        recording: impl Into<Arc<Recording>>,
        costs: Option<Vec<ReadingKind>>,
    ) -> Result<Experiment, Error> {
        let recording = recording.into();
        let held = recording.kinds();
        if held.is_empty() {
            return Err(Error::scene(&recording.path, "observation.recording", "holds nothing that could be compared"));
        }
        let named = self.scene.observation.as_ref().map(|o| o.costs.clone()).filter(|c| c.iter().all(|k| held.contains(k)));
        let costs = costs.or(named).unwrap_or(held);
        let spec = self.scene.observation.clone().unwrap_or_else(|| ObservationSpec::new(recording.path.clone(), costs.clone()));
        let observation = Some(ObservationSpec { recording: recording.path.clone(), costs, ..spec });
        let scene = Scene { observation, ..self.scene.clone() };
        Experiment::build(scene, self.text.clone(), Vec::new(), Some(recording))
    }

    /// The same experiment with another measurement, all of which is used in every way that its readings can be compared.
    ///
    /// # Errors
    /// [`Error::File`] when the recording lies nowhere near the object or does not go with the scene.
    pub fn measured(&self, recording: Recording) -> Result<Experiment, Error> {
        let band = self.scene.observation.as_ref().map(|o| o.band);
        let spec = ObservationSpec::new(recording.path.clone(), recording.kinds());
        let observation = ObservationSpec { band: band.unwrap_or(spec.band), ..spec };
        let scene = Scene { observation: Some(observation), ..self.scene.clone() };
        Experiment::build(scene, self.text.clone(), Vec::new(), Some(Arc::new(recording)))
    }

    /// The same experiment compared with the frames that a fit of it does not see; `None` where it sees all, or none are left.
    ///
    /// # Errors
    /// As [`Experiment::open`].
    pub fn of_other_frames(&self) -> Result<Option<Experiment>, Error> {
        let Some(chosen) = self.scene.fit.as_ref().and_then(|f| f.frames.clone()).filter(|_| self.recording.is_some()) else {
            return Ok(None);
        };
        let mut scene = self.scene.clone();
        if let Some(fit) = &mut scene.fit {
            fit.frames = Some(TrainFrames { others: !chosen.others, ..chosen });
        }
        let other = Experiment::build(scene, self.text.clone(), Vec::new(), self.recording.clone())?;
        Ok(Some(other).filter(|o| !o.plan.observation.frames.is_empty()))
    }

    /// The same experiment with another search.
    pub(crate) fn searched(&self, change: impl FnOnce(&mut FitSpec)) -> Experiment {
        let mut other = self.clone();
        other.scene.fit.as_mut().map(change);
        other
    }

    /// The same experiment with cells and time step divided by `factor`, and without its recording.
    ///
    /// # Errors
    /// [`Error::File`] when the finer grid cannot be built.
    pub fn refined(&self, factor: f64) -> Result<Experiment, Error> {
        self.with_finer_grid(factor, factor, None)
    }

    /// The same experiment with cells and time step divided by `factor`, compared with its recording in the same band.
    ///
    /// # Errors
    /// [`Error::File`] when the finer grid cannot be built or the recording is gone.
    pub fn finer(&self, factor: f64, step: f64) -> Result<Experiment, Error> {
        let observation = self.scene.observation.clone().map(|o| ObservationSpec { band: o.band * factor, ..o });
        self.with_finer_grid(factor, step, observation)
    }

    /// The same experiment with cells and time step divided by factors, compared as this says.
    pub(crate) fn with_finer_grid(
        &self,
        factor: f64,
        step: f64,
        observation: Option<ObservationSpec>,
    ) -> Result<Experiment, Error> {
        let mut scene = Scene { observation, ..self.scene.clone() };
        scene.object.resolution = match scene.object.resolution {
            Resolution::Own => Resolution::Own,
            Resolution::Edge(edge) => Resolution::Edge(edge / factor),
            _ => Resolution::CellSize(self.plan.body.length / factor),
        };
        let steps = (scene.time.steps as f64 * step).round() as usize;
        if steps > 0 && !scene.time.scheme.still {
            scene.time.step *= scene.time.steps as f64 / steps as f64;
            scene.time.steps = steps;
        }
        let known = self.recording.clone().filter(|_| scene.observation.is_some());
        Experiment::build(scene, self.text.clone(), Vec::new(), known)
    }
}
