//! Diagnoses: what a model lacks.

use crate::fit::loads;
use crate::scene::Scene;
use crate::{errors, options, watch};
use palpate::report::diagnosis_document;
use palpate::results;
use palpate::{DiagnoseOptions, Diagnosed};
use pyo3::prelude::*;
use std::time::Duration;

/// A finished diagnosis.
#[pyclass(frozen, module = "palpate")]
pub struct Diagnosis {
    done: Diagnosed,
    result: Py<PyAny>,
    scenes: Vec<Py<Scene>>,
}

#[pymethods]
impl Diagnosis {
    /// What the command line writes as `diagnosis.json`.
    #[getter]
    fn result(&self, py: Python<'_>) -> Py<PyAny> {
        self.result.clone_ref(py)
    }

    /// The corrected scenes, in the order in which they were given; their text has the effects that were found.
    #[getter]
    fn scenes(&self, py: Python<'_>) -> Vec<Py<Scene>> {
        self.scenes.iter().map(|s| s.clone_ref(py)).collect()
    }

    /// The corrected scene; of several the first.
    #[getter]
    fn scene(&self, py: Python<'_>) -> Option<Py<Scene>> {
        self.scenes.first().map(|s| s.clone_ref(py))
    }

    /// Kinds of the effects that were found.
    #[getter]
    fn found(&self) -> Vec<&'static str> {
        self.done.added.iter().map(|e| e.law().kind).collect()
    }

    fn __repr__(&self) -> String {
        format!(
            "<palpate.Diagnosis: found {}>",
            if self.done.added.is_empty() { "nothing".into() } else { self.found().join(", ") }
        )
    }
}

/// Finds out whether a model lacks something, where, and what.
#[pyfunction]
#[pyo3(signature = (scene, *, held_out = None, budget = None, backend = "auto", progress = None))]
pub fn diagnose(
    py: Python<'_>,
    scene: &Bound<'_, PyAny>,
    held_out: Option<&Bound<'_, Scene>>,
    budget: Option<f64>,
    backend: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Diagnosis> {
    let experiments = options::experiments(scene)?;
    let held_out = held_out.map(|h| h.get().experiment.as_ref().clone());
    let backend = options::backend(py, backend)?;
    if let Some(b) = budget.filter(|b| !(*b > 0.0 && *b < 1e6)) {
        return Err(errors::argument(py, "budget", format!("{b} must be > 0 and below 1000000 (minutes)")));
    }
    let budget = budget.map(|minutes| Duration::from_secs_f64(60.0 * minutes));
    let (done, fault) = watch::run(py, progress, |voice, stop| {
        let mut hear = |what: &str| voice.words("diagnose", what);
        let options =
            DiagnoseOptions { backend, budget, interrupt: stop.clone(), on_progress: Some(&mut hear), ..Default::default() };
        palpate::diagnose(&experiments, held_out.as_ref(), options)
    })?;
    if let Some(fault) = fault {
        return Err(fault);
    }
    let path = experiments.first().map(|e| e.scene().path.clone());
    let done = done.map_err(|e| errors::of_scene(py, &e, path.as_deref()))?;
    let result = loads(py, &results::line(&diagnosis_document(&done)))?;
    let mut scenes = Vec::new();
    for (s, e) in experiments.iter().enumerate() {
        scenes.push(Py::new(py, Scene::of(py, done.corrected(s, e), &e.scene().path)?)?);
    }
    Ok(Diagnosis { done, result, scenes })
}
