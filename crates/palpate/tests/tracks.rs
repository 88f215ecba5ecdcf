//! Stiffness and damping from tracked points and from displacements of nodes, end to end: simulated, recorded, written, read, fitted.

use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions};
use palpate_io::{read_recording, write_recording};
use std::ops::ControlFlow;

const BAR: &str = include_str!("bar.toml");
const FREE: &str = include_str!("bar-fit.toml");

/// Fits the bar to what was seen of it, by one cost; the true values in units of their errors away from the fit.
fn misses(folder: &std::path::Path, cost: &str) -> Vec<f64> {
    let text = format!("{BAR}\n[observation]\nrecording = \"seen\"\ncost = \"{cost}\"\n{FREE}");
    let experiment = Experiment::from_toml(&text, folder.join("bar.toml")).unwrap_or_else(|e| panic!("{e}"));
    let fitted = experiment.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).unwrap_or_else(|e| panic!("{e}"));
    let after = &fitted.after[0];
    println!("{cost}: rms {:.2e} m, noise alone {:.2e} m, {} readings", after.rms, after.noise, after.points);
    assert!(after.rms < 1.2 * after.noise, "{} m and {} m", after.rms, after.noise);
    let truth = [6.0e4, 0.004];
    let found = fitted.result.parameters.iter().zip(truth);
    found
        .map(|(p, truth)| {
            println!("{cost}: {} ± {:?}, in truth {truth}", p.value, p.standard_error);
            (p.value - truth).abs() / p.standard_error.expect("an error is known")
        })
        .collect()
}

#[test]
fn a_bar_is_fitted_to_tracks_and_to_displacements_from_files() {
    let folder = std::env::temp_dir().join(format!("palpate-tracks-{}", std::process::id()));
    let truth = Experiment::from_toml(BAR, "bar.toml").unwrap_or_else(|e| panic!("{e}"));
    // On the upper face and inside.
    let on = |k: u32| {
        DVec3::new(0.015 + 0.01 * f64::from(k), 0.005 + 0.02 * f64::from(k % 2), if k.is_multiple_of(3) { 0.02 } else { 0.03 })
    };
    let observers = Observers {
        cameras: Vec::new(),
        markers: Vec::new(),
        points: (0..10).map(on).collect(),
        displacements: true,
        times: (0..=12).map(|k| 0.01 * f64::from(k)).collect(),
        sensor: Sensor { noise: 2e-4, dropout: 0.2, depth_scale: 1e-3, seed: 4 },
    };
    let recording = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}"));
    write_recording(folder.join("seen"), &recording).unwrap_or_else(|e| panic!("{e}"));
    let read = read_recording(folder.join("seen")).unwrap_or_else(|e| panic!("{e}"));
    let seen = read.points.as_ref().expect("points were recorded").track.readings();
    assert!((80..125).contains(&seen), "a fifth of 130 readings is missing: {seen}");
    for cost in ["points", "displacements"] {
        let misses = misses(&folder, cost);
        assert!(misses.iter().all(|m| *m < 3.0), "{cost}: {misses:?}");
    }
    // The nodes of another grid are other nodes.
    let finer = BAR.replace("cell_size = 0.015", "cell_size = 0.01");
    let text = format!("{finer}\n[observation]\nrecording = \"seen\"\ncost = \"displacements\"\n");
    let e = Experiment::from_toml(&text, folder.join("bar.toml")).map(|_| ()).expect_err("the grid is another one").to_string();
    assert!(e.contains("recording.toml") && e.contains("displacements.file: holds"), "{e}");
    // A body elsewhere is not what the points lie on.
    let moved =
        BAR.replace("max = [0.12, 0.03, 0.03]", "max = [0.12, 0.03, 0.2]").replace("min = [0, 0, 0]", "min = [0, 0, 0.1]");
    let text = format!("{moved}\n[observation]\nrecording = \"seen\"\ncost = \"points\"\n");
    let e = Experiment::from_toml(&text, folder.join("bar.toml")).map(|_| ()).expect_err("nothing is there").to_string();
    assert!(e.contains("points.rest: 10 of 10 points lie more than"), "{e}");
    std::fs::remove_dir_all(&folder).unwrap_or_else(|e| panic!("{e}"));
}
