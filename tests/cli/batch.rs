//! Many recordings in one command: one that fails harms no other, and what is done is not done again.

use super::{BLOCK, fitting::high, observed};
use palpate::{Interrupt, cli::INTERRUPTED};
use std::fs;
use support::command::{Answer, arg, json, palpate, stopped};

/// Three scenes in a folder: two that fit and, between them, one without a recording; and a file that is no scene.
fn folder() -> tempfile::TempDir {
    let folder = observed(BLOCK);
    let file = |name: &str| folder.path().join(name);
    let scene = fs::read_to_string(file("fit.toml")).unwrap();
    let scenes = file("scenes");
    fs::create_dir(&scenes).unwrap();
    let seen = scene.replace("\"seen\"", "\"../seen\"").replace("starts = 3", "starts = 1");
    fs::write(scenes.join("a.toml"), &seen).unwrap();
    fs::write(scenes.join("b.toml"), seen.replace("../seen", "../lost")).unwrap();
    fs::write(scenes.join("c.toml"), seen.replace("[8.0e3, 6.0e4]", "3.0e4")).unwrap();
    fs::write(scenes.join("notes.toml"), "colour = \"green\"\n").unwrap();
    folder
}

fn statuses(out: &std::path::Path) -> Vec<String> {
    let rows = json(out.join("summary.json"));
    rows["scenes"].as_array().unwrap().iter().map(|r| r["status"].as_str().unwrap().to_string()).collect()
}

#[test]
fn one_bad_scene_harms_no_other_and_finished_ones_are_taken_over() {
    let folder = folder();
    let (scenes, out) = (folder.path().join("scenes"), folder.path().join("out"));
    let run =
        |more: &[&str]| -> Answer { palpate(&[&["batch", "--no-grid-check", arg(&scenes), "--out", arg(&out)], more].concat()) };
    let first = run(&[]);
    assert_eq!(first.code, 1, "{}", first.err);
    assert_eq!(statuses(&out), ["complete", "bad-input", "complete"]);
    assert!(first.err.contains("lost") && first.out.contains("2 of 3 scenes complete"), "{}{}", first.err, first.out);
    let csv = fs::read_to_string(out.join("summary.csv")).unwrap();
    let head = csv.lines().next().unwrap();
    assert!(head.contains("material.youngs_modulus,material.youngs_modulus standard error"), "{head}");
    // What computed each scene is told where it was left open; nothing computed the one without a recording.
    assert!(head.starts_with("name,scene,status,seconds,backend,"), "{head}");
    let rows = json(out.join("summary.json"));
    let backends = [0, 1, 2].map(|k| rows["scenes"][k]["backend"].as_str().unwrap_or_default().to_string());
    let told: Vec<String> = csv.lines().skip(1).map(|l| l.split(',').nth(4).unwrap().to_string()).collect();
    assert_eq!((backends[1].as_str(), told.as_slice()), ("", &backends[..]));
    for (k, name) in [(1, "a"), (3, "c")] {
        let by = format!(" s ({})", backends[k - 1]);
        assert!(
            first.err.lines().any(|l| l.starts_with(&format!("{k}/3 {name}: complete in ")) && l.ends_with(&by)),
            "{}",
            first.err
        );
    }
    assert_eq!(csv.lines().count(), 4);
    for name in ["a", "c"] {
        let value = json(out.join(name).join("result.json"))["parameters"][0]["value"].as_f64().unwrap();
        // The recording was made with 20 kPa on the same grid; noise leaves some per mille.
        assert!((value / 2e4 - 1.0).abs() < 0.02, "{value}");
        assert!(out.join(name).join("fit.log").exists() && out.join(name).join("report.html").exists());
    }

    // The missing recording turns up: only that scene is computed.
    let written = |name: &str| {
        let files = ["result.json", "journal.jsonl", "report.html", "fit.log"].map(|f| out.join(name).join(f));
        files.map(|f| fs::metadata(f).unwrap().modified().unwrap())
    };
    let before = ["a", "c"].map(written);
    fs::write(scenes.join("b.toml"), fs::read_to_string(scenes.join("a.toml")).unwrap()).unwrap();
    // Also in smaller batches, which change no number.
    let second = run(&["--resume", "--batch", "1"]);
    assert_eq!(second.code, 0, "{}", second.err);
    assert_eq!(statuses(&out), ["complete"; 3]);
    assert_eq!(["a", "c"].map(written), before);
    assert!(second.err.contains("1/3 a: taken over\n") && second.err.contains("3/3 c: taken over\n"), "{}", second.err);
    let rows = json(out.join("summary.json"));
    assert_eq!([0, 1, 2].map(|k| rows["scenes"][k]["message"] == "taken over"), [true, false, true]);
    let aside = ["a", "b", "c"].map(|name| out.join(name).join("previous-1").exists());
    assert_eq!(aside, [false; 3], "nothing was computed twice");

    // A scene that changed is fitted again.
    let a = fs::read_to_string(scenes.join("a.toml")).unwrap();
    fs::write(scenes.join("a.toml"), a.replace("seed = 4", "seed = 5")).unwrap();
    assert_eq!(run(&["--resume"]).code, 0);
    assert_ne!(written("a"), before[0]);
    assert_eq!(written("c"), before[1]);
}

#[test]
fn a_scene_that_is_taken_over_keeps_its_warning() {
    let folder = observed(BLOCK);
    let (scene, out) = (folder.path().join("high.toml"), folder.path().join("out"));
    let text = fs::read_to_string(folder.path().join("fit.toml")).unwrap().replace("starts = 3", "starts = 1");
    fs::write(&scene, high(&text)).unwrap();
    let message = |more: &[&str]| {
        let a = palpate(&[&["batch", "--no-grid-check", arg(&scene), "--out", arg(&out)], more].concat());
        assert_eq!(a.code, 0, "{}", a.err);
        json(out.join("summary.json"))["scenes"][0]["message"].as_str().unwrap().to_string()
    };
    let warning = message(&[]);
    assert!(!warning.is_empty());
    // However often.
    for _ in 0..2 {
        assert_eq!(message(&["--resume"]), format!("taken over: {warning}"));
        assert!(fs::read_to_string(out.join("summary.csv")).unwrap().contains(&format!("taken over: {warning}")));
    }
}

#[test]
fn a_resumed_run_that_stops_early_forgets_no_scene_ahead() {
    let folder = folder();
    let (scenes, out) = (folder.path().join("scenes"), folder.path().join("out"));
    let arguments = ["batch", "--no-grid-check", arg(&scenes), "--out", arg(&out)];
    assert_eq!(palpate(&arguments).code, 1);
    // The first scene changed, and the run stops in its fit.
    let a = fs::read_to_string(scenes.join("a.toml")).unwrap();
    fs::write(scenes.join("a.toml"), a.replace("seed = 4", "seed = 5")).unwrap();
    let cut = stopped(&[&arguments[..], &["--resume"]].concat(), Interrupt::after(1));
    assert_eq!((cut.code, statuses(&out)), (INTERRUPTED, ["interrupted", "bad-input", "complete"].map(String::from).to_vec()));
    assert!(cut.err.contains(": the best so far is written; --resume goes on from there"), "{}", cut.err);
    let last = palpate(&[&arguments[..], &["--resume"]].concat());
    assert!(last.err.contains("3/3 c: taken over"), "{}", last.err);
}

#[test]
fn an_interrupted_batch_goes_on_where_it_was() {
    let folder = folder();
    let list = folder.path().join("list.txt");
    fs::write(&list, "# two scenes\nscenes/a.toml\n\nscenes/c.toml\n").unwrap();
    let (whole, broken) = (folder.path().join("whole"), folder.path().join("broken"));
    assert_eq!(palpate(&["batch", "--no-grid-check", arg(&list), "--out", arg(&whole)]).code, 0);
    let cut = stopped(&["batch", "--no-grid-check", arg(&list), "--out", arg(&broken)], Interrupt::after(2));
    assert_eq!(cut.code, INTERRUPTED, "{}", cut.err);
    assert_eq!(statuses(&broken), ["interrupted"]);
    assert_eq!(palpate(&["batch", "--no-grid-check", arg(&list), "--out", arg(&broken), "--resume"]).code, 0);
    for name in ["a", "c"] {
        let value = |f: &std::path::Path| json(f.join(name).join("result.json"))["parameters"].clone();
        assert_eq!(value(&whole), value(&broken), "to the last bit");
    }
}

/// What `.ci/batch-lavapipe` runs, on one of its scenes: the same answer as on the CPU.
#[test]
fn a_batch_on_the_gpu_backend_finds_what_the_cpu_finds() {
    if !support::gpu::there_is_one() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/batch/soft.toml");
    let found = |backend: &str| {
        let out = folder.path().join(backend);
        let a = palpate(&["batch", "--no-grid-check", arg(&scene), "--out", arg(&out), "--backend", backend]);
        assert_eq!(a.code, 0, "{}", a.err);
        let row = json(out.join("summary.json"))["scenes"][0].clone();
        assert_eq!((&row["status"], &row["backend"]), (&"complete".into(), &backend.into()));
        row["parameters"][0]["value"].as_f64().unwrap()
    };
    let (cpu, gpu) = (found("cpu"), found("gpu"));
    // Gauss–Newton ends where the gradient in single precision does: 1e-3 of the standard error's 0.2 % and less.
    assert!((gpu / cpu - 1.0).abs() < 1e-4, "{gpu} against {cpu}");
    // The recording is synthetic, from a finer grid and step: 10 kPa up to the error of this one.
    assert!((cpu / 1e4 - 1.0).abs() < 0.05, "{cpu}");
}

#[test]
fn nothing_to_fit_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let a = palpate(&["batch", "--no-grid-check", arg(folder.path())]);
    assert!(a.code == 2 && a.err.contains("holds no scene"), "{}", a.err);
    let list = folder.path().join("list.txt");
    fs::write(&list, "# nothing\n").unwrap();
    let a = palpate(&["batch", "--no-grid-check", arg(&list)]);
    assert!(a.code == 2 && a.err.contains("names no scene"), "{}", a.err);
}
