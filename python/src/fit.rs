//! Fits.

use crate::residuals::Residuals;
use crate::scene::Scene;
use crate::simulation::compared;
use crate::{arrays, errors, options, watch};
use numpy::PyArray1;
use palpate::report::{whole_document, write_fit, write_report};
use palpate::results::{self, fit::FitDocument};
use palpate::{Backend, Error, Experiment, FitOptions, Fitted, Interrupt};
use palpate_model::scene::Optimizer;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// A finished (or interrupted) fit.
#[pyclass(frozen, module = "palpate")]
pub struct Fit {
    experiments: Arc<Vec<Experiment>>,
    fitted: Arc<Fitted>,
    document: FitDocument,
    result: Py<PyAny>,
}

/// A JSON text as Python's own objects.
pub fn loads(py: Python<'_>, text: &str) -> PyResult<Py<PyAny>> {
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}

fn backend_of(fitted: &Fitted) -> Backend {
    // A fit says what it was computed with.
    if fitted.backend == Backend::Gpu.name() { Backend::Gpu } else { Backend::Cpu }
}

impl Fit {
    pub fn new(py: Python<'_>, experiments: Vec<Experiment>, fitted: Fitted, document: FitDocument) -> PyResult<Fit> {
        let result = loads(py, &results::line(&document))?;
        Ok(Fit { experiments: Arc::new(experiments), fitted: Arc::new(fitted), document, result })
    }

    /// The experiment of a scene with what was found.
    fn found(&self, s: usize) -> Result<Experiment, Error> {
        let e = &self.experiments[s];
        e.with_values(&self.fitted.values_of(s, e))?.at(&self.fitted.result.theta[s])
    }
}

/// A signature that Python shows needs the number itself.
const _: () = assert!(palpate::report::FRAMES == 24);

#[pymethods]
impl Fit {
    /// What the command line writes as `result.json`.
    #[getter]
    fn result(&self, py: Python<'_>) -> Py<PyAny> {
        self.result.clone_ref(py)
    }

    /// "converged", "interrupted", "at-a-bound" or "not-to-be-trusted".
    #[getter]
    fn verdict(&self) -> &'static str {
        self.document.verdict.word.name()
    }

    /// Why, in sentences.
    #[getter]
    fn reasons(&self) -> Vec<String> {
        self.document.verdict.reasons.clone()
    }

    /// Values found, by path, in SI units.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (i, n) in self.fitted.free.iter().enumerate() {
            all.set_item(n.label(), self.fitted.headline(i).value)?;
        }
        Ok(all)
    }

    /// Their standard errors, by path; `None` at a bound or where the data do not say.
    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (i, n) in self.fitted.free.iter().enumerate() {
            all.set_item(n.label(), self.fitted.headline(i).parts.map(|p| p.total()))?;
        }
        Ok(all)
    }

    /// Values of the fields found, by path `[count]`.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (n, f) in self.fitted.fields.iter().zip(&self.fitted.result.fields) {
            all.set_item(n.label(), PyArray1::from_slice(py, &f.values))?;
        }
        Ok(all)
    }

    /// Every iteration of every start: arrays `run`, `iteration` and `cost` `[H]`, and `values` of what is free `[H, q]`.
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (all, h) = (PyDict::new(py), &self.fitted.history);
        let q = h.first().map_or(0, |p| p.values.len());
        all.set_item("run", PyArray1::from_vec(py, h.iter().map(|p| p.start as u32).collect()))?;
        all.set_item("iteration", PyArray1::from_vec(py, h.iter().map(|p| p.iteration as u32).collect()))?;
        all.set_item("cost", PyArray1::from_vec(py, h.iter().map(|p| p.cost).collect()))?;
        all.set_item("values", arrays::table(py, h.len(), q, h.iter().flat_map(|p| p.values.iter().copied()).collect())?)?;
        Ok(all)
    }

    /// What deserves attention, one line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.fitted.warnings.clone()
    }

    /// The scene with what was found; of several the first.
    #[getter]
    fn scene(&self, py: Python<'_>) -> PyResult<Scene> {
        let e = self.found(0);
        Scene::of(py, e, &self.experiments[0].scene().path)
    }

    /// The scenes with what was found.
    #[getter]
    fn scenes(&self, py: Python<'_>) -> PyResult<Vec<Scene>> {
        (0..self.experiments.len()).map(|s| Scene::of(py, self.found(s), &self.experiments[s].scene().path)).collect()
    }

    /// How far every reading lies from the best simulation, scene by scene; it is simulated once more for that.
    fn residuals(&self, py: Python<'_>) -> PyResult<Vec<Residuals>> {
        let at = |s: usize| {
            let found = self.experiments[s].at(&self.fitted.result.theta[s]).map_err(|e| errors::of(py, e))?;
            compared(py, &found, backend_of(&self.fitted))
        };
        (0..self.experiments.len()).map(at).collect()
    }

    /// Writes what the command line writes: `result.json`, `model.toml`, `history.csv`, fields, and `report.html` with so many frames of a scene in space.
    #[pyo3(signature = (folder, *, pictures = 24))]
    fn save(&self, py: Python<'_>, folder: PathBuf, pictures: usize) -> PyResult<()> {
        let (experiments, fitted) = (self.experiments.clone(), self.fitted.clone());
        let write = move || {
            let backend = backend_of(&fitted);
            let result = write_fit(&folder, &experiments, &fitted, backend)?;
            write_report(&folder, &experiments, &fitted, &result, backend, pictures, "palpate.fit (Python)".into())
        };
        watch::load(py, write)?.map_err(|e| errors::of(py, e))
    }

    fn __repr__(&self) -> String {
        let one = |(i, n): (usize, &palpate::FreeNumber)| {
            let h = self.fitted.headline(i);
            format!("{} = {}", n.label(), palpate_diagnose::stated(h.value, h.parts.map(|p| p.total())))
        };
        let numbers: Vec<String> = self.fitted.free.iter().enumerate().map(one).collect();
        format!("<palpate.Fit {}: {}>", self.document.verdict, numbers.join(", "))
    }
}

/// What a fit is asked for.
struct Wish {
    backend: Backend,
    optimizer: Option<Optimizer>,
    iterations: Option<usize>,
    starts: Option<usize>,
    batch: Option<usize>,
    seed: Option<u64>,
    threads: Option<usize>,
    grid_check: bool,
    journal: Option<(PathBuf, bool)>,
}

/// The same steps as `palpate fit`, without its files.
fn run(experiments: &[Experiment], wish: Wish, voice: &watch::Voice, stop: &Interrupt) -> Result<(Fitted, FitDocument), Error> {
    let mut hear = |p: &palpate_fit::Progress| voice.iteration(p.start, p.iteration, p.cost, &p.values);
    let options = FitOptions {
        backend: wish.backend,
        optimizer: wish.optimizer,
        iterations: wish.iterations,
        starts: wish.starts,
        batch: wish.batch,
        seed: wish.seed,
        threads: wish.threads,
        interrupt: stop.clone(),
        journal: wish.journal,
        on_iteration: Some(&mut hear),
        ..FitOptions::default()
    };
    let mut fitted = palpate::fit(experiments, options)?;
    let backend = backend_of(&fitted);
    if wish.grid_check {
        voice.words("fit", "looking at cells and step half as large");
        fitted.check_grid(experiments, backend, stop);
    }
    let document = whole_document(&fitted, experiments, backend);
    Ok((fitted, document))
}

/// Finds the free parameters of one or several scenes.
#[pyfunction]
#[pyo3(signature = (
    scene, *, backend = "auto", optimizer = None, iterations = None, starts = None, seed = None, threads = None, batch = None,
    grid_check = true, journal = None, resume = false, progress = None
))]
pub fn fit(
    py: Python<'_>,
    scene: &Bound<'_, PyAny>,
    backend: &str,
    optimizer: Option<&str>,
    iterations: Option<i64>,
    starts: Option<i64>,
    seed: Option<i128>,
    threads: Option<i64>,
    batch: Option<i64>,
    grid_check: bool,
    journal: Option<PathBuf>,
    resume: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Fit> {
    let experiments = options::experiments(scene)?;
    if resume && journal.is_none() {
        return Err(errors::argument(py, "resume", "needs the journal of the fit that is to be gone on with"));
    }
    let whole = |n: i128| {
        u64::try_from(n).map_err(|_| errors::argument(py, "seed", format!("{n} must be a whole number from 0 to 2⁶⁴ − 1")))
    };
    let wish = Wish {
        backend: options::backend(py, backend)?,
        optimizer: optimizer.map(|o| options::optimizer(py, o)).transpose()?,
        iterations: options::count(py, "iterations", iterations, 0..=1_000_000)?,
        starts: options::count(py, "starts", starts, 1..=1_000_000)?,
        batch: options::count(py, "batch", batch, 1..=1_000_000)?,
        threads: options::count(py, "threads", threads, 0..=4096)?,
        seed: seed.map(whole).transpose()?,
        grid_check,
        journal: journal.map(|j| (j, resume)),
    };
    let (done, fault) = watch::run(py, progress, |voice, stop| run(&experiments, wish, voice, stop))?;
    let scene = experiments.first().map(|e| e.scene().path.clone());
    match (done, fault) {
        (Ok((fitted, document)), None) => Fit::new(py, experiments, fitted, document),
        (Err(e), None) => Err(errors::of_scene(py, &e, scene.as_deref())),
        (done, Some(fault)) => {
            let best = done.ok().map(|(fitted, document)| Fit::new(py, experiments, fitted, document)).transpose()?;
            Err(interrupted(py, fault, best)?)
        }
    }
}

/// Ctrl-C with the best so far; what else a listener or a signal's handler raised is raised as it is.
fn interrupted(py: Python<'_>, fault: PyErr, best: Option<Fit>) -> PyResult<PyErr> {
    if !fault.is_instance_of::<PyKeyboardInterrupt>(py) {
        return Ok(fault);
    }
    let class = py.import("palpate._errors")?.getattr("Interrupted")?;
    let made = PyErr::from_value(class.call1((best.map(|b| Py::new(py, b)).transpose()?,))?);
    made.set_cause(py, Some(fault));
    Ok(made)
}
