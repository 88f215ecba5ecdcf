//! Fields of stiffness from a scene to files and back.

use std::fs;
use std::path::Path;
use support::command::{arg, json, palpate, succeed};

/// A soft bar that stands out of a wall and hangs by its weight; the cell size is not given.
const BAR: &str = r#"
format = "scene/1"
title = "Bar of two parts"

[object]
shape = { box = { min = [0, 0, 0], max = [0.18, 0.04, 0.04] } }
cell_size = CELL

[material]
density = 1000.0
youngs_modulus = 3.0e4
poisson_ratio = 0.4

[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.01, 0.05, 0.05] }

[initial]
state = "static-equilibrium"

[time]
steps = 0
"#;

/// Its two parts.
const PARTS: &str = r#"
[[field]]
path = "material.youngs_modulus"
basis = "regions"
blend = "axis"
regions = [
    { center = [0.04, 0.02, 0.02], radius = 0.02, value = ROOT },   # near the wall
    { center = [0.12, 0.02, 0.02], radius = 0.02, value = TIP },
]
"#;

const FIT: &str = r#"
[observation]
recording = "seen"
cost = ["displacements"]

[fit]
iterations = 60

[[fit.parameter]]
path = "field.0"
bounds = [0.05, 20.0]
"#;

fn parts(root: f64, tip: f64) -> String {
    PARTS.replace("ROOT", &root.to_string()).replace("TIP", &tip.to_string())
}

/// A folder with a recording of the bar in two parts, 0.7 and 2 times as stiff as stated, and a scene that fits its field to it.
fn recorded(cell: f64, field: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let bar = BAR.replace("CELL", &cell.to_string());
    let truth = folder.path().join("truth.toml");
    fs::write(&truth, bar.clone() + &parts(0.7, 2.0)).unwrap();
    let seen = folder.path().join("seen");
    succeed(&["observe", arg(&truth), "--displacements", "--noise", "0.0001", "--times", "0", "--out", arg(&seen)]);
    fs::write(folder.path().join("fit.toml"), bar + field + FIT).unwrap();
    folder
}

fn found(folder: &Path, options: &[&str]) -> (serde_json::Value, String) {
    let (scene, out) = (folder.join("fit.toml"), folder.join("found"));
    let answer = succeed(&[&["fit", "--no-grid-check", arg(&scene), "--out", arg(&out)], options].concat());
    (json(out.join("result.json")), answer.out)
}

#[test]
fn the_parts_of_a_bar_are_found_with_their_errors() {
    let folder = recorded(0.0135, &parts(1.0, 1.0));
    let (r, text) = found(folder.path(), &[]);
    println!("{text}");
    for (k, truth) in [0.7, 2.0].into_iter().enumerate() {
        let p = &r["parameters"][k];
        assert_eq!(p["path"], format!("field.0.{k}"));
        let (value, error) = (p["value"].as_f64().unwrap(), p["standard_error"].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * error && error < 0.05 * truth, "{value} ± {error}, not {truth}");
    }
    let f = &r["fields"][0];
    assert_eq!((&f["basis"], &f["count"], &f["varies"]), (&"regions".into(), &2.into(), &"material.youngs_modulus".into()));
    assert_eq!(f["max"], r["parameters"][1]["value"]);
    // The model found reads again, with the values in place and the comments that were there.
    let model = folder.path().join("found/model.toml");
    let written = fs::read_to_string(&model).unwrap();
    assert!(written.contains("# near the wall"), "{written}");
    let again = palpate::Experiment::open(&model).unwrap();
    let theta = &again.plan().theta[again.plan().layout.resolve("field.0")];
    assert_eq!(theta, [0, 1].map(|k| r["parameters"][k]["value"].as_f64().unwrap()));
}

#[test]
fn hundreds_of_cells_reach_the_noise_by_either_method() {
    let cells = "\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"cells\"\n";
    let folder = recorded(0.0101, cells);
    let mut costs = Vec::new();
    for (options, name) in
        [(&["--iterations", "20"][..], "gauss-newton-cg"), (&["--optimizer", "lbfgs", "--iterations", "250"][..], "lbfgs")]
    {
        let (r, text) = found(folder.path(), options);
        println!("{text}\n{}", r["runs"][0]);
        assert_eq!(r["optimizer"], name);
        let f = &r["fields"][0];
        let count = f["count"].as_u64().unwrap() as usize;
        assert!(count > 256, "{count}");
        assert!(r["parameters"].as_array().unwrap().is_empty() && text.contains("field.0 of material.youngs_modulus"));
        assert!(r["warnings"][0].as_str().unwrap().starts_with("no standard errors: "), "{}", r["warnings"]);
        let out = folder.path().join("found");
        let history = fs::read_to_string(out.join("history.csv")).unwrap();
        assert!(history.starts_with("run,iteration,cost\n"), "{history}");
        let npz = out.join(f["file"].as_str().unwrap());
        let values = palpate_io::npy::read_array(&npz, Some("values")).unwrap().values;
        assert_eq!(values.len(), count);
        assert_eq!(values.iter().copied().fold(0.0, f64::max), f["max"].as_f64().unwrap());
        let modulus = palpate_io::vtk::read_vtu_array(&out.join(f["grid"].as_str().unwrap()), Some("E"), true).unwrap();
        assert!(modulus.iter().zip(&values).all(|(e, v)| (e / (3e4 * v) - 1.0).abs() < 1e-12));
        let again = palpate::Experiment::open(out.join("model.toml")).unwrap();
        assert_eq!(&again.plan().theta[again.plan().layout.resolve("field.0")], values);
        costs.push(r["cost"]["final"].as_f64().unwrap());
        assert!(r["cost"]["initial"].as_f64().unwrap() > 10.0 * costs[0]);
    }
    // With the truth the cost is one half; so many free values go below. What is left between both is less than the noise tells.
    assert!(costs.iter().all(|c| (0.2..0.5).contains(c)) && (costs[0] / costs[1] - 1.0).abs() < 0.1, "{costs:?}");
}

#[test]
fn a_field_that_does_not_fit_its_body_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let bar = BAR.replace("CELL", "0.02");
    let refused = |field: &str| {
        let scene = folder.path().join("scene.toml");
        fs::write(&scene, bar.clone() + field).unwrap();
        palpate(&["simulate", arg(&scene), "--out", arg(&folder.path().join("out"))]).err
    };
    let array = palpate_io::npy::Array { shape: vec![3], values: vec![1.0; 3] };
    palpate_io::npy::write_npz(folder.path().join("three.npz"), &[("values", &array)]).unwrap();
    let e = refused("\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"cells\"\nfile = \"three.npz\"\n");
    assert!(e.contains("scene.toml:26: field.0.file: has 3 values; the body has 36 cells"), "{e}");
    let e = refused(&parts(1.0, 1.0).replace("\"axis\"", "\"harmonic\"").replace("[0.12,", "[0.32,"));
    assert!(e.contains("field.0.regions: region 1 around ") && e.contains("holds no node"), "{e}");
}

#[test]
fn a_field_with_a_prior_says_what_the_recording_does_not_know() {
    let cells = |prior: &str| format!("\n[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"cells\"\nprior = {prior}\n");
    let folder = recorded(0.0135, &cells("{ kind = \"matern\" }"));
    let (r, text) = found(folder.path(), &[]);
    println!("{text}");
    assert_eq!((&r["optimizer"], &r["verdict"]["word"]), (&"gauss-newton-cg".into(), &"converged".into()));
    let (field, out) = (&r["fields"][0], folder.path().join("found"));
    let p = &field["posterior"];
    assert_eq!((&p["prior"], &p["chosen"]), (&"matern".into(), &serde_json::json!(["length", "deviation"])));
    assert!(p["tried"].as_array().unwrap().iter().any(|t| t["evidence"] == 0.0 && t["length"] == p["length"]), "{p}");
    // Two parts that differ threefold are no single value, and a bar that stands out of a wall is not bent at its tip.
    let one = p["tried"].as_array().unwrap().iter().find(|t| t["deviation"] == 0.0).unwrap();
    assert!(one["evidence"].as_f64().unwrap() < -10.0, "{one}");
    let grid = out.join(field["grid"].as_str().unwrap());
    let read = |name: &str| palpate_io::vtk::read_vtu_array(&grid, Some(name), true).unwrap();
    let (open, gain, e, sd) = (read("undetermined"), read("gain"), read("E"), read("E_sd"));
    assert_eq!(open.iter().filter(|u| **u == 1.0).count() as u64, p["undetermined"].as_u64().unwrap());
    let body = &palpate::Experiment::open(out.join("model.toml")).unwrap().plan().body.clone();
    let (mut near, mut off) = (Vec::new(), Vec::new());
    for (k, x) in body.middles().enumerate() {
        assert!((open[k] == 1.0) == (gain[k] < 0.1));
        let truth = 3e4 * if x.x < 0.04 { 0.7 } else { 2.0 };
        if (0.02..0.04).contains(&x.x) {
            near.push(gain[k]);
        }
        if x.x < 0.04 || x.x > 0.12 {
            off.push((e[k] / truth).ln().abs() / (sd[k] / e[k]));
        }
    }
    assert!(near.iter().all(|g| *g > 0.3), "{near:?}");
    let inside = off.iter().filter(|o| **o < 2.0).count() as f64 / off.len() as f64;
    assert!(inside > 0.8, "{inside}");
    let npz = out.join(field["file"].as_str().unwrap());
    for name in ["ln_sd", "ln_prior_sd", "gain", "undetermined", "standard_error"] {
        assert_eq!(palpate_io::npy::read_array(&npz, Some(name)).unwrap().values.len() as u64, field["count"].as_u64().unwrap());
    }
    assert!(text.contains("prior of field.0: matern, length ") && text.contains("the recording tells about"), "{text}");
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("Logarithm of the evidence"));
}
