//! A disk that is full when results are written.

use super::{SCENE, changed, folder, refused, write};
use crate::cli::{BLOCK, observed};
use std::path::Path;
use support::command::arg;

/// Makes a file that is about to be written end on a device without room: files are first written under this temporary name.
fn fill(folder: &Path, name: &str) {
    std::fs::create_dir_all(folder).unwrap();
    std::os::unix::fs::symlink("/dev/full", folder.join(format!(".{name}.{}.tmp", std::process::id()))).unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn disk_full_on_output() {
    const CAUSE: &str = "cannot be written: No space left on device (os error 28)";
    let place = folder();
    let scene = write(place.path(), &changed(SCENE, "steps = 10", "steps = 1"));
    let out = place.path().join("out");
    fill(&out, "frame_00001.obj");
    let e = refused(&["simulate", arg(&scene), "--out", arg(&out)], 1);
    assert_eq!(e, format!("{}: {CAUSE}", out.join("frame_00001.obj").display()));
    assert!(out.join("frame_00000.obj").exists() && !out.join("frame_00001.obj").exists(), "no half a file");

    let place = observed(BLOCK);
    let (scene, out) = (place.path().join("fit.toml"), place.path().join("found"));
    fill(&out, "result.json");
    let e = refused(&["fit", arg(&scene), "--starts", "1", "--out", arg(&out)], 1);
    assert_eq!(e, format!("{}: {CAUSE}", out.join("result.json").display()));

    let (seen, camera) = (place.path().join("again"), crate::cli::CAMERA);
    fill(&seen, "recording.toml");
    let scene = place.path().join("scene.toml");
    let e = refused(&["observe", arg(&scene), "--camera", camera, "--times", "0", "--out", arg(&seen)], 1);
    assert_eq!(e, format!("{}: {CAUSE}", seen.join("recording.toml").display()));
}
