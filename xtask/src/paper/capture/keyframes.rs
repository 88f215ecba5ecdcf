//! A bar that a force at its end leads through five keyframes, and how many steps a second its simulation takes.

use super::{EVALUATIONS, Figures, MISS};
use palpate::results::synthesis::SynthesisDocument;
use palpate::{Backend, Experiment, Interrupt, Liveliness, cli, results};
use std::path::Path;
use std::time::Instant;

/// Times [s], and how far the middle of the end shall be across from its place at rest [m].
const KEYFRAMES: [(f64, [f64; 2]); 5] =
    [(0.1, [0.02, -0.005]), (0.2, [0.01, 0.03]), (0.3, [-0.03, 0.02]), (0.4, [-0.01, -0.02]), (0.5, [0.02, -0.01])];

const BAR: &str = r#"format = "scene/1"
title = "A bar that is led"

[object]
shape = { box = { min = [0, 0, 0], max = [0.4, 0.1, 0.1] } }
cells = 20

[material]
density = 1000
youngs_modulus = 2e5
poisson_ratio = 0.4
stiffness_damping = 2e-3

[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.001, 0.11, 0.11] }

[initial]
state = "static-equilibrium"

[time]
step = 0.01
duration = 0.5
"#;

fn wishes() -> String {
    let keyframe = |(time, [y, z]): &(f64, [f64; 2])| {
        format!(
            "\n[[keyframe]]\ntime = {time}\nsigma = 2e-4\npoints = [[0.4, 0.05, 0.05]]\npositions = [[0.39, {}, {}]]\n",
            0.05 + y,
            0.05 + z
        )
    };
    let handle = "\n[[handle]]\npoint = [0.4, 0.05, 0.05]\nradius = 0.03\n\n[synthesize]\nknots = 10\nforce = 50\n";
    handle.to_string() + &KEYFRAMES.iter().map(keyframe).collect::<String>()
}

/// Leads the bar by the command that people use, and simulates it without a wish.
pub fn run(folder: &Path) -> Result<Figures, String> {
    let fail = |e: &dyn std::fmt::Display| e.to_string();
    let (scene, out) = (folder.join("led.toml"), folder.join("led"));
    std::fs::write(&scene, BAR.to_string() + &wishes()).map_err(|e| fail(&e))?;
    let (mut said, mut wrong) = (Vec::new(), Vec::new());
    let arguments = ["palpate", "synthesize", &scene.to_string_lossy(), "--backend", "cpu", "--out", &out.to_string_lossy()]
        .map(String::from);
    if cli::run(arguments, &mut said, &mut wrong, Interrupt::default(), Liveliness::Silent) != 0 {
        return Err(String::from_utf8_lossy(&wrong).into_owned());
    }
    let found: SynthesisDocument = results::read(out.join("synthesis.json")).map_err(|e| fail(&e))?;
    let search = found.search.ok_or("nothing was searched")?;
    let worst = search.keyframes.iter().map(|k| k.worst.unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
    let plain = Experiment::from_toml(BAR, folder.join("bar.toml")).map_err(|e| fail(&e))?;
    let clock = Instant::now();
    plain.simulate(Backend::Cpu).map_err(|e| fail(&e))?;
    let steps = plain.plan().clock.steps as f64 / clock.elapsed().as_secs_f64();
    Ok(Figures::from([
        (MISS.into(), 1e3 * worst),
        (EVALUATIONS.into(), search.evaluations as f64),
        ("steps a second".into(), steps),
        ("nodes".into(), plain.plan().body.nodes.len() as f64),
        ("largest force [N]".into(), search.largest_force),
    ]))
}
