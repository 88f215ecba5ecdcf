//! Sequences of equilibria give their stiffness back, and say where nothing measures it.

use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions, Fitted};
use palpate_io::npy::{Array, write_npz};
use std::ops::ControlFlow;
use std::path::Path;

/// Noise of a coordinate [m].
const NOISE: f64 = 5e-5;

/// A beam that is held at x = 0 and pulled at its tip, in six states, with what else a scene says.
fn beam(modulus: f64, gravity: f64, more: &str) -> String {
    format!(
        "format = \"scene/1\"\n[object]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.1, 0.03, 0.03] }} }}\ncell_size = 0.0125\n\
         [material]\ndensity = 1000\nyoungs_modulus = {modulus}\npoisson_ratio = 0.45\n[world]\ngravity = [0, 0, {gravity}]\n\
         [[clamp]]\nbox = {{ min = [-1, -1, -1], max = [0.006, 1, 1] }}\n[time]\nmode = \"quasi-static\"\n{more}"
    )
}

const LOAD: &str = "[[load]]\nkind = \"file\"\nplaces = [[0.1, 0.005, 0.03], [0.1, 0.025, 0.03]]\ntimes = [0, 1, 2, 3.5, 4, 7]\n\
    total = [[0, 0, 0], [0, 0, -0.2], [0, 0.3, -0.5], [0.4, 0, 0.3], [0, -0.3, 0.1], [0, 0.1, -0.8]]\n";
const FIT: &str = "[fit]\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = 1e5\n";

/// What tracks of fifteen points of a scene's states would be.
fn tracked(text: &str, folder: &Path) -> palpate_io::Recording {
    let truth = Experiment::from_toml(text, folder.join("truth.toml")).unwrap();
    let point = |k: usize| DVec3::new(0.02 + 0.005 * k as f64, 0.03 * (k % 2) as f64, 0.015);
    let observers = Observers {
        cameras: Vec::new(),
        markers: Vec::new(),
        points: (0..15).map(point).collect(),
        displacements: false,
        times: truth.plan().times.clone(),
        sensor: Sensor { noise: NOISE, dropout: 0.0, depth_scale: 0.001, seed: 3 },
    };
    observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap()
}

fn fitted(text: &str, seen: &palpate_io::Recording, folder: &Path) -> Fitted {
    let e = Experiment::from_toml(text, folder.join("fit.toml")).unwrap().measured(seen.clone()).unwrap();
    e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn half_of_the_states_tell_the_modulus_and_the_other_half() {
    let folder = tempfile::tempdir().unwrap();
    let seen = tracked(&beam(2.5e5, -9.81, LOAD), folder.path());
    assert_eq!(seen.points.as_ref().map(|p| p.track.times.clone()), Some(vec![0.0, 1.0, 2.0, 3.5, 4.0, 7.0]));
    let fit = FIT.replace("[fit]\n", "[fit]\nframes = { train = { every = 2 }, test = \"rest\" }\n");
    let found = fitted(&beam(2.5e5, -9.81, &format!("{LOAD}{fit}")), &seen, folder.path());
    let p = &found.result.parameters[0];
    let error = p.noise.unwrap();
    // Four standard errors: nothing but noise is between both.
    assert!((p.value - 2.5e5).abs() < 4.0 * error && error < 0.01 * 2.5e5, "{} ± {error}", p.value);
    let h = found.held_out.unwrap();
    println!("{}", h.sentence());
    assert_eq!((h.train.frames, h.test.frames), (3, 3));
    // 135 coordinates scatter by 6 %, their distances by about as much; three times that.
    let noise = NOISE * 3f64.sqrt();
    assert!((h.test.rms / noise - 1.0).abs() < 0.2 && (h.train.rms / noise - 1.0).abs() < 0.2, "{h:?}");
    assert!(h.test.unmoved.unwrap() > 20.0 * h.test.rms && h.test.rest.unwrap() > 20.0 * h.test.rms, "{h:?}");
    assert!(!found.warnings.iter().any(|w| w.contains("no known force")), "{:?}", found.warnings);
}

#[test]
fn without_a_force_nothing_measures_the_modulus_and_the_fit_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let tip = [[0.1, 0.005, 0.03], [0.1, 0.025, 0.03], [0.1, 0.015, 0.0]];
    let turned = |t: f64, p: [f64; 3]| [p[0] - 0.004 * t, p[1] + 0.006 * t, p[2] - 0.01 * t];
    let values = (0..4).flat_map(|k| tip.iter().flat_map(move |p| turned(f64::from(k), *p))).collect();
    let track = Array { shape: vec![4, 3, 3], values };
    write_npz(folder.path().join("a.npz"), &[("track", &track)]).unwrap();
    let strings = format!("[[attach]]\ntrack = \"a.npz:track\"\nrate = 1\nplaces = {tip:?}\nstiffness = 300\n");
    for (gravity, silent) in [(0.0, true), (-9.81, false)] {
        let seen = tracked(&beam(2.5e5, gravity, &strings), folder.path());
        let fit = FIT.replace("[fit]\n", "[fit]\niterations = 2\n");
        let found = fitted(&beam(2.5e5, gravity, &format!("{strings}{fit}")), &seen, folder.path());
        let said = found.warnings.iter().any(|w| w.contains("no known force acts"));
        assert_eq!(said, silent, "{gravity}: {:?}", found.warnings);
    }
}
