//! The cost of a fit with its gradient, for optimisers of Python.

use crate::{arrays, errors, options, watch};
use numpy::{PyArray1, PyArray2};
use palpate::{Coordinates, Interrupt, Objective};
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};

/// What a fit of one or several scenes minimises, as a function of x `[q]`.
#[pyclass(frozen, module = "palpate", subclass)]
pub struct Problem {
    objective: Mutex<Objective>,
    /// File of the first scene.
    scene: std::path::PathBuf,
    names: Vec<String>,
    scaled: bool,
}

impl Problem {
    /// Runs one evaluation at x.
    fn evaluate<T: Send>(
        &self,
        x: &Bound<'_, PyAny>,
        work: impl FnOnce(&mut Objective, &[f64]) -> Result<T, palpate::Error> + Send,
    ) -> PyResult<T> {
        let py = x.py();
        let x = self.read(x)?;
        let objective = &self.objective;
        let task = move |_: &watch::Voice, stop: &Interrupt| {
            let mut own = objective.lock().unwrap_or_else(PoisonError::into_inner);
            own.until(stop);
            work(&mut own, &x)
        };
        match watch::run(py, None, task)? {
            (_, Some(fault)) => Err(fault),
            (done, None) => done.map_err(|e| errors::of_scene(py, &e, Some(&self.scene))),
        }
    }

    fn read(&self, x: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        Ok(arrays::numbers(x, "x", &[Some(self.names.len())])?.1)
    }

    fn known<T>(&self, of: impl FnOnce(&Objective) -> T) -> T {
        of(&self.objective.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Problem {
    /// The cost of a scene, or of several together. With `scaled` x is what palpate's own optimisers see: of order one, logarithms of what is positive.
    #[new]
    #[pyo3(signature = (scene, *, backend = "auto", scaled = false))]
    fn new(py: Python<'_>, scene: &Bound<'_, PyAny>, backend: &str, scaled: bool) -> PyResult<Problem> {
        let (experiments, backend) = (options::experiments(scene)?, options::backend(py, backend)?);
        let coordinates = if scaled { Coordinates::Scaled } else { Coordinates::Physical };
        let path = experiments.first().map(|e| e.scene().path.clone()).unwrap_or_default();
        let made = watch::load(py, move || Objective::new(&experiments, backend, coordinates))?;
        let objective = made.map_err(|e| errors::of_scene(py, &e, Some(&path)))?;
        Ok(Problem { names: objective.names().to_vec(), objective: Mutex::new(objective), scene: path, scaled })
    }

    /// Paths of what is free `[q]`.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }

    /// SI units of the values `[q]`.
    #[getter]
    fn units(&self) -> Vec<String> {
        self.known(Objective::units)
    }

    /// True where x is in scaled coordinates.
    #[getter]
    fn scaled(&self) -> bool {
        self.scaled
    }

    /// The scenes' own values as x `[q]`.
    #[getter]
    fn x0<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.known(Objective::start))
    }

    /// Lower and upper bound of each component of x, as SciPy takes them.
    #[getter]
    fn bounds(&self) -> Vec<(f64, f64)> {
        self.known(Objective::bounds)
    }

    /// Values in SI units `[q]` at x.
    fn values<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let given = self.read(x)?;
        Ok(PyArray1::from_vec(x.py(), self.known(|o| o.values(&given))))
    }

    /// x at values in SI units `[q]`, which are moved into their bounds where x is scaled.
    fn coordinates<'py>(&self, values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (py, given) = (values.py(), self.read(values)?);
        Ok(PyArray1::from_vec(py, if self.scaled { self.known(|o| o.coordinates_of(&given)) } else { given }))
    }

    /// The cost at x.
    fn __call__(&self, x: &Bound<'_, PyAny>) -> PyResult<f64> {
        self.evaluate(x, |o, x| o.value(x))
    }

    /// The cost at x.
    fn value(&self, x: &Bound<'_, PyAny>) -> PyResult<f64> {
        self.__call__(x)
    }

    /// The gradient of the cost at x `[q]`.
    fn gradient<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self.value_and_gradient(x)?.1)
    }

    /// Cost and gradient at x, by one simulation.
    fn value_and_gradient<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let (cost, gradient) = self.evaluate(x, |o, x| o.value_and_gradient(x))?;
        Ok((cost, PyArray1::from_vec(x.py(), gradient)))
    }

    /// The Gauss–Newton approximation of the second derivatives at x `[q, q]`.
    fn curvature<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (_, matrix) = self.evaluate(x, |o, x| o.gradient_and_curvature(x))?;
        arrays::table(x.py(), self.names.len(), self.names.len(), matrix)
    }

    fn __repr__(&self) -> String {
        format!("<palpate.Problem over {}>", self.names.join(", "))
    }
}
