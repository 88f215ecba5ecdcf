//! palpate as a module of Python: objects and arrays in, objects and arrays out.
//!
//! Invariant: this room translates. What is computed, checked and said is computed, checked and said by the crate `palpate`, so that a result
//! has the bits that the command line gives. The package's Python files (`palpate/`) add names, defaults and types.

mod arrays;
mod diagnosis;
mod errors;
mod fit;
mod objective;
mod options;
mod recording;
mod residuals;
mod scene;
mod simulation;
mod tracking;
mod watch;

use palpate::{Interrupt, Liveliness};
use pyo3::prelude::*;

/// Runs the command line `arguments` (the first is the program's name) and returns its exit code; Ctrl-C ends it in good order.
#[pyfunction]
#[pyo3(signature = (arguments, bars))]
fn command_line(py: Python<'_>, arguments: Vec<String>, bars: bool) -> PyResult<i32> {
    let alive = if bars { Liveliness::Bars } else { Liveliness::Silent };
    let work = |_: &watch::Voice, interrupt: &Interrupt| {
        palpate::cli::run(arguments, &mut std::io::stdout(), &mut std::io::stderr(), interrupt.clone(), alive)
    };
    // What was found until a Ctrl-C has been written, and the exit code says so.
    Ok(watch::run(py, None, work)?.0)
}

#[pymodule]
fn _palpate(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<scene::Scene>()?;
    m.add_class::<scene::Parameter>()?;
    m.add_class::<recording::Recording>()?;
    m.add_class::<simulation::Simulation>()?;
    m.add_class::<residuals::Residuals>()?;
    m.add_class::<fit::Fit>()?;
    m.add_class::<objective::Problem>()?;
    m.add_class::<diagnosis::Diagnosis>()?;
    m.add_class::<tracking::Track>()?;
    m.add_class::<watch::Progress>()?;
    m.add_function(wrap_pyfunction!(simulation::simulate, m)?)?;
    m.add_function(wrap_pyfunction!(fit::fit, m)?)?;
    m.add_function(wrap_pyfunction!(diagnosis::diagnose, m)?)?;
    m.add_function(wrap_pyfunction!(tracking::track, m)?)?;
    m.add_function(wrap_pyfunction!(command_line, m)?)
}
