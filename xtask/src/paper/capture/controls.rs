//! The paper's bar, 20 × 5 × 5 cells with one, two or eight control regions along it, moved in three ways for 250 frames each; the places of all its
//! nodes are known. One fit of all three motions finds every region's modulus and both dampings.

use super::{DAMPING, EVALUATIONS, Figures, SECONDS, WORST, off};
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions, fit};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// What the recording is computed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// Cells and steps half as large.
    Finer,
    /// The fit's own.
    Same,
}

/// Modulus of each region from the clamp on [Pa]: the paper's numbers, its bar being stiff where it is held.
fn moduli(controls: usize) -> Vec<f64> {
    match controls {
        1 => vec![6.8e5],
        2 => vec![2e6, 3e5],
        _ => vec![1e7, 2e6, 1e6, 6.8e5, 2e5, 7e4, 3e4, 1e4],
    }
}

/// Damping by mass [1/s] and by stiffness [s].
const RAYLEIGH: [f64; 2] = [0.02, 0.001];
const FRAMES: usize = 250;
const RATE: f64 = 60.0;
/// Noise of a coordinate [m]: the paper's bar has none, and a recording must state some.
const NOISE: f64 = 1e-4;
/// The three motions: gravity, and spin and velocity at the start, where the held end has neither.
const MOTIONS: [&str; 3] = [
    "[world]\ngravity = [0, 0, -9.81]\n",
    "[world]\ngravity = [0, 0, 0]\n\n[initial]\nangular_velocity = [0, 6, 0]\npivot = [0, 0.05, 0.05]\n",
    "[world]\ngravity = [0, 0, 0]\n\n[initial]\nangular_velocity = [12, 0, 4]\npivot = [0, 0.05, 0.05]\n",
];

fn bar(motion: usize, values: &[f64], rayleigh: [f64; 2]) -> String {
    let mut text = String::from(
        "format = \"scene/1\"\ntitle = \"Bar of control regions\"\n\n[object]\nshape = { box = { min = [0, 0, 0], max = [0.4, 0.1, 0.1] } }\ncell_size = 0.02\n\n\
         [[clamp]]\nbox = { min = [-0.01, -0.01, -0.01], max = [0.0001, 0.11, 0.11] }\n\n",
    );
    text += MOTIONS[motion];
    let duration = FRAMES as f64 / RATE;
    let _ = write!(
        text,
        "\n[time]\nduration = {duration}\nstep = {}\n\n[material]\ndensity = 1000.0\npoisson_ratio = 0.4\nyoungs_modulus = 1e5\nmass_damping = {}\n\
         stiffness_damping = {}\n\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"regions\"\nblend = \"axis\"\nregions = [",
        1.0 / RATE,
        rayleigh[0],
        rayleigh[1]
    );
    let n = values.len();
    for (k, v) in values.iter().enumerate() {
        let x = 0.4 * (k as f64 + 0.5) / n as f64;
        let _ = write!(text, "{{ center = [{x}, 0.05, 0.05], radius = 0.02, value = {} }}, ", v / 1e5);
    }
    text + "]\n"
}

/// Records the truth and fits it from one modulus everywhere.
pub fn run(folder: &Path, controls: usize, truth: Truth) -> Result<Figures, String> {
    let fail = |e: &dyn std::fmt::Display| e.to_string();
    let values = moduli(controls);
    let mut experiments = Vec::new();
    for motion in 0..MOTIONS.len() {
        let own = Experiment::from_toml(&bar(motion, &values, RAYLEIGH), folder.join("truth.toml")).map_err(|e| fail(&e))?;
        let fine = match truth {
            Truth::Same => own.clone(),
            Truth::Finer => own.finer(2.0, 2.0).map_err(|e| fail(&e))?,
        };
        let observers = Observers {
            cameras: Vec::new(),
            markers: Vec::new(),
            points: own.plan().body.nodes.clone(),
            displacements: false,
            times: (1..=FRAMES).map(|k| k as f64 / RATE).collect(),
            sensor: Sensor { noise: NOISE, dropout: 0.0, depth_scale: 0.001, seed: 7 + motion as u64 },
        };
        let mut seen = observe(&fine, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).map_err(|e| fail(&e))?;
        // Nodes lie all through the bar, whose middle is half its width deep.
        seen.points.iter_mut().for_each(|p| p.tolerance = Some(0.06));
        let name = format!("seen-{motion}");
        palpate_io::write_recording(folder.join(&name), &seen).map_err(|e| fail(&e))?;
        let start = vec![3e5; controls];
        let text = bar(motion, &start, [0.1, 0.005])
            + &format!(
                "\n[observation]\nrecording = \"{name}\"\ncost = [\"points\"]\n\n[fit]\niterations = 40\n\n[[fit.parameter]]\npath = \"field.0\"\nbounds = [0.01, 1000]\n\n\
                 [[fit.parameter]]\npath = \"material.mass_damping\"\n\n[[fit.parameter]]\npath = \"material.stiffness_damping\"\n"
            );
        experiments.push(Experiment::from_toml(&text, folder.join(format!("fit-{motion}.toml"))).map_err(|e| fail(&e))?);
    }
    let fitted = fit(&experiments, FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| fail(&e))?;
    println!("{}", fitted.verdict);
    let mut figures = Figures::new();
    let found = &fitted.result.parameters;
    let mut worst = (0.0f64, 0.0f64);
    for (k, truth) in values.iter().enumerate() {
        let value = 1e5 * found[k].value;
        let errors = found[k].standard_error.map_or(f64::NAN, |e| (value - truth).abs() / (1e5 * e));
        worst = (worst.0.max(off(value, *truth)), worst.1.max(errors));
        figures.insert(format!("E of region {} over the truth", k + 1), value / truth);
    }
    figures.insert(WORST.into(), worst.0);
    figures.insert("worst E, standard errors off".into(), worst.1);
    figures.insert("mass damping, off [%]".into(), off(found[controls].value, RAYLEIGH[0]));
    figures.insert(DAMPING.into(), off(found[controls + 1].value, RAYLEIGH[1]));
    figures.insert(EVALUATIONS.into(), fitted.result.runs[fitted.result.best].evaluations as f64);
    figures.insert(SECONDS.into(), fitted.result.seconds);
    figures.insert("nodes".into(), experiments[0].plan().body.nodes.len() as f64);
    figures.insert("residual [mm]".into(), 1e3 * fitted.residual().0);
    Ok(figures)
}
