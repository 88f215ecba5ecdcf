//! Scenes: what is known of an object, and what is to be found.

use crate::recording::Recording;
use crate::{arrays, errors, options, watch};
use numpy::{PyArray1, PyArray2};
use palpate::{Embedding, Error, Experiment};
use palpate_io::output::write_file;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A number of a scene that can be set and fitted.
#[pyclass(frozen, get_all, module = "palpate")]
#[derive(Clone, Debug)]
pub struct Parameter {
    /// Dotted path, as in the scene file.
    name: String,
    /// SI unit, "1" for none.
    unit: String,
    /// Its value in the scene, in SI units.
    value: f64,
    /// Smallest and largest allowed value.
    limits: (f64, f64),
    /// One sentence about it.
    doc: String,
    /// True where the scene's [fit] looks for it.
    free: bool,
    /// Where starts of a fit are drawn from; `None` where it is not free.
    start: Option<(f64, f64)>,
    /// Range that a fit keeps it in; `None` where it is not free.
    bounds: Option<(f64, f64)>,
    /// Value and standard deviation known beforehand, where there are such.
    known: Option<(f64, f64)>,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let unit = palpate_model::params::unit_behind(&self.unit);
        let free = if self.free { ", free" } else { "" };
        format!("<palpate.Parameter {} = {}{unit}{free}>", self.name, self.value)
    }
}

/// The surface at rest, carried by the nodes, and its triangles.
type Surface = (Embedding, Vec<[u32; 3]>);

/// A scene and the recording that it is compared with.
#[pyclass(frozen, module = "palpate")]
pub struct Scene {
    pub experiment: Arc<Experiment>,
    surface: OnceLock<Surface>,
}

impl Scene {
    pub fn new(experiment: Experiment) -> Scene {
        Scene { experiment: Arc::new(experiment), surface: OnceLock::new() }
    }

    pub fn of(py: Python<'_>, made: Result<Experiment, Error>, path: &Path) -> PyResult<Scene> {
        made.map(Scene::new).map_err(|e| errors::of_scene(py, &e, Some(path)))
    }

    fn rest_surface(&self) -> &Surface {
        // The edge that simulations and files have.
        self.surface.get_or_init(|| self.experiment.surface(0.5 * self.experiment.plan().body.length))
    }
}

#[pymethods]
impl Scene {
    /// Reads a scene file and, unless `recording` is false, the recording that it names.
    #[staticmethod]
    #[pyo3(signature = (path, *, recording = true))]
    fn open(py: Python<'_>, path: PathBuf, recording: bool) -> PyResult<Scene> {
        let file = path.clone();
        let read = move || if recording { Experiment::open(&file) } else { Experiment::open_without_recording(&file) };
        Scene::of(py, watch::load(py, read)?, &path)
    }

    /// A scene given as text. Relative paths in it start from the folder `base`, or the present one; errors call it `name`.
    #[staticmethod]
    #[pyo3(signature = (text, *, base = None, name = "scene.toml"))]
    fn from_toml(py: Python<'_>, text: String, base: Option<PathBuf>, name: &str) -> PyResult<Scene> {
        let path = base.map_or_else(|| PathBuf::from(name), |b| b.join(name));
        let file = path.clone();
        Scene::of(py, watch::load(py, move || Experiment::from_toml(&text, file))?, &path)
    }

    /// The scene with other values, by dotted path, in SI units.
    fn with_values(&self, py: Python<'_>, values: std::collections::BTreeMap<String, f64>) -> PyResult<Scene> {
        let (from, values) = (self.experiment.clone(), values.into_iter().collect::<Vec<_>>());
        Scene::of(py, watch::load(py, move || from.with_values(&values))?, &self.experiment.scene().path)
    }

    /// The scene compared with another recording. `cost` says which of its readings count.
    #[pyo3(signature = (recording, *, cost = None))]
    fn with_recording(&self, py: Python<'_>, recording: &Recording, cost: Option<&Bound<'_, PyAny>>) -> PyResult<Scene> {
        let costs = cost.map(options::kinds).transpose()?;
        let (from, recording) = (self.experiment.clone(), recording.recording.clone());
        Scene::of(py, watch::load(py, move || from.with_recording(recording, costs))?, &self.experiment.scene().path)
    }

    /// Writes the scene's text, with paths that hold from the file's folder.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let e = &self.experiment;
        let text = palpate_io::write_scene(e.text(), e.scene(), &[], folder).map_err(|e| errors::of(py, e))?;
        write_file(&path, |w| w.write_all(text.as_bytes())).map_err(|e| errors::of(py, e))
    }

    /// The scene's file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.experiment.scene().path.clone()
    }

    #[getter]
    fn title(&self) -> &str {
        &self.experiment.scene().title
    }

    /// The text of the scene file.
    #[getter]
    fn text(&self) -> &str {
        self.experiment.text()
    }

    /// What looks suspicious without being wrong, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.experiment.warnings().to_vec()
    }

    /// What the scene left open and was chosen for it: key, value in SI units, and why.
    #[getter]
    fn chosen(&self) -> Vec<(String, f64, String)> {
        self.experiment.chosen().iter().map(|(key, value, why)| (key.to_string(), *value, why.clone())).collect()
    }

    /// The numbers of the scene that can be set and fitted, those of fields left out.
    #[getter]
    fn parameters(&self) -> Vec<Parameter> {
        let plan = self.experiment.plan();
        let fit = self.experiment.scene().fit.as_ref();
        let fields = |k: &palpate_model::params::ParamKey| matches!(k.on(), palpate_model::params::On::Field(_));
        let keys = plan.layout.keys.iter().zip(&plan.theta).filter(|(k, _)| !fields(k));
        keys.map(|(key, value)| {
            let spec = key.spec();
            let free = fit.and_then(|f| f.parameters.iter().find(|p| p.path == spec.path));
            Parameter {
                unit: spec.unit.into(),
                value: *value,
                limits: (spec.lower, spec.upper),
                doc: spec.doc.into(),
                free: free.is_some(),
                start: free.map(|p| p.start),
                bounds: free.map(|p| p.bounds),
                known: free.and_then(|p| p.known),
                name: spec.path,
            }
        })
        .collect()
    }

    /// Nodes of the simulation at rest [m] `[N, 3]`.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::vectors(py, &self.experiment.plan().body.nodes)
    }

    /// Vertices of the surface at rest [m] `[V, 3]`.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::vectors(py, &py.detach(|| self.rest_surface()).0.rest)
    }

    /// Triangles of the surface `[T, 3]`.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        arrays::triangles(py, &py.detach(|| self.rest_surface()).1)
    }

    /// Mass of the body [kg].
    #[getter]
    fn mass(&self) -> f64 {
        let plan = self.experiment.plan();
        plan.theta[plan.layout.index(palpate_model::params::ParamKey::Density)] * plan.body.volume
    }

    /// Volume of the body [m³].
    #[getter]
    fn volume(&self) -> f64 {
        self.experiment.plan().body.volume
    }

    /// Times of the frames that are compared, on the recording's clock [s] `[F]`.
    #[getter]
    fn frame_times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.experiment.plan().observation.frames.iter().map(|f| f.time).collect())
    }

    /// The recording, where there is one.
    #[getter]
    fn recording(&self) -> Option<Recording> {
        self.experiment.recording().map(|r| Recording { recording: r.clone() })
    }

    /// Positions of the body's nodes moved by displacements [m] `[N, 3]` carried to the surface's vertices [m] `[V, 3]`.
    fn deform<'py>(&self, py: Python<'py>, displacement: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let n = self.experiment.plan().body.nodes.len();
        let u = arrays::by_three(&arrays::numbers(displacement, "displacement", &[Some(n), Some(3)])?.1);
        let moved = py.detach(|| self.rest_surface().0.deform(&u));
        arrays::vectors(py, &moved)
    }

    fn __repr__(&self) -> String {
        let e = &self.experiment;
        let frames = e.plan().observation.frames.len();
        format!("<palpate.Scene {}: {} nodes, {frames} frames>", e.scene().path.display(), e.plan().body.nodes.len())
    }
}
