//! Vectors and arrays of NumPy, back and forth.

use crate::errors::argument;
use glam::DVec3;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

fn flat<'a>(vectors: impl Iterator<Item = &'a DVec3>) -> Vec<f64> {
    vectors.flat_map(|v| v.to_array()).collect()
}

/// Vectors as an array `[N, 3]`.
pub fn vectors<'py>(py: Python<'py>, vectors: &[DVec3]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_vec(py, flat(vectors.iter())).reshape([vectors.len(), 3])
}

/// Rows of N vectors as an array `[F, N, 3]`.
pub fn rows<'py, 'a>(
    py: Python<'py>,
    n: usize,
    rows: impl ExactSizeIterator<Item = &'a [DVec3]>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let frames = rows.len();
    PyArray1::from_vec(py, rows.flat_map(|r| flat(r.iter())).collect()).reshape([frames, n, 3])
}

/// Rows of N numbers as an array `[F, N]`.
pub fn table<'py, T: numpy::Element>(
    py: Python<'py>,
    frames: usize,
    n: usize,
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_vec(py, values).reshape([frames, n])
}

/// Triangles as an array `[T, 3]`.
pub fn triangles<'py>(py: Python<'py>, all: &[[u32; 3]]) -> PyResult<Bound<'py, PyArray2<u32>>> {
    PyArray1::from_vec(py, all.concat()).reshape([all.len(), 3])
}

/// An array-like argument as C-ordered numbers, with its shape; a size of `wanted` that is `None` may be any.
fn read<'py, T: numpy::Element + Copy>(
    given: &Bound<'py, PyAny>,
    name: &str,
    wanted: &[Option<usize>],
    dtype: &str,
) -> PyResult<(Vec<usize>, Vec<T>)> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let unreadable = |e: PyErr| argument(py, name, format!("is no array of numbers ({})", e.value(py)));
    let mut given = numpy.call_method1("asanyarray", (given,)).map_err(unreadable)?;
    // Text, dates, complex numbers and objects (None among them) would become numbers that nobody meant.
    let kind: String = given.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["b", "i", "u", "f"].contains(&kind.as_str()) {
        let dtype = given.getattr("dtype")?;
        return Err(argument(py, name, format!("is no array of real numbers (its dtype is {dtype})")));
    }
    // What is masked was not seen.
    if given.is_instance(&numpy.getattr("ma")?.getattr("MaskedArray")?)? {
        given = given.call_method1("astype", ("float64",))?.call_method1("filled", (f64::NAN,))?;
    }
    let options = PyDict::new(py);
    options.set_item("dtype", dtype)?;
    let made = numpy.call_method("ascontiguousarray", (given,), Some(&options)).map_err(unreadable)?;
    let array = made.cast_into::<PyArrayDyn<T>>().map_err(|e| argument(py, name, e.to_string()))?;
    let shape = array.shape().to_vec();
    let fits = shape.len() == wanted.len() && shape.iter().zip(wanted).all(|(s, w)| w.is_none_or(|w| w == *s));
    if !fits {
        let text = |sizes: Vec<String>| match &sizes[..] {
            [one] => format!("({one},)"),
            all => format!("({})", all.join(", ")),
        };
        let found = text(shape.iter().map(ToString::to_string).collect());
        let wanted = text(wanted.iter().map(|w| w.map_or("any".into(), |w| w.to_string())).collect());
        return Err(argument(py, name, format!("has shape {found}, expected {wanted}")));
    }
    Ok((shape, array.to_vec().map_err(|e| argument(py, name, e.to_string()))?))
}

/// Numbers of an argument that is like an array.
pub fn numbers(given: &Bound<'_, PyAny>, name: &str, wanted: &[Option<usize>]) -> PyResult<(Vec<usize>, Vec<f64>)> {
    read(given, name, wanted, "float64")
}

/// Flags of an argument that is like an array.
pub fn flags(given: &Bound<'_, PyAny>, name: &str, wanted: &[Option<usize>]) -> PyResult<Vec<bool>> {
    Ok(read(given, name, wanted, "bool")?.1)
}

/// Numbers, three by three.
pub fn by_three(numbers: &[f64]) -> Vec<DVec3> {
    numbers.chunks_exact(3).map(DVec3::from_slice).collect()
}
