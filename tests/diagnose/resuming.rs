//! Diagnoses through the command line: stopped in the search and taken up again, with a second recording, and what they write read again.

use super::SEEN;
use crate::cli::BLOCK;
use palpate::Interrupt;
use palpate::cli::INTERRUPTED;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use support::command::{Answer, arg, json, stopped, succeed};

const CAMERA: &str = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=24x18";

/// Records the block, pushed at this speed [m/s] and read 4 mm too far, and writes a scene that does not know of the bias.
fn recorded(folder: &Path, name: &str, speed: f64, seed: &str) -> PathBuf {
    let file = |end: &str| folder.join(format!("{name}{end}"));
    let pushed = BLOCK.replace("velocity = [0.6,", &format!("velocity = [{speed},"));
    fs::write(file("-truth.toml"), format!("{pushed}[[effect]]\nkind = \"depth-bias\"\nbias = 0.004\n")).unwrap();
    fs::write(file(".toml"), pushed + &SEEN.replace("\"seen\"", &format!("\"{name}-seen\""))).unwrap();
    let (truth, seen) = (file("-truth.toml"), file("-seen"));
    succeed(&[
        "observe",
        arg(&truth),
        "--camera",
        CAMERA,
        "--noise",
        "0.0005",
        "--depth-scale",
        "0.0001",
        "--seed",
        seed,
        "--out",
        arg(&seen),
    ]);
    file(".toml")
}

fn command<'a>(scene: &'a Path, out: &'a Path) -> Vec<&'a str> {
    vec!["diagnose", arg(scene), "--out", arg(out), "--backend", "cpu", "--pictures", "1"]
}

/// A diagnosis that is asked to stop once it has kept the first fit of a candidate.
fn stopped_in_the_search(scene: &Path, out: &Path) -> Answer {
    let (interrupt, done) = (Interrupt::default(), AtomicBool::new(false));
    std::thread::scope(|s| {
        s.spawn(|| {
            let began = || fs::metadata(out.join("checkpoint.jsonl")).is_ok_and(|m| m.len() > 0);
            while !began() && !done.load(Ordering::SeqCst) {
                std::thread::sleep(Duration::from_millis(1));
            }
            interrupt.raise();
        });
        let answer = stopped(&command(scene, out), interrupt.clone());
        done.store(true, Ordering::SeqCst);
        answer
    })
}

/// What a diagnosis found; the time it took is no part of that.
fn found(out: &Path) -> Value {
    let mut d = json(out.join("diagnosis.json"));
    d.as_object_mut().unwrap().remove("seconds");
    d
}

#[test]
fn a_resumed_diagnosis_is_a_whole_one_and_its_model_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let scene = recorded(folder.path(), "a", 0.6, "5");
    let (whole, broken) = (file("whole"), file("broken"));
    succeed(&command(&scene, &whole));

    let cut = stopped_in_the_search(&scene, &broken);
    assert_eq!(cut.code, INTERRUPTED, "{}", cut.err);
    let d = found(&broken);
    assert_eq!((&d["verdict"], &d["interrupted"]), (&"undecided".into(), &true.into()));
    let sentence = d["sentence"].as_str().unwrap();
    assert!(sentence.starts_with("Something is missing") && sentence.contains("interrupted"), "{sentence}");
    for name in ["report.html", "model.toml"] {
        assert!(broken.join(name).exists(), "{name}");
    }
    succeed(&[&command(&scene, &broken)[..], &["--resume"]].concat());
    assert_eq!(found(&broken), found(&whole), "to the last bit");

    // The corrected scene: the bias belongs to it now, and nothing else is missing.
    let model = whole.join("model.toml");
    let frames = file("frames");
    succeed(&["simulate", arg(&model), "--out", arg(&frames), "--format", "obj", "--every", "100"]);
    assert!(frames.join("frame_00016.obj").exists());
    succeed(&["fit", "--no-grid-check", arg(&model), "--out", arg(&file("fitted")), "--backend", "cpu"]);
    let value = |d: &Value, path: &str| {
        let all = d["parameters"].as_array().unwrap();
        all.iter().find(|p| p["path"] == path).unwrap()["value"].as_f64().unwrap()
    };
    let after = found(&whole)["parameters"]["after"].clone();
    let path = "material.youngs_modulus";
    let (again, before) =
        (value(&json(file("fitted/result.json")), path), value(&serde_json::json!({ "parameters": after }), path));
    // The fit starts at the answer, and stops where an iteration gains less than it is after.
    assert!((again / before - 1.0).abs() < 1e-3, "{again} against {before}");
    succeed(&command(&model, &file("again")));
    assert_eq!(found(&file("again"))["verdict"], "adequate");
}

#[test]
fn a_second_recording_decides_when_the_command_line_names_one() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, other) = (recorded(folder.path(), "a", 0.6, "5"), recorded(folder.path(), "b", -0.4, "6"));
    let out = folder.path().join("why");
    succeed(&[&command(&scene, &out)[..], &["--held-out", arg(&other)]].concat());
    let d = found(&out);
    assert_eq!((&d["verdict"], &d["held_out"]["data"]), (&"missing-effect".into(), &"second recording".into()), "{d:#}");
    let level = |key: &str| d["held_out"][key].as_f64().unwrap();
    // The bias leaves most of its 4 mm there, and nothing but noise once it is known.
    assert!(level("before") > 3.0 * level("noise") && level("after") < 1.2 * level("noise"), "{}", d["held_out"]);
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("second recording"));
}
