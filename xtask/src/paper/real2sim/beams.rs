//! The measured beams (acceptance A8 and A9): E of each alone by elements, what each says of the other and of both at rest under known loads, and
//! which law of damping says of both beams at once what was measured, 0.053 of critical at 7.5 Hz and 0.060 at 4.3 Hz. Beside them the
//! swinging cantilever of MoldStar.

use super::Figures;
use crate::real::diagnoses::{self, STATES};
use crate::real::studies::{VALUES, stated};
use crate::real::tracks::track;
use crate::real::{found, height_at_rest, open, swings};
use palpate::{Experiment, FitOptions, Fitted};
use std::path::Path;

const SCENES: [(&str, f64); 2] = [("beam-gravity", 7.5), ("beam-load52", 4.3)];
const MARKER: &str = "tip1";

/// What the beams are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Made {
    /// Cells of a centimetre.
    Cells,
    /// Quadratic tetrahedra, two through the beam's thickness.
    Tetrahedra,
}

/// A law of damping for both beams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// In proportion to stiffness and rate.
    Rayleigh,
    /// The material's power law.
    Viscosity,
    /// The same loss at any rate.
    Structural,
}

type Change = (String, String);

/// What a scene says of its cells, and of tetrahedra in their place.
pub(super) const CELLS: &str = "cell_size = 0.01 ";
pub(super) const TETRAHEDRA: &str = "discretisation = \"tetrahedra\"\nedge_length = 0.015 ";

fn beam(data: &Path, scene: &str, changes: &[Change]) -> Result<Experiment, String> {
    let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    open(data, scene, &changes).map_err(|e| e.to_string())
}

fn material(made: Made) -> Vec<Change> {
    let mut all: Vec<Change> = vec![("\"corotated-linear\"".into(), "\"neo-hookean\"".into())];
    if made == Made::Tetrahedra {
        all.push((CELLS.into(), TETRAHEDRA.into()));
    }
    all
}

/// Each beam alone, what it says of the other, and of the beam at rest under loads.
pub fn alone(data: &Path, made: Made) -> Result<Figures, String> {
    let mut out = Figures::new();
    let mut found_values = Vec::new();
    for (scene, guess) in SCENES {
        let e = beam(data, scene, &material(made))?;
        let fitted = e.fit(FitOptions::default()).map_err(|e| e.to_string())?;
        swing(&e, &fitted, scene, (MARKER, guess), &mut out)?;
        found_values.push(VALUES.map(|path| found(&fitted, path)));
    }
    out.insert("E, second over first".into(), found_values[1][0] / found_values[0][0]);
    for (from, to) in [(0, 1), (1, 0)] {
        let (scene, guess) = SCENES[to];
        let e = beam(data, scene, &[material(made), stated(scene, found_values[from]).map_err(|e| e.to_string())?].concat())?;
        let fitted = e.fit(FitOptions::default()).map_err(|e| e.to_string())?;
        swing(&e, &fitted, &format!("{scene} by the other's numbers"), (MARKER, guess), &mut out)?;
    }
    for (_, load) in STATES.into_iter().step_by(2) {
        for (values, (scene, _)) in found_values.iter().zip(SCENES) {
            let name = format!("sag at rest under {:.0} g over measured, by {scene}", 1e3 * load);
            out.insert(name, at_rest(data, made, load, values[0])?);
        }
    }
    Ok(out)
}

/// What a fit says of a swing beside what was measured.
fn swing(e: &Experiment, fitted: &Fitted, name: &str, (marker, guess): (&str, f64), out: &mut Figures) -> Result<(), String> {
    let (seen, simulated) = swings(e, &fitted.result.theta[0], marker, guess).map_err(|e| e.to_string())?;
    let mut say = |what: &str, x: f64| {
        out.insert(format!("{name}: {what}"), x);
    };
    if let Some(p) = fitted.result.parameters.iter().find(|p| p.path == VALUES[0]) {
        say("E [kPa]", 1e-3 * p.value);
        say("its standard error [kPa]", 1e-3 * p.standard_error.unwrap_or(f64::NAN));
    }
    say("rms [mm]", 1e3 * fitted.residual().0);
    say("frequency off [%]", 100.0 * (simulated.frequency / seen.frequency - 1.0));
    say("damping ratio over measured", simulated.damping_ratio() / seen.damping_ratio());
    say("nodes", e.plan().body.nodes.len() as f64);
    say("evaluations", fitted.result.runs[fitted.result.best].evaluations as f64);
    say("seconds", fitted.result.seconds);
    Ok(())
}

/// How far the tip hangs over how far it was measured to, in the states of a load, with a modulus [Pa].
fn at_rest(data: &Path, made: Made, load: f64, modulus: f64) -> Result<f64, String> {
    let (mut hangs, mut hung) = (0.0, 0.0);
    for state in STATES.into_iter().filter(|s| s.1 == load) {
        let (scene, changes) = diagnoses::at_rest(state);
        let stiff = ("youngs_modulus = 2.5e5".into(), format!("youngs_modulus = {modulus}"));
        let e = beam(data, scene, &[material(made), changes, vec![stiff]].concat())?;
        for marker in ["tip1", "tip2", "tip3"] {
            let rest = height_at_rest(&e, marker);
            let seen = track(&e, &e.plan().theta, marker).map_err(|e| e.to_string())?;
            hangs += seen.iter().map(|s| rest - s.simulated.dot(e.up())).sum::<f64>();
            hung += seen.iter().map(|s| rest - s.seen.dot(e.up())).sum::<f64>();
        }
    }
    Ok(hangs / hung)
}

/// Poisson's ratio free beside the others: a bending beam says nothing of it, and the fit has to say so.
pub fn poisson(data: &Path) -> Result<Figures, String> {
    const DAMPING: &str = "path   = \"material.stiffness_damping\"";
    let more = "path   = \"material.poisson_ratio\"\nstart  = 0.4\nbounds = [0.0, 0.499]\n\n[[fit.parameter]]\n";
    let (scene, _) = SCENES[0];
    let e = beam(data, scene, &[material(Made::Cells), vec![(DAMPING.into(), format!("{more}{DAMPING}"))]].concat())?;
    let fitted = e.fit(FitOptions::default()).map_err(|e| e.to_string())?;
    println!("{}", fitted.verdict);
    fitted.warnings.iter().for_each(|w| println!("  {w}"));
    let told = fitted.warnings.iter().filter(|w| w.contains("poisson_ratio") && w.contains("not determined")).count();
    let ratio = fitted.result.parameters.iter().find(|p| p.path == "material.poisson_ratio");
    let mut out = Figures::new();
    out.insert("Poisson's ratio".into(), found(&fitted, "material.poisson_ratio"));
    out.insert("its standard error".into(), ratio.and_then(|p| p.standard_error).unwrap_or(f64::NAN));
    out.insert("warnings that it is not determined".into(), told as f64);
    out.insert("E [kPa]".into(), 1e-3 * found(&fitted, VALUES[0]));
    Ok(out)
}

/// The cantilever of MoldStar 15 with a head, whose points were taken from its silhouette.
pub fn moldstar(data: &Path, made: Made) -> Result<Figures, String> {
    let mut out = Figures::new();
    let scene = "cantilever-moldstar-oscillating";
    let e = beam(data, scene, &material(made))?;
    let fitted = e.fit(FitOptions::default()).map_err(|e| e.to_string())?;
    swing(&e, &fitted, "moldstar", ("head_outer_top", 2.6), &mut out)?;
    Ok(out)
}

/// Both beams at once with one law.
pub fn together(data: &Path, made: Made, law: Law) -> Result<Figures, String> {
    let shared =
        "per_scene = true      # of this recording alone, also in a joint fit\n\n[[fit.parameter]]\npath   = \"time.start\"";
    let damping = "path   = \"material.stiffness_damping\"\nstart  = 3.0e-3\nbounds = [1.0e-6, 1.0]\n";
    let mut changes = material(made);
    // The damping is one for both beams, the start each one's own.
    changes.push((shared.into(), "\n[[fit.parameter]]\npath   = \"time.start\"".into()));
    match law {
        Law::Rayleigh => {}
        Law::Viscosity => {
            changes.push(("stiffness_damping = 1.0e-3".into(), "viscosity = { coefficient = 200.0, exponent = 0.6 }".into()));
            changes.push((
                damping.into(),
                "path   = \"material.viscosity.coefficient\"\nstart  = 200.0\nbounds = [1.0, 1.0e5]\n\n[[fit.parameter]]\n\
                 path   = \"material.viscosity.exponent\"\nstart  = 0.6\nbounds = [0.1, 2.0]\n"
                    .into(),
            ));
        }
        Law::Structural => {
            changes.push(("stiffness_damping = 1.0e-3".into(), String::new()));
            changes
                .push(("[observation]".into(), "[[effect]]\nkind = \"structural-damping\"\nloss = 0.1\n\n[observation]".into()));
            changes.push((damping.into(), "path   = \"effect.0.loss\"\nstart  = 0.1\nbounds = [1.0e-3, 2.0]\n".into()));
        }
    }
    let beams = SCENES.iter().map(|(scene, _)| beam(data, scene, &changes)).collect::<Result<Vec<_>, _>>()?;
    let fitted = palpate::fit(&beams, FitOptions::default()).map_err(|e| e.to_string())?;
    let mut out = Figures::new();
    out.insert("E [kPa]".into(), 1e-3 * found(&fitted, "material.youngs_modulus"));
    out.insert("rms of both [mm]".into(), 1e3 * fitted.residual().0);
    for ((e, theta), (scene, guess)) in beams.iter().zip(&fitted.result.theta).zip(SCENES) {
        let (seen, simulated) = swings(e, theta, MARKER, guess).map_err(|e| e.to_string())?;
        out.insert(format!("{scene}: damping ratio"), simulated.damping_ratio());
        out.insert(format!("{scene}: damping ratio over measured"), simulated.damping_ratio() / seen.damping_ratio());
        out.insert(format!("{scene}: frequency off [%]"), 100.0 * (simulated.frequency / seen.frequency - 1.0));
    }
    let numbers =
        ["material.viscosity.coefficient", "material.viscosity.exponent", "effect.0.loss", "material.stiffness_damping"];
    for p in fitted.result.parameters.iter().filter(|p| numbers.contains(&p.path.as_str())) {
        out.insert(p.path.clone(), p.value);
    }
    Ok(out)
}
