//! Simulations as arrays.

use crate::residuals::Residuals;
use crate::scene::Scene;
use crate::{arrays, errors, options, watch};
use numpy::{PyArray1, PyArray2, PyArray3};
use palpate::Experiment;
use pyo3::prelude::*;
use std::sync::Arc;

/// All states of a simulation: F of them, with N nodes and V vertices of the surface.
#[pyclass(frozen, module = "palpate")]
pub struct Simulation {
    experiment: Arc<Experiment>,
    motion: palpate::Simulation,
    residuals: Option<Py<Residuals>>,
}

#[pymethods]
impl Simulation {
    /// Times of the states on the recording's clock [s] `[F]`.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let start = self.experiment.start_time();
        PyArray1::from_vec(py, self.motion.snapshots.iter().map(|s| start + s.time).collect())
    }

    /// Nodes at rest [m] `[N, 3]`.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::vectors(py, &self.experiment.plan().body.nodes)
    }

    /// Displacements of the nodes [m] `[F, N, 3]`.
    #[getter]
    fn displacement<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = self.experiment.plan().body.nodes.len();
        arrays::rows(py, n, self.motion.snapshots.iter().map(|s| &s.displacement[..]))
    }

    /// Velocities of the nodes [m/s] `[F, N, 3]`.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = self.experiment.plan().body.nodes.len();
        arrays::rows(py, n, self.motion.snapshots.iter().map(|s| &s.velocity[..]))
    }

    /// Vertices of the surface in every state [m] `[F, V, 3]`.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let deform = |s: &palpate_engine::Snapshot| self.motion.surface.deform(&s.displacement);
        let all: Vec<Vec<glam::DVec3>> = py.detach(|| self.motion.snapshots.iter().map(deform).collect());
        arrays::rows(py, self.motion.surface.rest.len(), all.iter().map(|v| &v[..]))
    }

    /// Triangles of the surface `[T, 3]`.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        arrays::triangles(py, &self.motion.triangles)
    }

    /// How far every reading of the scene's recording lies from this; `None` without a recording.
    #[getter]
    fn residuals(&self, py: Python<'_>) -> Option<Py<Residuals>> {
        self.residuals.as_ref().map(|r| r.clone_ref(py))
    }

    /// The simulated scene.
    #[getter]
    fn scene(&self) -> Scene {
        Scene::new(self.experiment.as_ref().clone())
    }

    fn __len__(&self) -> usize {
        self.motion.snapshots.len()
    }

    fn __repr__(&self) -> String {
        let (states, nodes) = (self.motion.snapshots.len(), self.experiment.plan().body.nodes.len());
        format!("<palpate.Simulation of {}: {states} states of {nodes} nodes>", self.experiment.scene().path.display())
    }
}

/// Simulates an experiment and compares it with its recording.
pub fn compared(py: Python<'_>, experiment: &Experiment, backend: palpate::Backend) -> PyResult<Residuals> {
    let work = |_: &watch::Voice, stop: &palpate::Interrupt| experiment.simulate_until(backend, stop, |_, _| {});
    match watch::run(py, None, work)? {
        (_, Some(fault)) => Err(fault),
        (done, None) => {
            let (_, frames) = done.map_err(|e| errors::of_scene(py, &e, Some(&experiment.scene().path)))?;
            Ok(Residuals::new(experiment, &frames))
        }
    }
}

/// Simulates a scene with its own values and keeps every state.
#[pyfunction]
#[pyo3(signature = (scene, *, backend = "auto", progress = None))]
pub fn simulate(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    backend: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Simulation> {
    let experiment = scene.get().experiment.clone();
    let backend = options::backend(py, backend)?;
    let own = experiment.clone();
    let work = move |voice: &watch::Voice, stop: &palpate::Interrupt| {
        own.simulate_until(backend, stop, |state, steps| voice.at("simulate", state, steps))
    };
    let (done, fault) = watch::run(py, progress, work)?;
    if let Some(fault) = fault {
        return Err(fault);
    }
    let (motion, frames) = done.map_err(|e| errors::of_scene(py, &e, Some(&experiment.scene().path)))?;
    let compared = !experiment.plan().observation.frames.is_empty();
    let residuals = compared.then(|| Py::new(py, Residuals::new(&experiment, &frames))).transpose()?;
    Ok(Simulation { experiment, motion, residuals })
}
