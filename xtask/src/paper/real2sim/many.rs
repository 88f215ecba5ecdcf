//! Ten thousand cells: what an iteration of a fit with a prior takes, and its parts. A bar stands out of a wall under its weight, of two parts, seen by 40
//! markers on its top.

use super::{Figures, common};
use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions};
use palpate_engine::{ParamBatch, Request, Wanted};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

const BAR: &str = r#"
format = "scene/1"
title = "Bar of ten thousand cells"

[object]
shape = { box = { min = [0, 0, 0], max = [0.7, 0.12, 0.12] } }
cell_size = 0.01

[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.01, 0.13, 0.13] }

[world]
gravity = [0, 0, -9.81]

[initial]
state = "static-equilibrium"

[time]
steps = 0

[material]
density = 1000.0
poisson_ratio = 0.4
youngs_modulus = 5e6
"#;

const PARTS: &str = r#"
[[field]]
path = "material.youngs_modulus"
basis = "regions"
blend = "nearest"
regions = [{ center = [0.1, 0.06, 0.06], radius = 0.01, value = 0.7 }, { center = [0.5, 0.06, 0.06], radius = 0.01, value = 2 }]
"#;

const FIELD: &str = r#"
[[field]]
path = "material.youngs_modulus"
basis = "cells"
prior = { kind = "matern", length = 0.3, deviation = 0.4 }

[observation]
recording = "seen"
cost = ["markers"]

[fit]
iterations = 10

[[fit.parameter]]
path = "field.0"
"#;

/// Records and fits.
pub fn run(folder: &Path) -> Result<Figures, String> {
    let fail = |e: &dyn std::fmt::Display| e.to_string();
    let open = |rest: &str, name: &str| Experiment::from_toml(&format!("{BAR}{rest}"), folder.join(name)).map_err(|e| fail(&e));
    let marker = |k: usize| (format!("m{k}"), DVec3::new(0.035 * (k / 2 + 1) as f64, [0.02, 0.1][k % 2], 0.12));
    let observers = Observers {
        cameras: Vec::new(),
        markers: (0..40).filter(|k| k / 2 < 19).map(marker).collect(),
        points: Vec::new(),
        displacements: false,
        times: vec![0.0],
        sensor: Sensor { noise: 2e-4, dropout: 0.0, depth_scale: 0.001, seed: 2 },
    };
    let truth = open(PARTS, "truth.toml")?;
    let seen = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).map_err(|e| fail(&e))?;
    palpate_io::write_recording(folder.join("seen"), &seen).map_err(|e| fail(&e))?;
    let e = open(FIELD, "fit.toml")?;
    let fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| fail(&e))?;
    let mut figures = common(&e, &fitted)?;
    let run = &fitted.result.runs[0];
    let mut say = |name: &str, x: f64| {
        figures.insert(name.into(), x);
    };
    say("iterations", run.iterations as f64);
    say("seconds an iteration, all included", fitted.result.seconds / run.iterations.max(1) as f64);
    // The parts, at the field that was found.
    let plan = e.plan();
    let places: Vec<usize> = plan.layout.resolve("field.0").collect();
    let theta = &fitted.result.theta[0];
    let mut evaluator = Backend::Cpu.evaluator(plan, 1).map_err(|e| fail(&e))?;
    let mut time = |places: Vec<usize>| {
        let request = Request { gradient: Wanted::Places(places), ..Request::default() };
        let clock = Instant::now();
        let done = evaluator.evaluate(&ParamBatch::from_rows(std::slice::from_ref(theta)), &request).remove(0);
        done.failure.map_or(Ok(clock.elapsed().as_secs_f64()), |f| Err(f.to_string()))
    };
    let modulus = plan.layout.index(palpate_model::params::ParamKey::YoungsModulus);
    let least = |a: f64, b: f64| a.min(b);
    let (mut one, mut all) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..2 {
        one = least(one, time(vec![modulus])?);
        all = least(all, time(places.clone())?);
    }
    say("gradient by one modulus [s]", one);
    say("gradient by all cells [s]", all);
    let mut v = vec![0.0; theta.len()];
    places.iter().enumerate().for_each(|(k, p)| v[*p] = (0.01 * k as f64).sin());
    let mut product = || {
        let clock = Instant::now();
        evaluator
            .product(&ParamBatch::from_rows(std::slice::from_ref(theta)), &v, &Wanted::Places(places.clone()))
            .map_err(|e| fail(&e))?;
        Ok::<_, String>(clock.elapsed().as_secs_f64())
    };
    // The first keeps the states.
    product()?;
    say("product [s]", least(product()?, product()?));
    Ok(figures)
}
