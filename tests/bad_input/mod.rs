//! What users get wrong, and the one line that says so: file, line, key, what is wrong, what is allowed. Every case is a command
//! that ends with exit code 2 (1 where a result cannot be written) and nothing but that line.

mod failures;
mod motion;
mod numbers;
mod output;
mod recordings;
mod scale;
mod shapes;

use std::path::{Path, PathBuf};
use support::command::{arg, palpate, succeed};
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

/// A text with one part replaced by another.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from}");
    text.replacen(from, to, 1)
}

/// Writes a scene into a folder.
fn write(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("scene.toml");
    std::fs::write(&path, text).expect("a writable folder");
    path
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Runs a command that must end with `code`: nothing on stdout, and beside warnings one line on stderr, which is returned.
fn refused(arguments: &[&str], code: i32) -> String {
    let a = palpate(arguments);
    assert_eq!((a.code, a.out.as_str()), (code, ""), "{arguments:?}: {}", a.err);
    let lines: Vec<&str> = a.err.lines().filter(|l| !l.starts_with("warning: ") && !l.starts_with("backend: ")).collect();
    let [line] = lines[..] else { panic!("{arguments:?}: {}", a.err) };
    // The list of all of them: cargo test -p palpate-tests bad_input -- --nocapture
    println!("{code} {line}");
    line.strip_prefix("error: ").unwrap_or_else(|| panic!("{line}")).to_string()
}

/// What the changed scene is refused with when it is simulated, after file and line, which are checked.
fn scene_fault(from: &str, to: &str, line: usize) -> String {
    let folder = folder();
    let path = write(folder.path(), &changed(SCENE, from, to));
    let out = folder.path().join("out");
    let e = refused(&["simulate", arg(&path), "--out", arg(&out)], 2);
    assert!(!out.exists(), "nothing is written when something is wrong");
    after_place(&e, &path, line)
}

/// An error's text after its file and line.
fn after_place(error: &str, file: &Path, line: usize) -> String {
    let place = format!("{}:{line}: ", file.display());
    error.strip_prefix(&place).unwrap_or_else(|| panic!("{error} does not begin with {place}")).to_string()
}

#[test]
fn the_scene_without_faults_is_simulated() {
    let folder = folder();
    let path = write(folder.path(), SCENE);
    let a = succeed(&["simulate", arg(&path), "--out", arg(&folder.path().join("out")), "--backend", "cpu"]);
    assert_eq!(a.err, "", "no warning");
}
