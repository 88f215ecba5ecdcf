//! The measured cantilever of two materials that hangs in front of one depth camera: a modulus a cell with a prior, beside a fit of two parts.

use super::beams::{CELLS, Made, TETRAHEDRA};
use super::{Figures, common, mean, moduli, posterior};
use crate::real::open;
use palpate::{Backend, Experiment, FitOptions, Fitted};
use std::path::Path;

const SCENE: &str = "cantilever-two-materials-hanging";
/// Its free number, which the fields stand for.
const FREE: &str = "[[fit.parameter]]\npath   = \"material.youngs_modulus\"\nstart  = 1.0e5\nbounds = [1.0e4, 1.0e7]\n";
const GAUSS_NEWTON: &str = "optimizer  = \"gauss-newton\"\n";
/// The bar between the clamp and the free head [m].
const BAR: [f64; 2] = [-0.07, 0.07];
/// Width of a slice of the profile along the bar [m].
const SLICE: f64 = 0.01;

fn fit(data: &Path, made: Made, field: &str) -> Result<(Experiment, Fitted), String> {
    let free = format!("\n[[fit.parameter]]\npath = \"field.0\"\nbounds = [0.05, 50]\n{field}");
    let mut changes = vec![(GAUSS_NEWTON, ""), (FREE, &free)];
    if made == Made::Tetrahedra {
        changes.push((CELLS, TETRAHEDRA));
    }
    let e = open(data, SCENE, &changes).map_err(|e| e.to_string())?;
    let fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| e.to_string())?;
    Ok((e, fitted))
}

/// Fits two parts, and the field of a kind of prior.
pub fn run(data: &Path, kind: &str, made: Made) -> Result<Figures, String> {
    let field = "\n[[field]]\npath = \"material.youngs_modulus\"\n";
    let parts = "basis = \"regions\"\nblend = \"nearest\"\nregions = [{ center = [-0.05, 0, 0], radius = 0.01 }, { center = [0.05, 0, 0], radius = 0.01 }]\n";
    let (_, two) = fit(data, made, &format!("{field}{parts}"))?;
    let (e, fitted) = fit(data, made, &format!("{field}basis = \"cells\"\nprior = {{ kind = \"{kind}\" }}\n"))?;
    let mut figures = common(&e, &fitted)?;
    let p = posterior(&fitted)?;
    let (modulus, volume) = moduli(e.plan(), &fitted);
    let x: Vec<f64> = e.plan().body.middles().map(|m| m.x).collect();
    let ln: Vec<f64> = modulus.iter().map(|m| m.ln()).collect();
    let mut say = |name: &str, x: f64| {
        figures.insert(name.into(), x);
    };
    say("residual of two parts [mm]", 1e3 * two.residual().0);
    for (k, name) in ["free", "clamped"].iter().enumerate() {
        let part = &two.result.parameters[k];
        say(&format!("two parts: E of the {name} half [kPa]"), 1e2 * part.value);
        say("two parts: its standard error [kPa]", 1e2 * part.standard_error.unwrap_or(f64::NAN));
    }
    let open: Vec<f64> = p.undetermined.iter().map(|u| f64::from(u8::from(*u))).collect();
    let mut profile = Vec::new();
    for k in 0..((BAR[1] - BAR[0]) / SLICE).round() as usize {
        let low = BAR[0] + SLICE * k as f64;
        let here = |c: usize| x[c] >= low && x[c] < low + SLICE;
        let value = mean(&ln, &volume, here);
        profile.push((low + 0.5 * SLICE, value));
        println!(
            "  x = {:+.3} m: E {:.1} kPa, sd {:.2}, gain {:.2}",
            low + 0.5 * SLICE,
            1e-3 * value.exp(),
            mean(&p.deviation, &volume, here),
            mean(&p.gain, &volume, here)
        );
    }
    for (name, from, to) in
        [("free half of the bar", BAR[0], 0.0), ("clamped half of the bar", 0.0, BAR[1]), ("free head", -0.1, BAR[0])]
    {
        let here = |c: usize| x[c] >= from && x[c] < to;
        let chosen = (0..x.len()).filter(|c| here(*c)).map(|c| 1e-3 * modulus[c]);
        let (least, most) = chosen.fold((f64::INFINITY, 0.0f64), |(a, b), e| (a.min(e), b.max(e)));
        say(&format!("{name}: E, geometric mean [kPa]"), 1e-3 * mean(&ln, &volume, here).exp());
        say(&format!("{name}: E, least of cells [kPa]"), least);
        say(&format!("{name}: E, most of cells [kPa]"), most);
        say(&format!("{name}: undetermined share"), mean(&open, &volume, here));
        say(&format!("{name}: mean sd"), mean(&p.deviation, &volume, here));
    }
    // Where the profile rises through the mean of its ends, from the clamp on.
    let half = 0.5 * (profile[0].1 + profile[profile.len() - 1].1);
    let rise = profile.windows(2).rev().find(|w| w[0].1 >= half && w[1].1 < half);
    let step = rise.map_or(f64::NAN, |w| w[1].0 + (half - w[1].1) / (w[0].1 - w[1].1) * (w[0].0 - w[1].0));
    say("step of E at x [mm]", 1e3 * step);
    Ok(figures)
}
