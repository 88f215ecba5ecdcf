//! The program as a process of its own: what depends on its environment, its memory, and the job for a runner.

use palpate_gpu::AdapterReport;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A soft block on a clamp, pushed sideways.
const BLOCK: &str = include_str!("block.toml");

/// The program in an environment that is the same everywhere. Where no session gives it a folder, Mesa's Wayland layer complains
/// on stderr, which is not the program's line.
fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.env_remove("PALPATE_ADAPTER").env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command
}

fn run(command: &mut Command) -> (i32, String, String) {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    let text = |b: Vec<u8>| String::from_utf8(b).expect("the command line speaks UTF-8");
    (status.code().expect("no signal"), text(stdout), text(stderr))
}

/// The first adapter that can run the kernels and has this in its name; `None` where there is none and none is required.
fn adapter(name: &str) -> Option<AdapterReport> {
    let usable: Vec<AdapterReport> = palpate_gpu::adapters().into_iter().filter(|a| a.refusal.is_none()).collect();
    let required = std::env::var("PALPATE_GPU").is_ok_and(|v| v == "require");
    assert!(!usable.is_empty() || !required, "PALPATE_GPU=require, but there is no usable graphics adapter");
    let found = usable.into_iter().find(|a| a.name.contains(name));
    if found.is_none() {
        eprintln!("skipped: no graphics adapter {name}");
    }
    found
}

fn scene() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("block.toml");
    fs::write(&path, BLOCK).expect("writable");
    (folder, path)
}

#[test]
fn an_adapter_that_does_not_exist_is_one_line_with_a_way_out() {
    let (folder, scene) = scene();
    for verb in ["simulate", "observe"] {
        let mut command = program();
        command.args(["--progress", "none", verb]).arg(&scene).args(["--backend", "gpu", "--out"]).arg(folder.path().join("out"));
        if verb == "observe" {
            command.args(["--camera", "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=8x6"]);
        }
        for (card, told) in [("no such card", "\"no such card\""), ("77", "index 77"), ("ff:1f.7", "PCI address 0000:ff:1f.7")] {
            let (code, out, err) = run(command.env("PALPATE_ADAPTER", card));
            assert_eq!((code, out.as_str()), (1, ""), "{verb}: {err}");
            assert_eq!(err.lines().count(), 1, "{verb}: {err}");
            for word in ["error: --backend gpu: ", told, "found: ", "hint: ", "--backend cpu"] {
                assert!(err.contains(word), "{verb}: \"{word}\" is not in: {err}");
            }
        }
    }
}

/// A machine without drivers: one clear error where the device was asked for, the CPU where it was not.
#[cfg(target_os = "linux")]
#[test]
fn without_any_adapter_there_is_one_error_with_a_way_out_and_auto_takes_the_cpu() {
    let (folder, scene) = scene();
    let simulate = |backend: &str| {
        let mut command = program();
        command.args(["--progress", "none", "simulate"]).arg(&scene);
        command.args(["--backend", backend, "--every", "8", "--out"]).arg(folder.path().join("out"));
        command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
        command
    };
    let (code, out, err) = run(&mut simulate("gpu"));
    assert_eq!((code, out.as_str()), (1, ""), "{err}");
    assert_eq!(err.lines().count(), 1, "{err}");
    for word in ["error: --backend gpu: no graphics adapter", "found: none", "hint: install a Vulkan driver", "--backend cpu"] {
        assert!(err.contains(word), "\"{word}\" is not in: {err}");
    }
    // Whether or not an adapter is named, which has it look for one.
    for named in ["", "llvmpipe"] {
        let (code, _, err) = run(simulate("auto").env("PALPATE_ADAPTER", named));
        assert_eq!(code, 0, "{err}");
        let told = err.lines().find(|l| l.starts_with("backend: ")).unwrap_or_else(|| panic!("no choice is told: {err}"));
        assert!(told.starts_with("backend: cpu (auto: ") && told.contains("no graphics "), "{told}");
    }
}

/// What `--backend auto` says it measured: the time of what it picked comes first.
fn check_choice(err: &str, step: &str, name: &str) {
    let told = err.lines().find(|l| l.starts_with("backend: ")).unwrap_or_else(|| panic!("no choice is told: {err}"));
    let (picked, reason) = told.split_once(&format!(" (auto: {step} takes ")).unwrap_or_else(|| panic!("{told}"));
    let times: Vec<f64> = reason.split(" ms").filter_map(|w| w.rsplit(' ').next()?.parse().ok()).collect();
    assert!(reason.contains(name) && times.len() == 2 && times[0] <= times[1], "{told}");
    let device_first = reason.find(name) < reason.find(" ms, ");
    assert_eq!(picked, if device_first { "backend: gpu" } else { "backend: cpu" }, "{told}");
}

#[test]
fn auto_takes_what_it_measured_to_be_faster_and_says_so() {
    let Some(adapter) = adapter("") else { return };
    let name = adapter.name.split(" (").next().unwrap_or_default().to_string();
    let (folder, scene) = scene();
    let path = |name: &str| folder.path().join(name);
    let simulated = |out: &str| {
        let mut command = program();
        command.arg("simulate").arg(&scene).args(["--backend", "auto", "--format", "obj", "--every", "6", "--out"]);
        let (code, _, err) = run(command.arg(path(out)).env("PALPATE_ADAPTER", &name).env("XDG_CACHE_HOME", path("cache")));
        assert_eq!(code, 0, "{err}");
        check_choice(&err, "a step", &name);
        err.lines().find(|l| l.starts_with("backend: ")).map(str::to_string).unwrap_or_default()
    };
    let told = simulated("out");
    assert_eq!(told.contains(", a software adapter and "), adapter.is_software(), "{told}");
    // Whoever asks again gets the same answer, without a measurement.
    assert_eq!(simulated("again"), told.strip_suffix(')').unwrap_or_default().to_string() + ", as measured before)");
    // A fit is timed by what its optimiser asks of a step.
    let camera = ["--camera", "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30", "--backend", "cpu", "--out"];
    assert_eq!(run(program().arg("observe").arg(&scene).args(camera).arg(path("seen"))).0, 0);
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\noptimizer = \"rprop\"\nstarts = 2\n\
               iterations = 1\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.0e4, 4.0e4]\n";
    fs::write(path("fit.toml"), BLOCK.to_string() + fit).expect("writable");
    for (optimizer, step) in [
        ("rprop", "a step with the cost and its gradient"),
        ("gauss-newton", "a step with the cost and one derivative"),
        ("nelder-mead", "a step with the cost"),
    ] {
        let mut command = program();
        command.args(["fit", "--no-grid-check"]).arg(path("fit.toml")).args([
            "--optimizer",
            optimizer,
            "--pictures",
            "0",
            "--out",
        ]);
        let (code, _, err) = run(command.arg(path(optimizer)).env("PALPATE_ADAPTER", &name));
        assert_eq!(code, 0, "{err}");
        check_choice(&err, step, &name);
    }
    // Of a body that the device cannot compute it says why.
    let laws = "[[effect]]\nkind = \"strain-stiffening\"\ncoefficient = 0.1\n".repeat(17);
    fs::write(path("laws.toml"), BLOCK.to_string() + &laws).expect("writable");
    let mut command = program();
    command.arg("simulate").arg(path("laws.toml")).args(["--every", "8", "--out"]).arg(path("laws"));
    let (code, _, err) = run(command.env("PALPATE_ADAPTER", &name));
    assert_eq!(code, 0, "{err}");
    let told = err.lines().find(|l| l.starts_with("backend: cpu (auto: ")).unwrap_or_else(|| panic!("no choice is told: {err}"));
    assert!(told.ends_with("cannot compute this body: the GPU backend does not support more than 16 laws of cells)"), "{told}");
}

#[test]
fn devices_are_listed_with_limits_and_what_they_can_run() {
    let Some(first) = adapter("") else { return };
    let (code, text, _) = run(program().args(["inspect", "--devices"]));
    assert_eq!(code, 0);
    let binding = "max_storage_buffer_binding_size";
    let place = first.pci.map_or("no PCI address".into(), |p| format!("PCI {p}"));
    let listed = format!("{}  {}", first.index, first.name);
    for word in [
        listed.as_str(),
        place.as_str(),
        "PALPATE_ADAPTER chooses",
        "runs every kernel",
        binding,
        "max_buffer_size",
        "lanes of a cell talk by",
    ] {
        assert!(text.contains(word), "\"{word}\" is not in:\n{text}");
    }
    let (_, json, _) = run(program().args(["inspect", "--devices", "--json"]));
    let list: Value = serde_json::from_str(&json).expect("it is JSON");
    assert_eq!(list["format"], "devices/1");
    let device = list["devices"].as_array().and_then(|l| l.iter().find(|d| d["name"] == first.name.as_str()));
    let device = device.unwrap_or_else(|| panic!("{list}"));
    assert_eq!((&device["usable"], &device["verdict"]), (&true.into(), &"runs every kernel".into()));
    assert_eq!(device["limits"][binding], first.limits.max_storage_buffer_binding_size);
    assert_eq!(device["subgroups"], first.subgroups);
    assert_eq!((&device["index"], &device["pci"]), (&first.index.into(), &first.pci.map(|p| p.to_string()).into()));
    // By its number it is found.
    let (folder, scene) = scene();
    let mut command = program();
    command.arg("simulate").arg(&scene).args(["--backend", "gpu", "--every", "8", "--out"]).arg(folder.path().join("out"));
    let (code, _, err) = run(command.env("PALPATE_ADAPTER", first.index.to_string()));
    assert_eq!(code, 0, "{err}");
}

/// Largest resident memory of a command while it runs [B].
#[cfg(target_os = "linux")]
fn peak(command: &mut Command) -> f64 {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
    let status = format!("/proc/{}/status", child.id());
    let mut kilobytes = 0.0;
    // The kernel keeps the largest value itself: only what is allocated within the last look is missed.
    while child.try_wait().expect("it can be waited for").is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        kilobytes = line.and_then(|l| l.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(kilobytes);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(child.wait().expect("it has ended").success());
    1024.0 * kilobytes
}

#[cfg(target_os = "linux")]
#[test]
fn inspect_foresees_the_memory_of_a_fit_on_the_cpu() {
    let folder = watched();
    let path = |name: &str| folder.path().join(name);
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\noptimizer = \"lbfgs\"\nstarts = 4\niterations = 0\n\
               threads = 2\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.0e4, 4.0e4]\n";
    // What the program takes by itself is the same for both: the difference is the body's.
    let taken = ["0.02", "0.004"].map(|h| {
        let file = path("fit.toml");
        let scene = BLOCK.replace("cell_size = 0.02", &format!("cell_size = {h}")).replace("steps = 8", "steps = 3");
        fs::write(&file, scene + fit).expect("writable");
        let (code, json, err) = run(program().args(["inspect", "--json"]).arg(&file));
        assert_eq!(code, 0, "{err}");
        let said: Value = serde_json::from_str(&json).expect("it is JSON");
        assert_eq!(said["batch"], 4, "{said}");
        let mut fit = program();
        fit.args(["fit", "--no-grid-check"]).arg(&file).args(["--backend", "cpu", "--pictures", "0", "--out"]).arg(path(h));
        (said["memory"].as_f64().expect("a number of bytes"), peak(&mut fit))
    });
    let (said, real) = (taken[1].0 - taken[0].0, taken[1].1 - taken[0].1);
    println!("{:.1} MB foreseen, {:.1} MB taken; {taken:?}", said / 1e6, real / 1e6);
    // Not counted is what cutting the body out of its grid takes in passing, some 20 % here.
    assert!((said / real - 1.0).abs() < 0.3, "{said} is not {real}");
}

/// `.ci/batch-lavapipe` with the program that was just built.
fn job(from: &Path, scenes: &Path, out: &Path) -> (i32, String, String) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.ci/batch-lavapipe");
    run(Command::new(script).args([scenes, out]).current_dir(from).env("PALPATE", env!("CARGO_BIN_EXE_palpate")))
}

#[test]
fn the_job_for_a_runner_tells_good_from_bad_and_goes_on_where_it_was() {
    if adapter("llvmpipe").is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (scenes, out) = (folder.path().join("scenes"), folder.path().join("out"));
    fs::create_dir(&scenes).expect("a new folder");
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets").canonicalize().expect("assets are there");
    let copy = |name: &str, broken: bool| {
        let text = fs::read_to_string(assets.join("batch").join(name)).expect("the scene is there");
        let recordings = if broken { "../nowhere".to_string() } else { assets.join("recordings").display().to_string() };
        // Two iterations instead of eight: what is tested here is the job.
        let text = text.replace("../recordings", &recordings).replace("iterations = 8", "iterations = 2");
        fs::write(scenes.join(name), text).expect("writable");
    };
    copy("firm.toml", true);
    copy("soft.toml", false);
    let summary = || -> Value {
        assert_eq!(fs::read_to_string(out.join("summary.csv")).expect("a table").lines().count(), 3);
        serde_json::from_str(&fs::read_to_string(out.join("summary.json")).expect("a summary")).expect("it is JSON")
    };
    // Paths are those of whoever runs it.
    let (code, told, err) = job(folder.path(), Path::new("scenes"), Path::new("out"));
    assert_eq!(code, 1, "{err}");
    assert!(told.contains("1 of 2 scenes complete") && err.contains("1/2 firm: bad-input"), "{told}{err}");
    let rows = summary();
    let row = |k: usize, key: &str| rows["scenes"][k][key].clone();
    let told = [row(0, "status"), row(1, "status"), row(1, "backend")];
    assert_eq!(told, ["bad-input", "complete", "gpu"].map(Value::from));
    assert!(row(0, "message").as_str().is_some_and(|m| m.contains("nowhere")), "{rows}");
    let written = || fs::metadata(out.join("soft/result.json")).and_then(|m| m.modified()).expect("a result");
    let before = written();
    let (code, _, err) = job(&assets, &scenes, &out);
    assert_eq!(code, 1, "{err}");
    assert!(err.contains("2/2 soft: taken over"), "{err}");
    // What was wrong with it before is still said.
    let message = summary()["scenes"][1]["message"].clone();
    assert!(message.as_str().is_some_and(|m| m.starts_with("taken over: ") && m.contains("2 iterations")), "{message}");
    assert_eq!(written(), before);
    // What was broken is mended: everything succeeds, and only that is computed.
    copy("firm.toml", false);
    let (code, _, err) = job(&assets, &scenes, &out);
    assert_eq!((code, written()), (0, before), "{err}");
}

/// Ends the process, whatever happens to the test.
#[cfg(unix)]
struct Running(std::process::Child);

#[cfg(unix)]
impl Running {
    /// Sends what Ctrl-C sends, waits for the end, and gives the exit code.
    fn interrupt(&mut self) -> Option<i32> {
        assert!(Command::new("kill").args(["-INT", &self.0.id().to_string()]).status().expect("kill is there").success());
        self.0.wait().expect("it ends").code()
    }
}

/// A folder with what a camera sees of the scene, under `seen`.
#[cfg(unix)]
fn watched() -> tempfile::TempDir {
    let (folder, scene) = scene();
    let camera = ["--camera", "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30", "--backend", "cpu", "--out"];
    assert_eq!(run(program().arg("observe").arg(&scene).args(camera).arg(folder.path().join("seen"))).0, 0);
    folder
}

#[cfg(unix)]
impl Drop for Running {
    fn drop(&mut self) {
        // It has usually ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(unix)]
#[test]
fn an_interrupt_keeps_the_best_so_far_and_logs_show_progress_when_asked_to() {
    let folder = watched();
    let path = |name: &str| folder.path().join(name);
    // Short evaluations, a round of them in seconds, and minutes of rounds.
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\noptimizer = \"rprop\"\nstarts = 200\niterations = 50\n\
               [[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1.0e4, 4.0e4]\n";
    fs::write(path("fit.toml"), BLOCK.to_string() + fit).expect("writable");
    let journal = || fs::read_to_string(path("out/journal.jsonl")).unwrap_or_default();
    let log = || fs::read_to_string(path("log")).unwrap_or_default();
    let stopped_when = |options: &[&str], ready: &dyn Fn(Duration) -> bool| {
        let mut fit = program();
        fit.args(["fit", "--no-grid-check"])
            .arg(path("fit.toml"))
            .args(["--backend", "cpu", "--batch", "2", "--out"])
            .arg(path("out"))
            .args(options);
        let errors = fs::File::create(path("log")).expect("writable");
        let mut fit = Running(fit.stdout(Stdio::null()).stderr(errors).spawn().expect("the program starts"));
        let begun = Instant::now();
        while !ready(begun.elapsed()) {
            assert!(fit.0.try_wait().expect("it can be waited for").is_none(), "it has ended: {}", log());
            assert!(begun.elapsed() < Duration::from_secs(120), "nothing happens: {}", log());
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(fit.interrupt(), Some(130), "{}", log());
        assert!(log().contains("interrupted: stopping at the next time step"), "{}", log());
        let text = fs::read_to_string(path("out/result.json")).expect("the best so far is written");
        let result: Value = serde_json::from_str(&text).expect("it is JSON");
        assert_eq!(result["status"], "interrupted");
        assert!(result["parameters"][0]["value"].as_f64().is_some_and(|e| e > 0.0), "{result}");
        result
    };
    // Lines come after two seconds, unless somebody wants none.
    let first = stopped_when(&["--progress", "none"], &|t| t > Duration::from_secs(4) && journal().lines().count() > 3);
    assert!(!log().contains("fitting, "), "{}", log());
    let kept = journal();
    let second = stopped_when(&["--resume"], &|_| log().contains("fitting, ") && journal().len() > kept.len());
    assert!(journal().starts_with(&kept), "it has begun anew");
    assert!(second["cost"]["final"].as_f64() <= first["cost"]["final"].as_f64(), "{first} {second}");
    assert!(path("out/previous-1/result.json").exists(), "the first result is kept");
}

#[cfg(unix)]
#[test]
fn while_auto_measures_a_line_says_so_after_two_seconds() {
    // Only a software adapter is sure to take that long.
    if adapter("llvmpipe").is_none() {
        return;
    }
    let folder = watched();
    let path = |name: &str| folder.path().join(name);
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\n[[fit.parameter]]\n\
               path = \"material.youngs_modulus\"\nstart = 1.0e4\n";
    fs::write(path("fine.toml"), BLOCK.replace("cell_size = 0.02", "cell_size = 0.004") + fit).expect("writable");
    for (verb, what) in [("fit", "fitting"), ("diagnose", "diagnosing"), ("batch", "1/1 fine")] {
        let mut command = program();
        command.arg(verb).arg(path("fine.toml")).args(["--backend", "auto", "--progress", "lines", "--out"]).arg(path(verb));
        command.env("PALPATE_ADAPTER", "llvmpipe").env("XDG_CACHE_HOME", path("cache")).stdout(Stdio::null());
        let mut running = Running(command.stderr(Stdio::piped()).spawn().expect("the program starts"));
        let mut lines = BufReader::new(running.0.stderr.take().expect("a pipe")).lines().map(|l| l.expect("it speaks UTF-8"));
        let first = lines.next().unwrap_or_default();
        assert!(first.starts_with(&format!("{what}, 2 s: ")), "{first}");
        // On a busy machine reading takes as long; then the next line is of the measurement, which takes minutes.
        let told = if first.ends_with(": reading") { lines.next().unwrap_or_default() } else { first };
        assert!(told.starts_with(&format!("{what}, ")) && told.contains(" s: auto: "), "{told}");
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_diagnosis_ends_within_two_seconds_with_what_it_knows() {
    let folder = watched();
    let path = |name: &str| folder.path().join(name);
    let fit = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\niterations = 20\n\
               [[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = 1.0e4\n";
    // Cells so small that the whole diagnosis takes minutes.
    let fine = BLOCK.replace("cell_size = 0.02", "cell_size = 0.008");
    assert_ne!(fine, BLOCK);
    fs::write(path("fine.toml"), fine + fit).expect("writable");
    let size = |name: &str| fs::metadata(path(name)).map_or(0, |m| m.len());
    // In the fit of the baseline, and in the search.
    for begun in ["out/journal.jsonl", "out/checkpoint.jsonl"] {
        let mut diagnosis = program();
        diagnosis.arg("diagnose").arg(path("fine.toml")).args(["--backend", "cpu", "--out"]).arg(path("out"));
        let mut diagnosis = Running(diagnosis.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts"));
        let clock = Instant::now();
        while size(begun) < 200 {
            assert!(diagnosis.0.try_wait().expect("it can be waited for").is_none(), "it has ended");
            assert!(clock.elapsed() < Duration::from_secs(300), "nothing happens");
            std::thread::sleep(Duration::from_millis(5));
        }
        let asked = Instant::now();
        assert_eq!(diagnosis.interrupt(), Some(130));
        let taken = asked.elapsed();
        assert!(taken < Duration::from_secs(2), "{begun}: {taken:?}");
        let text = fs::read_to_string(path("out/diagnosis.json")).expect("what is known is written");
        let result: Value = serde_json::from_str(&text).expect("it is JSON");
        assert_eq!((&result["verdict"], &result["interrupted"]), (&"undecided".into(), &true.into()), "{begun}");
        let tried = result["tried"].as_array().expect("candidates are listed");
        let open = tried.iter().filter(|t| t["status"] == "not yet fitted" && t["promised"].is_number());
        assert!(open.count() > 10, "{begun}: {text}");
        assert!(path("out/report.html").exists() && path("out/model.toml").exists(), "{begun}");
        fs::remove_dir_all(path("out")).expect("removable");
    }
}
