//! Diagnoses that are stopped: what is known is written, and said to be no more than that.

use super::SEEN;
use crate::cli::BLOCK;
use palpate::Interrupt;
use palpate::cli::INTERRUPTED;
use std::fs;
use support::command::{arg, json, stopped, succeed};

#[test]
fn a_diagnosis_stopped_early_writes_the_baseline_and_decides_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("truth.toml"), format!("{BLOCK}[[effect]]\nkind = \"depth-bias\"\nbias = 0.004\n")).unwrap();
    fs::write(file("scene.toml"), format!("{BLOCK}{SEEN}")).unwrap();
    let (truth, seen, scene, out) = (file("truth.toml"), file("seen"), file("scene.toml"), file("why"));
    let camera = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=24x18";
    succeed(&["observe", arg(&truth), "--camera", camera, "--noise", "0.0005", "--out", arg(&seen)]);
    let a = stopped(&["diagnose", arg(&scene), "--out", arg(&out), "--backend", "cpu"], Interrupt::after(2));
    assert_eq!(a.code, INTERRUPTED, "{}", a.err);
    let d = json(out.join("diagnosis.json"));
    assert_eq!((&d["verdict"], &d["interrupted"]), (&"undecided".into(), &true.into()));
    // Far from the measurement, but by a fit that had just begun: that something is missing would be a guess.
    assert!(d["baseline"]["rms"].as_f64().unwrap() > 2.0 * d["baseline"]["noise"].as_f64().unwrap(), "{}", d["baseline"]);
    assert!(d["sentence"].as_str().unwrap().starts_with("Nothing is decided"), "{}", d["sentence"]);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("The diagnosis was interrupted"));
    // What it writes can be read, and it goes on from there; without time it still says what it knows, and what is open.
    palpate::Experiment::open(out.join("model.toml")).unwrap();
    succeed(&["diagnose", arg(&scene), "--out", arg(&out), "--backend", "cpu", "--resume", "--budget", "0.0001"]);
    let d = json(out.join("diagnosis.json"));
    assert_eq!((&d["verdict"], &d["interrupted"]), (&"undecided".into(), &false.into()));
    assert!(d["not_tried"].as_array().unwrap().len() > 20, "{}", d["not_tried"]);
    assert!(
        d["sentence"].as_str().unwrap().contains("the time was over before every known effect was tried"),
        "{}",
        d["sentence"]
    );
}
