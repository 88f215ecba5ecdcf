//! The measured beam at rest under its own weight, 52 and 102 g, two runs each: one quasi-static fit of all states, of two, or of every other one.

use super::{Figures, MODULUS, RMS, TEST, UNMOVED};
use crate::real::{found, open};
use palpate::{Backend, FitOptions};
use std::path::Path;

const SCENE: &str = "beam-quasi-static";
const COST: &str = "cost      = \"markers\"\n";

/// A change of the scene: what it says, and what it is to say.
type Change = (&'static str, &'static str);

/// Only the two runs of one load.
pub const LOADS: [&[Change]; 3] = [
    &[(COST, "cost = \"markers\"\nframes = { from = -0.5, to = 1.5 }\n")],
    &[(COST, "cost = \"markers\"\nframes = { from = 1.5, to = 3.5 }\n")],
    &[(COST, "cost = \"markers\"\nframes = { from = 3.5, to = 5.5 }\n")],
];

/// The first run of each load; the second ones are what the fit is tried on.
pub const HALF: &[Change] = &[("iterations = 20\n", "iterations = 20\nframes = { train = { every = 2 } }\n")];

/// Fits the modulus.
pub fn run(data: &Path, changes: &[Change]) -> Result<Figures, String> {
    let e = open(data, SCENE, changes).map_err(|e| e.to_string())?;
    let options = FitOptions { backend: Backend::Cpu, ..FitOptions::default() };
    let mut fitted = e.fit(options).map_err(|e| e.to_string())?;
    fitted.check_grid(std::slice::from_ref(&e), Backend::Cpu, &palpate::Interrupt::default());
    let (rms, noise, _) = fitted.residual();
    let mut figures = Figures::new();
    let mut say = |name: &str, x: f64| {
        figures.insert(name.into(), x);
    };
    say(MODULUS, 1e-3 * found(&fitted, "material.youngs_modulus"));
    say("its standard error [kPa]", 1e-3 * fitted.result.parameters[0].standard_error.unwrap_or(f64::NAN));
    say(RMS, 1e3 * rms);
    say("rms of noise and systematic errors [mm]", 1e3 * noise);
    say("evaluations", fitted.result.evaluations as f64);
    say("seconds of the fit", fitted.result.seconds);
    for f in &fitted.after[0].frames {
        say(&format!("rms of frame {} s [mm]", f.time), 1e3 * f.rms);
    }
    if let Some(h) = fitted.held_out {
        say(TEST, 1e3 * h.test.rms);
        say(UNMOVED, 1e3 * h.test.unmoved.unwrap_or(f64::NAN));
        say("rms of the other frames, at rest [mm]", 1e3 * h.test.rest.unwrap_or(f64::NAN));
    }
    if let Some(grid) = &fitted.grid {
        say("finer cells move E by [kPa]", 1e-3 * grid.numbers[0].drift);
    }
    Ok(figures)
}
