//! A bar of two parts, held at one end or at both and shaken there, seen by nine markers with 1 mm of noise, and recorded on cells and steps of
//! two thirds. The field of its own cells is compared with the truth.

use super::{Figures, common, mean, moduli, posterior};
use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// Where it is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// At its soft end alone.
    One,
    /// At both.
    Both,
}

/// E left and right of the middle [Pa].
const PARTS: [f64; 2] = [6e4, 1.8e5];
/// The middle [m].
const MIDDLE: f64 = 0.1;
/// Noise of a coordinate [m].
const NOISE: f64 = 1e-3;
/// What the fit begins with [Pa].
const START: f64 = 1e5;
/// Time that is recorded [s], and its step.
const DURATION: f64 = 0.5;
const STEP: f64 = 1.0 / 120.0;

/// The bar with its clamps; `material` and what follows is left out.
fn bar(held: Held) -> String {
    let mut text = String::from(
        "format = \"scene/1\"\ntitle = \"Bar of two parts\"\n\n[object]\nshape = { box = { min = [0, 0, 0], max = [0.2, 0.03, 0.03] } }\ncell_size = 0.01\n\n\
         [[clamp]]\nbox = { min = [-0.01, -0.01, -0.01], max = [0.01, 0.04, 0.04] }\nmotion = \"shaken.csv\"\n\n",
    );
    if held == Held::Both {
        text += "[[clamp]]\nbox = { min = [0.19, -0.01, -0.01], max = [0.21, 0.04, 0.04] }\n\n";
    }
    let _ = write!(
        text,
        "[world]\ngravity = [0, 0, -9.81]\n\n[initial]\nstate = \"static-equilibrium\"\n\n[time]\nduration = {DURATION}\nstep = {STEP}\n\n\
         [material]\ndensity = 1000.0\npoisson_ratio = 0.45\nstiffness_damping = 0.002\n"
    );
    text
}

/// Poses of the shaken clamp: up and down with 3 Hz, sideways with 5 Hz, growing from rest.
fn shaken() -> String {
    let mut text = String::from("time,x,y,z,qx,qy,qz,qw\n");
    for k in 0..=(DURATION / 0.01) as usize {
        let t = 0.01 * k as f64;
        let wave = |f: f64| (1.0 - (-t / 0.05).exp()) * (2.0 * std::f64::consts::PI * f * t).sin();
        let _ = writeln!(text, "{t:.3},0,{:.6},{:.6},0,0,0,1", 0.006 * wave(5.0), 0.012 * wave(3.0));
    }
    text
}

/// Records the truth and fits the field of a kind of prior.
pub fn run(folder: &Path, held: Held, kind: &str) -> Result<Figures, String> {
    let fail = |e: &dyn std::fmt::Display| e.to_string();
    std::fs::write(folder.join("shaken.csv"), shaken()).map_err(|e| fail(&e))?;
    let [soft, stiff] = PARTS.map(|e| e / START);
    let truth = bar(held)
        + &format!(
            "youngs_modulus = {START}\n\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"regions\"\nblend = \"nearest\"\n\
             regions = [{{ center = [0.05, 0.015, 0.015], radius = 0.01, value = {soft} }}, {{ center = [0.15, 0.015, 0.015], radius = 0.01, value = {stiff} }}]\n"
        );
    let truth = Experiment::from_toml(&truth, folder.join("truth.toml")).map_err(|e| fail(&e))?;
    let truth = truth.finer(1.5, 1.5).map_err(|e| fail(&e))?;
    let marker = |k: usize| {
        let side = [0.0, 0.03][k % 2];
        (format!("m{}", k + 1), DVec3::new(0.02 * (k + 1) as f64, side, 0.015))
    };
    let observers = Observers {
        cameras: Vec::new(),
        markers: (0..9).map(marker).collect(),
        points: Vec::new(),
        displacements: false,
        times: (0..=(DURATION * 60.0) as usize).map(|k| k as f64 / 60.0).collect(),
        sensor: Sensor { noise: NOISE, dropout: 0.0, depth_scale: 0.001, seed: 5 },
    };
    let seen = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).map_err(|e| fail(&e))?;
    palpate_io::write_recording(folder.join("seen"), &seen).map_err(|e| fail(&e))?;
    let fit = |field: &str, free: &str| -> Result<_, String> {
        let text = bar(held)
            + &format!(
                "youngs_modulus = {START}\n{field}\n[observation]\nrecording = \"seen\"\ncost = [\"markers\"]\n\n[fit]\niterations = 40\n{free}\n"
            );
        let e = Experiment::from_toml(&text, folder.join("fit.toml")).map_err(|e| fail(&e))?;
        let fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| fail(&e))?;
        Ok((e, fitted))
    };
    let field = format!("\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"cells\"\nprior = {{ kind = \"{kind}\" }}\n");
    let (e, fitted) = fit(&field, "[[fit.parameter]]\npath = \"field.0\"\nbounds = [0.05, 20]\n")?;
    let (_, one) = fit("", "[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [5e3, 2e6]\n")?;
    let mut figures = common(&e, &fitted)?;
    figures.insert("residual of one modulus [mm]".into(), 1e3 * one.residual().0);
    let p = posterior(&fitted)?;
    let (modulus, volume) = moduli(e.plan(), &fitted);
    let at: Vec<DVec3> = e.plan().body.middles().collect();
    let exact: Vec<f64> = at.iter().map(|x| if x.x < MIDDLE { PARTS[0] } else { PARTS[1] }).collect();
    let off: Vec<f64> = modulus.iter().zip(&exact).map(|(m, t)| (m / t).ln().abs()).collect();
    let mut known: Vec<f64> = (0..off.len()).filter(|k| p.deviation[*k] < 0.2).map(|k| off[k].exp() - 1.0).collect();
    known.sort_by(f64::total_cmp);
    let at_share =
        |s: f64| known.get(((known.len() as f64 * s) as usize).min(known.len().saturating_sub(1))).copied().unwrap_or(f64::NAN);
    let mut say = |name: &str, x: f64| {
        figures.insert(name.into(), x);
    };
    say("cells with sd < 20 %", known.len() as f64);
    say("their error, median", at_share(0.5));
    say("their error, 95 %", at_share(0.95));
    say("their error, largest", at_share(1.0));
    say("their share with error < 20 %", known.iter().filter(|o| **o < 0.2).count() as f64 / known.len().max(1) as f64);
    let inside = (0..off.len()).filter(|k| off[*k] < 1.96 * p.deviation[*k]).count();
    say("cells inside their 95 % band", inside as f64 / off.len() as f64);
    let open: Vec<f64> = p.undetermined.iter().map(|u| f64::from(u8::from(*u))).collect();
    let ln: Vec<f64> = modulus.iter().map(|m| m.ln()).collect();
    for (name, side) in [("left", 0.0), ("right", MIDDLE)] {
        let here = |k: usize| at[k].x >= side && at[k].x < side + MIDDLE;
        say(&format!("undetermined share, {name}"), mean(&open, &volume, here));
        say(&format!("mean gain, {name}"), mean(&p.gain, &volume, here));
        say(&format!("mean sd, {name}"), mean(&p.deviation, &volume, here));
        say(&format!("geometric mean of E, {name} [kPa]"), 1e-3 * mean(&ln, &volume, here).exp());
    }
    Ok(figures)
}
