//! A bar that droops by a share of its length and swings about that shape, plucked by a small velocity; its modulus is started from vibrations with
//! guesses of a hundredth and a hundred times.

use super::{Figures, START, off};
use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions};
use std::ops::ControlFlow;
use std::path::Path;

/// Guesses over the truth.
const GUESSES: [f64; 3] = [0.01, 1.0, 100.0];
/// Noise of a coordinate [m].
const NOISE: f64 = 5e-4;
const DURATION: f64 = 2.0;

fn bar(modulus: f64, damping: f64) -> String {
    format!(
        "format = \"scene/1\"\ntitle = \"Drooping bar\"\n\n[object]\nshape = {{ box = {{ min = [0, -0.02, -0.02], max = [0.2, 0.02, 0.02] }} }}\ncell_size = 0.01\n\n\
         [material]\ndensity = 1000.0\nyoungs_modulus = {modulus:e}\npoisson_ratio = 0.4\nstiffness_damping = {damping}\n\n[[clamp]]\n\
         box = {{ min = [-0.01, -0.1, -0.1], max = [0.0001, 0.1, 0.1] }}\n\n[initial]\nstate = \"static-equilibrium\"\nangular_velocity = [0, 0.4, 0]\n\
         pivot = [0, 0, 0]\n\n[time]\nstep = {}\nduration = {DURATION}\n",
        1.0 / 120.0
    )
}

/// Records the swing on finer cells and shorter steps, and starts fits from every guess.
pub fn run(folder: &Path, sag: f64) -> Result<Figures, String> {
    let fail = |e: &dyn std::fmt::Display| e.to_string();
    // Tip of a cantilever of length L and thickness d: ρ g 12 L⁴/(8 E d²).
    let modulus = 1000.0 * 9.81 * 12.0 * 0.2f64.powi(4) / (8.0 * 0.04f64.powi(2) * sag * 0.2);
    let truth = Experiment::from_toml(&bar(modulus, 0.002), folder.join("truth.toml")).map_err(|e| fail(&e))?;
    let truth = truth.finer(1.5, 2.0).map_err(|e| fail(&e))?;
    let point = |k: usize| DVec3::new(0.02 + 0.012 * k as f64, 0.02 * [-1.0, 1.0][k % 2], 0.0);
    let observers = Observers {
        cameras: Vec::new(),
        markers: Vec::new(),
        points: (0..15).map(point).collect(),
        displacements: false,
        times: (0..=(DURATION * 30.0) as usize).map(|k| k as f64 / 30.0).collect(),
        sensor: Sensor { noise: NOISE, dropout: 0.0, depth_scale: 0.001, seed: 3 },
    };
    let seen = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).map_err(|e| fail(&e))?;
    let (mut figures, mut worst, mut found) = (Figures::new(), 0.0f64, 0);
    for guess in GUESSES {
        let text = bar(guess * modulus, 0.0005)
            + "\n[fit]\niterations = 0\nwarm_start = \"modal\"\n\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [1e1, 1e9]\n\n\
               [[fit.parameter]]\npath = \"material.stiffness_damping\"\nbounds = [1e-6, 0.1]\n";
        let e = Experiment::from_toml(&text, folder.join("fit.toml")).map_err(|e| fail(&e))?;
        let e = e.measured(seen.clone()).map_err(|e| fail(&e))?;
        let fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| fail(&e))?;
        println!("{}", fitted.notes.join("\n"));
        let start = &fitted.result.runs[0].start;
        worst = worst.max(off(start[0], modulus));
        found += usize::from(fitted.notes.iter().any(|n| n.starts_with("starts by vibrations")));
        figures.insert(format!("from {guess} E: E over the truth"), start[0] / modulus);
        figures.insert(format!("from {guess} E: damping over the truth"), start[1] / 0.002);
    }
    figures.insert(START.into(), worst);
    figures.insert("starts that found it".into(), found as f64);
    figures.insert("modulus [kPa]".into(), 1e-3 * modulus);
    Ok(figures)
}
