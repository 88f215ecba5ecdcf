//! Tracked bodies as arrays.

use crate::fit::loads;
use crate::recording::Recording;
use crate::scene::Scene;
use crate::{arrays, errors, watch};
use numpy::{PyArray1, PyArray2, PyArray3};
use palpate::Refined;
use palpate::report::tracking_document;
use palpate::{Error, Experiment, TrackedBody, TrackedFrame, results};
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

/// The moving body in F frames of a recording, with N nodes and V vertices of the surface.
#[pyclass(frozen, module = "palpate")]
pub struct Track {
    experiment: Arc<Experiment>,
    body: TrackedBody,
    result: Py<PyAny>,
}

impl Track {
    fn table<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        n: usize,
        of: impl Fn(&TrackedFrame) -> Vec<T>,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        arrays::table(py, self.body.frames.len(), n, self.body.frames.iter().flat_map(of).collect())
    }
}

#[pymethods]
impl Track {
    /// What the command line writes as `tracked.json`: a verdict, and a row a frame.
    #[getter]
    fn result(&self, py: Python<'_>) -> Py<PyAny> {
        self.result.clone_ref(py)
    }

    /// "tracked" or "doubtful".
    #[getter]
    fn verdict(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.result.bind(py).get_item("verdict")?.unbind())
    }

    /// Times of the frames on the recording's clock [s] `[F]`.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.body.frames.iter().map(|f| f.time).collect())
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
        arrays::rows(py, n, self.body.frames.iter().map(|f| &f.displacement[..]))
    }

    /// Velocities of the nodes [m/s] `[F, N, 3]`.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let n = self.experiment.plan().body.nodes.len();
        arrays::rows(py, n, self.body.frames.iter().map(|f| &f.velocity[..]))
    }

    /// Share of the prior's variance that readings took away, by node `[F, N]`.
    #[getter]
    fn data<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, self.experiment.plan().body.nodes.len(), |f| f.data.clone())
    }

    /// Vertices of the surface at rest [m] `[V, 3]`.
    #[getter]
    fn rest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::vectors(py, &self.body.surface.rest)
    }

    /// Vertices of the surface [m] `[F, V, 3]`.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        arrays::rows(py, self.body.surface.rest.len(), self.body.frames.iter().map(|f| &f.surface[..]))
    }

    /// Triangles of the surface `[T, 3]`.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        arrays::triangles(py, &self.body.triangles)
    }

    /// Standard deviation of one coordinate of each vertex [m] `[F, V]`.
    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, self.body.surface.rest.len(), |f| f.deviation.clone())
    }

    /// Whether each vertex was seen `[F, V]`.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        self.table(py, self.body.surface.rest.len(), |f| f.seen.clone())
    }

    /// A recording of points of the surface where they were seen, for a fit.
    fn recording(&self, py: Python<'_>) -> PyResult<Recording> {
        let made = self.body.recording(&self.experiment.scene().title, self.body.noise);
        // No argument is to blame: the frames are.
        made.map(Recording::new).map_err(|e| errors::of(py, Error::Failed(e.to_string())))
    }

    fn __len__(&self) -> usize {
        self.body.frames.len()
    }

    fn __repr__(&self) -> String {
        let (frames, sound) = (self.body.frames.len(), self.body.sound());
        format!("<palpate.Track of {}: {frames} frames, {sound} sound>", self.experiment.scene().path.display())
    }
}

/// Finds the moving body in every frame of the scene's recording.
#[pyfunction]
#[pyo3(signature = (scene, *, progress = None))]
pub fn track(py: Python<'_>, scene: &Bound<'_, Scene>, progress: Option<&Bound<'_, PyAny>>) -> PyResult<Track> {
    let experiment = scene.get().experiment.clone();
    let frames = experiment.plan().observation.frames.len();
    let own = experiment.clone();
    let clock = Instant::now();
    let (done, fault) = watch::run(py, progress, move |voice, stop| {
        palpate::track(&own, |done| {
            voice.at("track", done, frames);
            if stop.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    })?;
    if let Some(fault) = fault {
        return Err(fault);
    }
    let body = done.map_err(|e| errors::of_scene(py, &e, Some(&experiment.scene().path)))?;
    let refined = Refined::once((*experiment).clone(), body);
    let document = tracking_document(&refined, clock.elapsed().as_secs_f64());
    let body = refined.tracked;
    Ok(Track { result: loads(py, &results::line(&document))?, experiment, body })
}
