//! A device that is lost: who computes on it ends in good order, and the next one gets another device.

use super::*;
use crate::Experiment;
use crate::{Interrupt, Liveliness};
use palpate_engine::{ParamBatch, Request};
use serde_json::Value;
use std::path::Path;
use std::sync::MutexGuard;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The shared device, for one test at a time; `None` where there is none and none is required.
fn shared() -> Option<(MutexGuard<'static, ()>, GpuBackend)> {
    static ALONE: Mutex<()> = Mutex::new(());
    let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    match gpu() {
        Ok(device) => Some((alone, device)),
        Err(e) => {
            assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "{e}");
            eprintln!("skipped: {e}");
            None
        }
    }
}

/// A soft block on a clamp, pushed sideways, and a fit of its stiffness to what a camera sees of it.
const BLOCK: &str = include_str!("../tests/block.toml");
const FIT: &str = r#"
[observation]
recording = "seen"
cost = "sparse-surface"
[fit]
optimizer = "rprop"
iterations = 6
starts = 2
[[fit.parameter]]
path = "material.youngs_modulus"
start = [8.0e3, 6.0e4]
"#;

fn command(arguments: &[&str]) -> (i32, String) {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let all = std::iter::once("palpate").chain(arguments.iter().copied());
    let code = crate::cli::run(all, &mut out, &mut err, Interrupt::default(), Liveliness::Silent);
    (code, String::from_utf8_lossy(&err).into_owned())
}

/// A folder with a recording and a fit to it.
fn recorded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(path("scene.toml"), BLOCK).expect("writable");
    std::fs::write(path("fit.toml"), BLOCK.replace("2.0e4", "1.0e4") + FIT).expect("writable");
    let camera = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30";
    let (code, err) = command(&["observe", &path("scene.toml"), "--camera", camera, "--out", &path("seen"), "--backend", "cpu"]);
    assert_eq!(code, 0, "{err}");
    folder
}

/// `result.json` without what is different in every run.
fn result(folder: &Path) -> Value {
    let text = std::fs::read_to_string(folder.join("result.json")).expect("a result was written");
    let mut value: Value = serde_json::from_str(&text).expect("it is JSON");
    value["seconds"] = Value::Null;
    value
}

/// A run on a device that was lost ends with one error, which names the scene, the reason and the ways out.
fn ends_with_the_device(code: i32, err: &str, scene: &str) {
    assert_eq!(code, 1, "{err}");
    let errors: Vec<&str> = err.lines().filter(|l| l.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{err}");
    for word in [scene, "the device was lost", "--backend cpu", "--resume"] {
        assert!(errors[0].contains(word), "\"{word}\" is not in: {err}");
    }
}

#[test]
fn a_lost_device_is_opened_anew() {
    let Some((_alone, first)) = shared() else { return };
    let experiment = Experiment::from_toml(BLOCK, "block.toml").unwrap_or_else(|e| panic!("{e}"));
    let plan = experiment.plan();
    let theta = ParamBatch::from_rows(std::slice::from_ref(&plan.theta));
    let mut old = Backend::Gpu.evaluator(plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let mut two = Backend::Gpu.evaluator(plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let well = old.evaluate(&theta, &Request::default());
    assert_eq!(well[0].failure, None);
    first.gpu().destroy();
    let failure = old.evaluate(&theta, &Request::default()).remove(0).failure.unwrap_or_else(|| panic!("the device is gone"));
    assert!(failure.to_string().contains("lost") && failure.to_string().contains("--backend cpu"), "{failure}");
    // Where one simulation runs there is no batch that could be smaller.
    let both = two.evaluate(&theta, &Request::default()).remove(0).failure.unwrap_or_else(|| panic!("the device is gone"));
    assert!(!failure.to_string().contains("--batch") && both.to_string().contains("--batch N"), "{failure} {both}");
    // Whoever had the old device keeps its failure; the next one computes, and the same.
    let mut new = Backend::Gpu.evaluator(plan, 1).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(new.evaluate(&theta, &Request::default()), well);
    assert!(old.evaluate(&theta, &Request::default())[0].failure.is_some());
}

#[test]
fn a_fit_whose_device_is_lost_keeps_its_best_and_resumes_to_the_same_bits() {
    let Some((_alone, device)) = shared() else { return };
    let folder = recorded();
    let path = |name: &str| folder.path().join(name);
    let fit = |out: &Path, more: &[&str]| {
        let (scene, out) = (path("fit.toml").display().to_string(), out.display().to_string());
        command(&[&["fit", &scene, "--backend", "gpu", "--pictures", "0", "--out", &out], more].concat())
    };
    let (whole, broken) = (path("whole"), path("broken"));
    assert_eq!(fit(&whole, &[]).0, 0);
    let journal = broken.join("journal.jsonl");
    let rounds = || std::fs::read_to_string(&journal).map_or(0, |t| t.lines().count().saturating_sub(1));
    let (code, err) = std::thread::scope(|scope| {
        let fit = scope.spawn(|| fit(&broken, &[]));
        while rounds() < 3 && !fit.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
        }
        device.gpu().destroy();
        fit.join().expect("the fit does not panic")
    });
    ends_with_the_device(code, &err, "fit.toml");
    let cut = result(&broken);
    assert_eq!(cut["status"], "broken-off", "{cut}");
    assert!(cut["parameters"][0]["value"].is_f64() && cut["residual"]["rms"].is_f64(), "the best so far is written: {cut}");
    assert!(cut["error"].as_str().is_some_and(|e| e.contains("lost")));
    let before = rounds();
    let (code, err) = fit(&broken, &["--resume"]);
    assert_eq!(code, 0, "{err}");
    assert!(rounds() > before);
    assert_eq!(result(&broken), result(&whole), "to the last bit");
}

#[test]
fn a_batch_whose_device_is_lost_goes_on_with_another() {
    let Some((_alone, device)) = shared() else { return };
    let folder = recorded();
    let path = |name: &str| folder.path().join(name).display().to_string();
    // Two scenes more after the one that is disturbed.
    for name in ["second.toml", "third.toml"] {
        let text = std::fs::read_to_string(path("fit.toml")).expect("a scene");
        std::fs::write(path(name), text.replace("iterations = 6", "iterations = 2")).expect("writable");
    }
    let whole = folder.path().join("whole");
    let alone = command(&["fit", &path("second.toml"), "--backend", "gpu", "--pictures", "0", "--out", &path("whole")]);
    assert_eq!(alone.0, 0, "{}", alone.1);
    let arguments = ["fit.toml", "second.toml", "third.toml"].map(path);
    let arguments = [&["batch".to_string()], &arguments[..], &["--backend", "gpu", "--pictures", "0", "--out"].map(String::from)];
    let arguments = [&arguments.concat()[..], &[path("all")]].concat();
    let journal = folder.path().join("all/fit/journal.jsonl");
    let rounds = || std::fs::read_to_string(&journal).map_or(0, |t| t.lines().count().saturating_sub(1));
    let (code, err) = std::thread::scope(|scope| {
        let batch = scope.spawn(|| command(&arguments.iter().map(String::as_str).collect::<Vec<_>>()));
        while rounds() < 3 && !batch.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
        }
        device.gpu().destroy();
        batch.join().expect("a batch does not panic")
    });
    assert_eq!(code, 1, "{err}");
    let text = std::fs::read_to_string(path("all/summary.json")).expect("a summary is written");
    let summary: Value = serde_json::from_str(&text).expect("it is JSON");
    let row = |k: usize, key: &str| summary["scenes"][k][key].clone();
    let states = [0, 1, 2].map(|k| row(k, "status"));
    assert_eq!(states, ["failed", "complete", "complete"].map(Value::from), "{err}");
    assert!(row(0, "message").as_str().is_some_and(|m| m.contains("lost") && m.contains("--backend cpu")), "{summary}");
    assert!((1..3).all(|k| row(k, "backend") == "gpu"), "{summary}");
    // What came after is what it is alone.
    assert_eq!(result(&folder.path().join("all/second")), result(&whole));
}

#[test]
fn a_diagnosis_whose_device_is_lost_says_so_and_blames_no_candidate() {
    let Some((_alone, _)) = shared() else { return };
    let folder = recorded();
    let scene = folder.path().join("slow.toml");
    let slow =
        BLOCK.replace("[0.6, 0.0, 0.0]", "[0.2, 0.0, 0.0]") + "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n";
    std::fs::write(&scene, slow).expect("writable");
    let experiment = Experiment::open(&scene).unwrap_or_else(|e| panic!("{e}"));
    let fits = AtomicBool::new(false);
    let mut hear = |what: &str| fits.store(what.starts_with("fitting"), Ordering::SeqCst);
    let found = std::thread::scope(|scope| {
        let run = scope.spawn(|| {
            let options = crate::DiagnoseOptions {
                backend: Backend::Gpu,
                on_progress: Some(&mut hear),
                ..crate::DiagnoseOptions::default()
            };
            crate::diagnose(std::slice::from_ref(&experiment), None, options)
        });
        // Every fit opens a device where there is none, so one is lost again and again, from when candidates are fitted.
        while !run.is_finished() {
            std::thread::sleep(Duration::from_millis(20));
            if fits.load(Ordering::SeqCst)
                && let Ok(device) = gpu()
            {
                device.gpu().destroy();
            }
        }
        run.join().expect("a diagnosis does not panic")
    });
    let found = found.unwrap_or_else(|e| panic!("{e}"));
    assert!(found.broken.as_ref().is_some_and(|e| e.contains("lost")), "{:?}", found.broken);
    let d = &found.diagnosis;
    assert!(d.verdict == palpate_diagnose::Verdict::Undecided && d.interrupted, "{}", d.sentence());
    assert!(!d.not_tried.iter().any(|n| n.contains("lost")), "{:?}", d.not_tried);
}

/// What `inspect` says before, and what the device's allocator says during the fit: starts side by side with a tape, and one start
/// with derivatives.
#[test]
fn inspect_foresees_the_device_memory_of_a_fit() {
    let Some((_alone, device)) = shared() else { return };
    let Some(before) = device.gpu().allocated() else { return println!("skipped: the driver tells no sizes") };
    let folder = recorded();
    let file = folder.path().join("fine.toml");
    let scene = BLOCK.replace("cell_size = 0.02", "cell_size = 0.01").replace("steps = 8", "steps = 4");
    let free = "[[fit.parameter]]\npath = \"material.poisson_ratio\"\nstart = [0.3, 0.45]\n";
    for (optimizer, starts) in [("rprop", 3), ("gauss-newton", 2), ("lbfgs", 1), ("gauss-newton-cg", 1)] {
        let fit = FIT.replace("rprop", optimizer).replace("starts = 2", &format!("starts = {starts}"));
        // The recording is kept small; cells are fine enough for the body to take more than fixed tables do.
        std::fs::write(&file, scene.clone() + &fit + free).expect("writable");
        let (mut out, mut err) = (Vec::new(), Vec::new());
        let arguments = ["palpate", "inspect", &file.display().to_string(), "--json"].map(String::from);
        crate::cli::run(arguments, &mut out, &mut err, Interrupt::default(), Liveliness::Silent);
        let said: Value = serde_json::from_slice(&out).expect("inspect answers in JSON");
        assert_eq!(said["device_batch"], starts, "{said}");
        let mut most = 0;
        let mut look = |_: &palpate_fit::Progress| most = most.max(device.gpu().allocated().unwrap_or(0) - before);
        let options =
            crate::FitOptions { backend: Backend::Gpu, iterations: Some(1), on_iteration: Some(&mut look), ..Default::default() };
        Experiment::open(&file).and_then(|e| e.fit(options)).unwrap_or_else(|e| panic!("{e}"));
        let off = said["device_memory"].as_f64().expect("a number of bytes") / most as f64 - 1.0;
        println!("{optimizer}, {starts} starts: {} foreseen, {most} allocated: {:+.1} %", said["device_memory"], 100.0 * off);
        assert!(off.abs() < 0.1, "{optimizer}: {} is not {most}", said["device_memory"]);
    }
}

#[test]
fn residuals_of_a_result_come_from_the_cpu_where_the_device_has_none() {
    let folder = recorded();
    let file = folder.path().join("laws.toml");
    // More laws than the kernels take: refused by every device, and by none.
    let laws = "[[effect]]\nkind = \"strain-stiffening\"\ncoefficient = 0.1\n".repeat(17);
    std::fs::write(&file, BLOCK.to_string() + FIT + &laws).expect("writable");
    let e = Experiment::open(&file).unwrap_or_else(|e| panic!("{e}"));
    let theta = &e.plan().theta;
    let mut notes = Vec::new();
    let at = |backend, notes: &mut Vec<String>| {
        crate::fitting::residuals_at(&e, backend, theta, &Stop::default(), notes).map(|r| r.rms)
    };
    let cpu = at(Backend::Cpu, &mut notes);
    assert!(cpu.as_ref().is_ok_and(|rms| *rms > 0.0) && notes.is_empty(), "{cpu:?} {notes:?}");
    assert_eq!(at(Backend::Gpu, &mut notes).ok(), cpu.ok());
    assert!(notes.len() == 1 && notes[0].contains("computed on the CPU: ") && notes[0].contains("hint: "), "{notes:?}");
}
