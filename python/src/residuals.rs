//! How far every reading lies from a simulation, as arrays.

use crate::arrays;
use glam::DVec3;
use numpy::{PyArray1, PyArray2};
use palpate::Experiment;
use palpate_engine::{FrameResiduals, Misfit};
use palpate_model::observation::Sensor;
use pyo3::prelude::*;

/// Readings R of a recording beside a simulation, in the order of the frames.
#[pyclass(frozen, module = "palpate")]
pub struct Residuals {
    sensors: Vec<String>,
    time: Vec<f64>,
    frame: Vec<u32>,
    sensor: Vec<u32>,
    item: Vec<u32>,
    measured: Vec<DVec3>,
    offset: Vec<DVec3>,
    distance: Vec<f64>,
}

impl Residuals {
    /// Of a simulation of an experiment.
    pub fn new(experiment: &Experiment, frames: &[FrameResiduals]) -> Residuals {
        let o = &experiment.plan().observation;
        let mut seen: Vec<Sensor> = frames.iter().flat_map(|f| f.readings.iter().map(|r| r.sensor)).collect();
        seen.sort_unstable();
        seen.dedup();
        let all = || frames.iter().flat_map(|f| f.readings.iter().map(move |r| (f.frame, r)));
        Residuals {
            sensors: seen.iter().map(|s| o.name(*s)).collect(),
            time: all().map(|(f, _)| o.frames[f].time).collect(),
            frame: all().map(|(f, _)| f as u32).collect(),
            sensor: all().map(|(_, r)| seen.binary_search(&r.sensor).unwrap_or(0) as u32).collect(),
            item: all().map(|(_, r)| r.item).collect(),
            measured: all().map(|(_, r)| r.place).collect(),
            offset: all()
                .map(|(_, r)| match r.misfit {
                    Some(Misfit::Offset(v)) => v,
                    _ => DVec3::NAN,
                })
                .collect(),
            distance: all()
                .map(|(_, r)| match r.misfit {
                    Some(Misfit::Distance(d)) => d,
                    Some(Misfit::Offset(v)) => v.length(),
                    None => f64::NAN,
                })
                .collect(),
        }
    }
}

#[pymethods]
impl Residuals {
    /// Names of the sensors that took the readings: cameras, markers, "points", "nodes".
    #[getter]
    fn sensors(&self) -> Vec<String> {
        self.sensors.clone()
    }

    /// Time of each reading on the recording's clock [s] `[R]`.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.time)
    }

    /// Number of the frame `[R]`.
    #[getter]
    fn frame<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.frame)
    }

    /// Place of the sensor in `sensors` `[R]`.
    #[getter]
    fn sensor<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.sensor)
    }

    /// Number of the depth point in its frame, of the marker or point, of the node `[R]`.
    #[getter]
    fn item<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, &self.item)
    }

    /// Where it was measured [m] `[R, 3]`.
    #[getter]
    fn measured<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::vectors(py, &self.measured)
    }

    /// Where the simulation has it [m] `[R, 3]`; NaN for depth, whose readings belong to no place of the body.
    #[getter]
    fn simulated<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let places: Vec<DVec3> = self.measured.iter().zip(&self.offset).map(|(m, o)| *m + *o).collect();
        arrays::vectors(py, &places)
    }

    /// Distance [m] `[R]`: of depth from the surface, positive outside the body; of all else between both places. NaN where a reading met
    /// nothing.
    #[getter]
    fn distance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.distance)
    }

    /// Root mean square of the distances [m]; NaN without any.
    #[getter]
    fn rms(&self) -> f64 {
        let met = || self.distance.iter().filter(|d| !d.is_nan());
        (met().map(|d| d * d).sum::<f64>() / met().count() as f64).sqrt()
    }

    fn __len__(&self) -> usize {
        self.distance.len()
    }

    fn __repr__(&self) -> String {
        format!("<palpate.Residuals: {} readings of {}>", self.distance.len(), self.sensors.join(", "))
    }
}
