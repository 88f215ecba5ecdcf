//! `palpate place`: over which regions a number varies, found from a recording that does not know of regions.

use serde_json::Value;
use std::path::Path;
use support::command::{arg, json, palpate, succeed};

/// A bar that is let go with a swing.
const BAR: &str = r#"
format = "scene/1"
title = "Bar"

[object]
shape = { box = { min = [0.0, -0.02, -0.02], max = [0.16, 0.02, 0.02] } }
cell_size = 0.02

[material]
density = 1000.0
youngs_modulus = 8.0e4
poisson_ratio = 0.4
stiffness_damping = 0.004

[[clamp]]
box = { min = [-0.01, -0.1, -0.1], max = [0.0001, 0.1, 0.1] }

[initial]
velocity = [0.0, 0.3, 0.0]

[time]
step = 0.005
duration = 0.2
"#;

/// What varies in the bar that is recorded.
fn parts(path: &str, outer: f64) -> String {
    format!(
        "\n[[field]]\npath = \"{path}\"\nbasis = \"regions\"\nblend = \"nearest\"\nregions = [\n  {{ center = [0.04, 0.0, 0.0], radius = 0.02, value = 1.0 }},\n  \
         {{ center = [0.12, 0.0, 0.0], radius = 0.02, value = {outer} }},\n]\n"
    )
}

/// What `place` says of the bar, recorded with a second part in it or without.
fn placed(folder: &Path, name: &str, second: &str, options: &[&str]) -> Value {
    let file = |ending: &str| folder.join(format!("{name}{ending}"));
    let (truth, seen, scene, out) = (file("-truth.toml"), file("-seen"), file(".toml"), file("-placed"));
    std::fs::write(&truth, format!("{BAR}{second}")).unwrap();
    let recorded = ["--displacements", "--fps", "50", "--noise", "2e-4", "--out", arg(&seen), "--backend", "cpu"];
    succeed(&[&["observe", arg(&truth)][..], &recorded].concat());
    let observed = format!(
        "\n[observation]\nrecording = \"{name}-seen\"\ncost = \"displacements\"\n\n[fit]\n\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\n\n\
         [[fit.parameter]]\npath = \"material.stiffness_damping\"\n"
    );
    std::fs::write(&scene, format!("{BAR}{observed}")).unwrap();
    let all = [&["place", arg(&scene), "--out", arg(&out), "--backend", "cpu"][..], options].concat();
    succeed(&all);
    json(out.join("placed.json"))
}

#[test]
fn two_parts_are_found_where_they_are_and_no_third_one() {
    let folder = tempfile::tempdir().unwrap();
    let d = placed(folder.path(), "two", &parts("material.youngs_modulus", 3.0), &[]);
    assert_eq!((d["format"].as_str(), d["verdict"].as_str()), (Some("placement/1"), Some("placed")), "{d:#}");
    let controls = d["controls"].as_array().unwrap();
    let at = |k: usize| controls[k]["center"][0].as_f64().unwrap();
    let value = |k: usize| controls[k]["factor"].as_f64().unwrap() * d["value"].as_f64().unwrap();
    println!("{d:#}");
    assert_eq!(controls.len(), 2, "{d:#}");
    let (soft, hard) = if at(0) < at(1) { (0, 1) } else { (1, 0) };
    // The step is at 0.08 m, a plane of cells; half way between the controls the nearest one changes.
    assert!((0.5 * (at(soft) + at(hard)) - 0.08).abs() < 0.011, "{} {}", at(soft), at(hard));
    assert!((value(soft) / 8e4 - 1.0).abs() < 0.05 && (value(hard) / 2.4e5 - 1.0).abs() < 0.1, "{} {}", value(soft), value(hard));
    // What comes out is a scene that a fit reads.
    let (scene, out) = (folder.path().join("two-placed/scene.toml"), folder.path().join("fit"));
    succeed(&["fit", arg(&scene), "--out", arg(&out), "--backend", "cpu", "--iterations", "5"]);
    let fit = json(out.join("result.json"));
    let paths: Vec<&str> = fit["parameters"].as_array().unwrap().iter().map(|p| p["path"].as_str().unwrap()).collect();
    assert_eq!(paths, ["material.stiffness_damping", "field.0.0", "field.0.1"]);
}

#[test]
fn a_body_of_one_kind_keeps_one_value() {
    let folder = tempfile::tempdir().unwrap();
    let d = placed(folder.path(), "one", "", &[]);
    assert_eq!(d["verdict"], "one everywhere", "{d:#}");
    assert!(d["controls"].as_array().unwrap().is_empty() && d["rounds"].as_array().unwrap().len() == 1, "{d:#}");
}

#[test]
fn damping_that_varies_is_found_too() {
    let folder = tempfile::tempdir().unwrap();
    let second = parts("material.stiffness_damping", 4.0);
    let d = placed(folder.path(), "damped", &second, &["--number", "stiffness-damping", "--most", "2"]);
    assert_eq!((d["verdict"].as_str(), d["unit"].as_str()), (Some("placed"), Some("s")), "{d:#}");
    let controls = d["controls"].as_array().unwrap();
    let factor = |k: usize| controls[k]["factor"].as_f64().unwrap();
    let at = |k: usize| controls[k]["center"][0].as_f64().unwrap();
    let (inner, outer) = if at(0) < at(1) { (0, 1) } else { (1, 0) };
    // The outer half moves fast and bends little: its damping is known to about a half.
    assert!(factor(outer) / factor(inner) > 1.5, "{d:#}");
}

#[test]
fn a_number_that_is_not_free_or_varies_already_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("bar.toml"), BAR).unwrap();
    let told = palpate(&["place", arg(&file("bar.toml")), "--out", arg(&file("out"))]);
    assert_eq!(told.code, 2);
    assert!(told.err.contains("fit.parameter") && told.err.contains("material.youngs_modulus"), "{}", told.err);
}
