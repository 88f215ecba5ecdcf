//! What went wrong as an exception that knows its file, line, key and hint. The classes are Python's own, in `palpate/_errors.py`.

use palpate::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Whose fault it is, by name of its class.
fn class_of(e: &Error, scene: Option<&Path>) -> &'static str {
    match e {
        Error::File(f) if f.file == Path::new("<arrays>") => "RecordingError",
        Error::File(f) if scene.is_some_and(|s| s != f.file && palpate_io::read_scene(s).is_ok()) => "RecordingError",
        Error::File(_) | Error::Scene { .. } => "SceneError",
        Error::Option { .. } | Error::Input(_) => "ArgumentError",
        _ if e.failure().is_some() => "SimulationError",
        Error::Build(_) | Error::Device(_) => "SimulationError",
        _ => "ComputationError",
    }
}

/// An exception of the package's class `name` with these attributes.
fn exception(
    py: Python<'_>,
    name: &str,
    message: &str,
    fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>,
) -> PyResult<PyErr> {
    let class = py.import("palpate._errors")?.getattr(name)?;
    let attributes = PyDict::new(py);
    fill(&attributes)?;
    Ok(PyErr::from_value(class.call((message,), Some(&attributes))?))
}

/// An error of a scene, or of what was asked of the one in the file `scene`.
pub fn of_scene(py: Python<'_>, e: &Error, scene: Option<&Path>) -> PyErr {
    let made = exception(py, class_of(e, scene), &e.to_string(), |d| {
        d.set_item("file", e.file().map(|f| f.display().to_string()))?;
        d.set_item("line", e.line())?;
        d.set_item("key", e.key())?;
        d.set_item("hint", e.hint().map(|h| h.into_owned()))?;
        if let Some(f) = e.failure() {
            d.set_item("time", f.time)?;
        }
        Ok(())
    });
    made.unwrap_or_else(|e| e)
}

/// An error that tells of no file beside those it names.
pub fn of(py: Python<'_>, e: impl Into<Error>) -> PyErr {
    of_scene(py, &e.into(), None)
}

/// A wrong argument of a function, with its name.
pub fn argument(py: Python<'_>, name: &str, message: impl AsRef<str>) -> PyErr {
    let made = exception(py, "ArgumentError", &format!("{name}: {}", message.as_ref()), |d| d.set_item("key", name));
    made.unwrap_or_else(|e| e)
}
