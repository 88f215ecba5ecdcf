//! The measured beams (acceptance A8 and A9): E of each alone by elements and materials, and which law of damping says of both beams at once
//! what was measured, 0.053 of critical at 7.5 Hz and 0.060 at 4.3 Hz.

use super::Figures;
use crate::real::{found, open, swings};
use palpate::{Experiment, FitOptions};
use std::path::Path;

const SCENES: [(&str, f64); 2] = [("beam-gravity", 7.5), ("beam-load52", 4.3)];
const MARKER: &str = "tip1";

/// What the beams are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Made {
    /// Cells of a centimetre.
    Cells,
    /// Quadratic tetrahedra with edges of a centimetre.
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

type Change = (&'static str, String);

fn beam(data: &Path, scene: &str, changes: &[Change]) -> Result<Experiment, String> {
    let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (*a, b.as_str())).collect();
    open(data, scene, &changes).map_err(|e| e.to_string())
}

fn material(made: Made) -> Vec<Change> {
    let mut all = vec![("\"corotated-linear\"", "\"neo-hookean\"".to_string())];
    if made == Made::Tetrahedra {
        all.push(("cell_size = 0.01 ", "discretisation = \"tetrahedra\"\nedge_length = 0.01 ".into()));
    }
    all
}

/// Each beam alone.
pub fn alone(data: &Path, made: Made) -> Result<Figures, String> {
    let mut out = Figures::new();
    let mut moduli = Vec::new();
    for (scene, guess) in SCENES {
        let e = beam(data, scene, &material(made))?;
        let fitted = e.fit(FitOptions::default()).map_err(|e| e.to_string())?;
        let (seen, simulated) = swings(&e, &fitted.result.theta[0], MARKER, guess).map_err(|e| e.to_string())?;
        let mut say = |name: &str, x: f64| {
            out.insert(format!("{scene}: {name}"), x);
        };
        let modulus = found(&fitted, "material.youngs_modulus");
        say("E [kPa]", 1e-3 * modulus);
        say("rms [mm]", 1e3 * fitted.residual().0);
        say("frequency off [%]", 100.0 * (simulated.frequency / seen.frequency - 1.0));
        say("damping ratio over measured", simulated.damping_ratio() / seen.damping_ratio());
        say("nodes", e.plan().body.nodes.len() as f64);
        say("seconds", fitted.result.seconds);
        moduli.push(modulus);
    }
    out.insert("E, second over first".into(), moduli[1] / moduli[0]);
    Ok(out)
}

/// Both beams at once with one law.
pub fn together(data: &Path, law: Law) -> Result<Figures, String> {
    let shared =
        "per_scene = true      # of this recording alone, also in a joint fit\n\n[[fit.parameter]]\npath   = \"time.start\"";
    let damping = "path   = \"material.stiffness_damping\"\nstart  = 3.0e-3\nbounds = [1.0e-6, 1.0]\n";
    let mut changes = material(Made::Cells);
    // The damping is one for both beams, the start each one's own.
    changes.push((shared, "\n[[fit.parameter]]\npath   = \"time.start\"".into()));
    match law {
        Law::Rayleigh => {}
        Law::Viscosity => {
            changes.push(("stiffness_damping = 1.0e-3", "viscosity = { coefficient = 200.0, exponent = 0.6 }".into()));
            changes.push((
                damping,
                "path   = \"material.viscosity.coefficient\"\nstart  = 200.0\nbounds = [1.0, 1.0e5]\n\n[[fit.parameter]]\n\
                 path   = \"material.viscosity.exponent\"\nstart  = 0.6\nbounds = [0.1, 2.0]\n"
                    .into(),
            ));
        }
        Law::Structural => {
            changes.push(("stiffness_damping = 1.0e-3", String::new()));
            changes.push(("[observation]", "[[effect]]\nkind = \"structural-damping\"\nloss = 0.1\n\n[observation]".into()));
            changes.push((damping, "path   = \"effect.0.loss\"\nstart  = 0.1\nbounds = [1.0e-3, 2.0]\n".into()));
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
