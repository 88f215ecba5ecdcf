//! What users get wrong, and the one line that says so: file, key or line, what is wrong, what is allowed.

mod numbers;
mod recordings;
mod shapes;

use palpate_io::{InputError, read_scene, scene_error};
use palpate_model::plan_build::build_plan;
use palpate_model::scene::Scene;
use std::path::PathBuf;
use tempfile::TempDir;

/// A scene that is fine.
const SCENE: &str = r#"format = "scene/1"

[object]
shape = { box = { min = [0, 0, 0], max = [0.1, 0.03, 0.03] } }
cell_size = 0.01

[material]
density = 1070
youngs_modulus = 2e5
poisson_ratio = 0.45

[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.0005, 0.04, 0.04] }

[time]
step = 0.01
steps = 10

[fit]
optimizer = "gauss-newton"

[[fit.parameter]]
path = "material.youngs_modulus"
start = 1e5
bounds = [1e3, 1e6]
"#;

/// The scene in a folder of its own, one text replaced by another.
fn scene_file(from: &str, to: &str) -> (TempDir, PathBuf) {
    assert!(SCENE.contains(from), "{from}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, SCENE.replace(from, to)).expect("a writable folder");
    (folder, path)
}

/// The error that reading the changed scene gives: one line that begins with the file and its line.
fn scene_fault(from: &str, to: &str, line: usize) -> String {
    let (_folder, path) = scene_file(from, to);
    let e = read_scene(&path).expect_err("must be refused");
    assert_eq!((e.file.as_path(), e.line), (path.as_path(), Some(line)), "{e}");
    one_line(e)
}

fn one_line(e: InputError) -> String {
    let text = e.to_string();
    assert!(!text.contains('\n') && !text.is_empty());
    text
}

/// The error that building the plan of the changed scene gives.
fn plan_fault(from: &str, to: &str, line: usize) -> String {
    let (_folder, path) = scene_file(from, to);
    let scene: Scene = read_scene(&path).expect("the file itself is fine").value;
    let fault = build_plan(&scene, Default::default(), &[]).expect_err("must be refused");
    let e = scene_error(&scene, &fault.key, fault.message);
    assert_eq!(e.line, Some(line), "{e}");
    one_line(e)
}

#[test]
fn the_scene_without_faults_is_accepted() {
    let (_folder, path) = scene_file("0.45", "0.45");
    let loaded = read_scene(&path).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    build_plan(&loaded.value, Default::default(), &[]).unwrap();
}
