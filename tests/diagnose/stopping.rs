//! Diagnoses that are stopped: what is known is written, and said to be no more than that.

use super::SEEN;
use crate::cli::BLOCK;
use palpate::cli::INTERRUPTED;
use palpate::{Backend, Clock, DiagnoseOptions, Experiment, Interrupt, diagnose};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use support::command::{arg, json, palpate, stopped, succeed};

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
    let none = palpate(&["diagnose", arg(&scene), "--out", arg(&out), "--backend", "cpu", "--resume", "--budget", "0.0000001"]);
    assert_eq!(none.code, 1, "{}", none.out);
    assert!(none.err.contains("the budget was over before the scene had been simulated once"), "{}", none.err);
}

/// A scene of the assets with its recording, which `observe` makes.
fn biased(folder: &Path) -> PathBuf {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/diagnose");
    let camera = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30";
    let seen = folder.join("seen");
    let truth = assets.join("truth-biased.toml");
    let observe = ["observe", arg(&truth), "--camera", camera, "--noise", "0.0005", "--depth-scale", "0.0001"];
    succeed(&[&observe[..], &["--refine", "1.5", "--seed", "5", "--out", arg(&seen)]].concat());
    let text = fs::read_to_string(assets.join("biased.toml")).unwrap();
    let recording = text.lines().find(|l| l.trim_start().starts_with("recording")).unwrap();
    let scene = folder.join("biased.toml");
    fs::write(&scene, text.replace(recording, &format!("recording = {:?}", arg(&seen)))).unwrap();
    scene
}

/// Candidates of an answer that are marked as not yet fitted.
fn not_yet_fitted(d: &Value) -> Vec<&Value> {
    d["tried"].as_array().unwrap().iter().filter(|t| t["status"] == "not yet fitted").collect()
}

#[test]
fn a_budget_of_a_second_ends_in_time_with_a_ranking() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (biased(folder.path()), folder.path().join("why"));
    let began = Instant::now();
    let a = succeed(&["diagnose", arg(&scene), "--out", arg(&out), "--backend", "cpu", "--budget", "0.02"]);
    let taken = began.elapsed().as_secs_f64();
    // A tenth of 1.2 s, and a second for a machine on which other tests run.
    assert!(taken < 1.2 * 1.1 + 1.0, "{taken} s");
    let d = json(out.join("diagnosis.json"));
    // A fast machine gets as far as to name something; that others may explain it as well is said then.
    assert!(["undecided", "missing-effect"].iter().any(|v| d["verdict"] == *v) && d["interrupted"] == false, "{}", d["sentence"]);
    let told = d["sentence"].as_str().unwrap().contains("The search ended before it had tried to the end: ");
    assert!(told || d["verdict"] == "undecided", "{}", d["sentence"]);
    let open = not_yet_fitted(&d);
    assert!(open.len() > 10 && open.iter().all(|t| t["promised"].is_number()), "{}", d["tried"]);
    assert!(a.out.contains("not yet fitted: "), "{}", a.out);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("not yet fitted") && out.join("model.toml").exists());
}

#[test]
fn a_clock_that_a_test_moves_ends_a_diagnosis_where_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = Experiment::open(biased(folder.path())).unwrap();
    // Every look at the clock takes a millisecond: as many looks on every machine.
    let looks = Arc::new(AtomicU64::new(0));
    let shown = looks.clone();
    let answer = |limit: Option<u64>| {
        looks.store(0, Ordering::SeqCst);
        let shown = shown.clone();
        let options = DiagnoseOptions {
            backend: Backend::Cpu,
            budget: limit.map(Duration::from_millis),
            clock: Clock::new(move || Duration::from_millis(shown.fetch_add(1, Ordering::SeqCst))),
            ..DiagnoseOptions::default()
        };
        diagnose(std::slice::from_ref(&experiment), None, options).map(|d| d.diagnosis)
    };
    assert!(answer(Some(0)).is_err(), "not even the start is known");
    // After the first look, and before anything is fitted.
    let d = answer(Some(400)).unwrap();
    assert_eq!(d.verdict.name(), "undecided", "{}", d.sentence());
    assert!(!d.interrupted && !d.not_yet_fitted().is_empty(), "{}", d.sentence());
}
