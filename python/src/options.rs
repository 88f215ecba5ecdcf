//! Arguments that several functions share.

use crate::errors::argument;
use crate::scene::Scene;
use palpate::{Backend, Experiment};
use palpate_model::observation::ReadingKind;
use palpate_model::scene::Optimizer;
use pyo3::prelude::*;
use std::ops::RangeInclusive;

/// What computes, by its name.
pub fn backend(py: Python<'_>, name: &str) -> PyResult<Backend> {
    let all = [Backend::Auto, Backend::Cpu, Backend::Gpu];
    let found = all.into_iter().find(|b| b.name() == name);
    found.ok_or_else(|| argument(py, "backend", format!("\"{name}\" is not known; allowed: \"auto\", \"cpu\", \"gpu\"")))
}

/// An optimiser by its name.
pub fn optimizer(py: Python<'_>, name: &str) -> PyResult<Optimizer> {
    let all = Optimizer::ALL.map(|(n, _)| format!("\"{n}\"")).join(", ");
    let found = Optimizer::ALL.into_iter().find(|(n, _)| *n == name).map(|(_, o)| o);
    found.ok_or_else(|| argument(py, "optimizer", format!("\"{name}\" is not known; allowed: {all}")))
}

/// Kinds of readings by the names that scenes have for them: one, or a list of several.
pub fn kinds(given: &Bound<'_, PyAny>) -> PyResult<Vec<ReadingKind>> {
    let py = given.py();
    let wrong = || argument(py, "cost", "must be the name of a cost or a list of such");
    let names = match given.extract::<String>() {
        Ok(one) => vec![one],
        Err(_) => given.extract::<Vec<String>>().map_err(|_| wrong())?,
    };
    if names.is_empty() {
        return Err(wrong());
    }
    let all = [
        ("sparse-surface", ReadingKind::Depth),
        ("markers", ReadingKind::Marker),
        ("points", ReadingKind::Track),
        ("displacements", ReadingKind::Displacement),
    ];
    let known = |name: &String| {
        let found = all.iter().find(|(n, _)| n == name).map(|(_, k)| *k);
        let allowed = all.map(|(n, _)| format!("\"{n}\"")).join(", ");
        found.ok_or_else(|| argument(py, "cost", format!("\"{name}\" is not known; allowed: {allowed}")))
    };
    names.iter().map(known).collect()
}

/// A whole number in a range, as on the command line.
pub fn count(py: Python<'_>, name: &str, given: Option<i64>, allowed: RangeInclusive<i64>) -> PyResult<Option<usize>> {
    match given {
        Some(n) if !allowed.contains(&n) => {
            let text = format!("{n} must be a whole number from {} to {}", allowed.start(), allowed.end());
            Err(argument(py, name, text))
        }
        // It is in a range that begins at zero or above.
        other => Ok(other.map(|n| n as usize)),
    }
}

/// One scene, or a list of several.
pub fn experiments(scenes: &Bound<'_, PyAny>) -> PyResult<Vec<Experiment>> {
    if let Ok(one) = scenes.cast::<Scene>() {
        return Ok(vec![one.get().experiment.as_ref().clone()]);
    }
    let wrong = || argument(scenes.py(), "scene", "must be a palpate.Scene or a list of them");
    let mut all = Vec::new();
    for s in scenes.try_iter().map_err(|_| wrong())? {
        all.push(s?.cast::<Scene>().map_err(|_| wrong())?.get().experiment.as_ref().clone());
    }
    Ok(all)
}
