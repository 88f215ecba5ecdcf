//! The program against hostile surroundings: pipes, short memory, second processes, signals, numbers that nothing has.
#![cfg(target_os = "linux")]

mod memory;

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A soft block on a clamp, pushed sideways.
const BLOCK: &str = include_str!("../block.toml");

/// What turns it into a fit of its recording `seen`.
const FIT: &str = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n[fit]\nstarts = 6\niterations = 12\nseed = 4\n\
                   [[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [8.0e3, 6.0e4]\nbounds = [1.0e2, 1.0e7]\n";

const CAMERA: &str = "eye=0.25,-0.3,0.15 target=0.02,0.02,0.04 fov=25 size=40x30";

/// Longest time that anything here may take, on a machine that does much else.
const PATIENCE: Duration = Duration::from_secs(300);

fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.env_remove("PALPATE_ADAPTER").env("XDG_RUNTIME_DIR", std::env::temp_dir());
    command
}

fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    let text = |b: Vec<u8>| String::from_utf8(b).expect("the command line speaks UTF-8");
    (status.code(), text(stdout), text(stderr))
}

/// Ends within the patience, or is ended with a panic.
fn wait(child: &mut Child) -> Option<i32> {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("it can be waited for") {
            return status.code();
        }
        if begun.elapsed() > PATIENCE {
            child.kill().expect("it runs");
            panic!("it hangs");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Place {
        Place(tempfile::tempdir().expect("a folder"))
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.at(name);
        fs::create_dir_all(path.parent().expect("it has one")).expect("writable");
        fs::write(&path, text).expect("writable");
        path
    }

    fn pipe(&self, name: &str) {
        fs::create_dir_all(self.at(name).parent().expect("it has one")).expect("writable");
        let made = Command::new("mkfifo").arg(self.at(name)).status();
        assert!(made.is_ok_and(|s| s.success()), "mkfifo is part of every Unix");
    }

    /// The block's recording and a scene that fits it.
    fn observed(&self) -> PathBuf {
        let scene = self.write("block.toml", BLOCK);
        let mut command = program();
        command.arg("observe").arg(&scene).args(["--camera", CAMERA, "--noise", "0.0005", "--depth-scale", "0.0001"]);
        let (code, _, err) = run(command.args(["--backend", "cpu", "--out"]).arg(self.at("seen")));
        assert_eq!(code, Some(0), "{err}");
        self.write("fit.toml", &format!("{}{FIT}", BLOCK.replace("2.0e4", "1.0e4")))
    }
}

/// A fit of the scene on the CPU.
fn fit(scene: &Path, out: &Path) -> Command {
    let mut command = program();
    command.arg("fit").arg(scene).args(["--backend", "cpu", "--pictures", "0", "--out"]).arg(out);
    command
}

fn inspect(path: &Path) -> (Option<i32>, String, String) {
    let mut command = program();
    let mut child = command.arg("inspect").arg(path).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let code = wait(&mut child);
    let Output { stdout, stderr, .. } = child.wait_with_output().expect("it ended");
    (code, String::from_utf8_lossy(&stdout).into_owned(), String::from_utf8_lossy(&stderr).into_owned())
}

#[test]
fn what_is_no_plain_file_is_refused_and_never_waited_for() {
    let place = Place::new();
    place.observed();
    let mesh = place.write(
        "mesh.toml",
        &BLOCK.replace("shape = { box = { min = [0, 0, 0], max = [0.04, 0.04, 0.08] } }", "mesh = \"pipe.ply\""),
    );
    place.pipe("pipe.ply");
    place.pipe("folder/recording.toml");
    place.pipe("scene.toml");
    place.write("cloud/recording.toml", "format = \"recording/1\"\n[[cloud]]\nfile = \"pipe.ply\"\ntime = 0.0\n");
    place.pipe("cloud/pipe.ply");
    let image = fs::read_to_string(place.at("seen/recording.toml")).expect("a recording");
    let image = image.split('"').find(|t| t.ends_with(".png")).expect("an image").to_string();
    fs::remove_file(place.at("seen").join(&image)).expect("it is there");
    place.pipe(&format!("seen/{image}"));
    for path in [mesh, place.at("folder"), place.at("scene.toml"), place.at("cloud"), place.at("seen")] {
        let (code, _, err) = inspect(&path);
        assert_eq!(code, Some(2), "{err}");
        assert!(err.starts_with("error: ") && err.contains("is a named pipe; a plain file is needed"), "{err}");
    }
}

#[test]
fn a_folder_has_one_process() {
    let place = Place::new();
    let scene = place.observed();
    // It is stopped in the middle, so that it holds its folder for as long as the others ask.
    let mut first = fit(&scene, &place.at("out")).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
    let lock = place.at("out/palpate.lock");
    let begun = Instant::now();
    while !lock.exists() || fs::metadata(&lock).is_ok_and(|m| m.len() == 0) {
        assert!(begun.elapsed() < PATIENCE && first.try_wait().expect("it can be asked").is_none(), "no lock was taken");
        std::thread::sleep(Duration::from_millis(1));
    }
    let signal = |name: &str| {
        let sent = Command::new("kill").args([name, &first.id().to_string()]).status();
        assert!(sent.is_ok_and(|s| s.success()), "{name}");
    };
    signal("-STOP");
    for mut other in [fit(&scene, &place.at("out")), {
        let mut simulate = program();
        simulate.arg("simulate").arg(&scene).args(["--backend", "cpu", "--out"]).arg(place.at("out"));
        simulate
    }] {
        let (code, _, err) = run(&mut other);
        assert_eq!(code, Some(2), "{err}");
        let told = format!(": process {} on ", first.id());
        assert!(err.contains("error: --out ") && err.contains(&told) && err.contains("give another folder"), "{err}");
    }
    signal("-CONT");
    assert_eq!(wait(&mut first), Some(0));
    assert!(!lock.exists() && place.at("out/result.json").exists());
    // What it leaves keeps nobody out.
    let (code, _, err) = run(&mut fit(&scene, &place.at("out")));
    assert_eq!(code, Some(0), "{err}");
    assert!(place.at("out/previous-1/result.json").exists());
}

/// Rows of a marker file that takes seconds to read.
fn many_markers(place: &Place) {
    let mut rows = String::from("time,name,x,y,z\n");
    for k in 0..400_000 {
        rows += &format!("{},m{},0.02,0.02,0.08\n", 0.001 * f64::from(k), k % 7);
    }
    place.write("many/markers.csv", &rows);
    place.write("many/recording.toml", "format = \"recording/1\"\n[markers]\nfile = \"markers.csv\"\n");
}

#[test]
fn the_first_interrupt_counts_while_files_are_read() {
    let place = Place::new();
    many_markers(&place);
    let fit_of = FIT.replace("\"seen\"", "\"many\"").replace("sparse-surface", "markers");
    let scene = place.write("many.toml", &format!("{BLOCK}{fit_of}"));
    let mut child = fit(&scene, &place.at("out")).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts");
    // Long enough for the handler to be there, in the middle of the rows.
    std::thread::sleep(Duration::from_millis(60));
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|s| s.success()));
    let code = wait(&mut child);
    let Output { stderr, status, .. } = child.wait_with_output().expect("it ended");
    let err = String::from_utf8_lossy(&stderr).into_owned();
    // Before the handler is there the system ends it.
    use std::os::unix::process::ExitStatusExt as _;
    assert!(code == Some(130) || status.signal() == Some(2), "{code:?} {err}");
    assert!(code.is_none() || err.contains("interrupted: nothing was written"), "{err}");
    assert!(!place.at("out").exists());
}

#[test]
fn where_nothing_can_be_written_is_said_first() {
    let place = Place::new();
    let scene = place.write("block.toml", BLOCK);
    place.write("file", "text");
    for (out, told) in [("file", "is a file; give a folder"), ("file/below", "file is a file; give a folder")] {
        for verb in ["simulate", "track", "fit", "diagnose", "synthesize"] {
            let (code, _, err) = run(program().arg(verb).arg(&scene).arg("--out").arg(place.at(out)));
            assert_eq!((code, err.lines().count()), (Some(2), 1), "{verb}: {err}");
            assert!(err.starts_with("error: --out ") && err.contains(told), "{verb}: {err}");
        }
    }
    assert_eq!(fs::read_to_string(place.at("file")).expect("it is there"), "text");
}

#[test]
fn nothing_long_is_printed_in_full() {
    let place = Place::new();
    let scene = place.write("block.toml", BLOCK);
    let long = "a".repeat(100_000);
    for arguments in [vec!["inspect", &long], vec!["simulate", "x.toml", "--backend", &long]] {
        let (code, _, err) = run(program().args(arguments));
        assert!(code == Some(2) && err.len() < 6_000, "{} bytes", err.len());
    }
    let mut command = program();
    command.arg("observe").arg(scene).args(["--camera", CAMERA, "--noise", "1e300", "--out"]).arg(place.at("out"));
    let (code, _, err) = run(&mut command);
    assert_eq!((code, err.as_str()), (Some(2), "error: --noise 1e300: must be in [0, 1] (m)\n"));
}

#[test]
fn the_right_cause_is_named() {
    let place = Place::new();
    let scene = fs::read_to_string(place.observed()).expect("a scene");
    let said = |name: &str, change: &dyn Fn(&str) -> String| {
        let (code, out, err) = inspect(&place.write(name, &change(&scene)));
        (code, out + &err)
    };
    let wide = said("band.toml", &|s| s.replace("\"sparse-surface\"", "\"sparse-surface\"\nband = 1e300"));
    assert!(wide.0 == Some(2) && wide.1.contains("observation.band") && wide.1.contains("at most 100 (cells)"), "{}", wide.1);
    let out = said("out.toml", &|s| s.replace("\"sparse-surface\"", "\"sparse-surface\"\nfile = \"../other/recording.toml\""));
    assert!(
        out.0 == Some(2) && out.1.contains("observation.file: ") && out.1.contains("leaves the recording's folder"),
        "{}",
        out.1
    );
    let held = said("held.toml", &|s| s.replace("max = [0.05, 0.05, 0.001]", "max = [0.05, 0.05, 0.1]"));
    assert!(held.0 == Some(0) && held.1.contains("clamps hold the whole surface"), "{}", held.1);
    let fast = said("fast.toml", &|s| s.replace("velocity = [0.6", "velocity = [1e6"));
    assert!(
        fast.1.contains("initial.velocity: 1e6 m/s is unusual") || fast.1.contains("initial.velocity: 1000000 m/s"),
        "{}",
        fast.1
    );
    // Markers in millimetres.
    place.write("mm/markers.csv", "time,name,x,y,z\n0,a,20,20,80\n0.05,a,25,20,80\n");
    place.write(
        "mm/recording.toml",
        "format = \"recording/1\"\n[markers]\nfile = \"markers.csv\"\nnoise_sigma = 0.001\n[[markers.rest]]\nname = \"a\"\nposition = [0.02, 0.02, 0.08]\n",
    );
    let mm = said("mm.toml", &|s| s.replace("\"seen\"", "\"mm\"").replace("sparse-surface", "markers"));
    assert!(mm.0 == Some(2) && mm.1.contains("is the recording in millimetres?"), "{}", mm.1);
    // Cameras that are none, images without masks, and a giant image.
    let recording = fs::read_to_string(place.at("seen/recording.toml")).expect("a recording");
    let rewrite = |text: &str| fs::write(place.at("seen/recording.toml"), text).expect("writable");
    let line = |key: &str| recording.lines().find(|l| l.starts_with(key)).expect("it is stated").to_string();
    rewrite(&recording.replace(&line("fx"), "fx = 1e300"));
    let focal = said("fit.toml", &str::to_string);
    assert!(focal.1.contains("camera.0.fx: 1e300 pixels"), "{}", focal.1);
    let bare: Vec<&str> = recording.lines().filter(|l| !l.starts_with("mask")).collect();
    rewrite(&bare.join("\n"));
    let bare = said("fit.toml", &str::to_string);
    assert_eq!(bare.1.matches("no mask").count(), 1, "{}", bare.1);
    rewrite(&recording);
    let image = recording.split('"').find(|t| t.ends_with(".png")).expect("an image");
    // The header of a PNG file of 60,000 × 60,000 pixels of 16 bit, with its checksum, and nothing behind.
    let header = [
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".as_slice(),
        &60_000u32.to_be_bytes(),
        &60_000u32.to_be_bytes(),
        &[16, 0, 0, 0, 0],
        &crc(&[b"IHDR".as_slice(), &60_000u32.to_be_bytes(), &60_000u32.to_be_bytes(), &[16, 0, 0, 0, 0]].concat()).to_be_bytes(),
        b"\0\0\0\0IDAT\x35\xaf\x06\x1e",
    ];
    fs::write(place.at("seen").join(image), header.concat()).expect("writable");
    let giant = said("fit.toml", &str::to_string);
    assert!(giant.0 == Some(2) && giant.1.contains("is 60000 × 60000 pixels, its camera has 40 × 30"), "{}", giant.1);
}

/// The checksum of PNG files (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    let step = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    !bytes.iter().fold(u32::MAX, |c, b| (0..8).fold(c ^ u32::from(*b), |c, _| step(c)))
}

#[test]
fn thousands_of_threads_are_not_started() {
    let place = Place::new();
    let scene = place.observed();
    let begun = Instant::now();
    let (code, _, err) = run(fit(&scene, &place.at("out")).args(["--threads", "4096", "--starts", "1", "--no-grid-check"]));
    assert_eq!(code, Some(0), "{err}");
    assert!(err.contains("warning: 4096 threads are more than this machine has a use for"), "{err}");
    // 4096 threads waited for each other for a hundred seconds of processor time.
    assert!(begun.elapsed() < PATIENCE / 3, "{:?}", begun.elapsed());
}

#[test]
fn events_are_json_lines() {
    let place = Place::new();
    let scene = place.observed();
    let (code, _, err) = run(fit(&scene, &place.at("out")).args(["--log", "json", "--no-grid-check"]));
    assert_eq!(code, Some(0), "{err}");
    let events: Vec<Value> = err.lines().map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{e}: {l}"))).collect();
    let stages: Vec<&str> = events.iter().filter(|e| e["kind"] == "stage").filter_map(|e| e["message"].as_str()).collect();
    for stage in ["cut the body", "fit", "results and report"] {
        assert!(stages.contains(&stage), "{stage} is not in {stages:?}");
    }
    let (code, _, err) = run(program().args(["inspect", "none.toml", "--log", "json"]));
    let event: Value = serde_json::from_str(err.trim()).unwrap_or_else(|e| panic!("{e}: {err}"));
    assert_eq!((code, &event["kind"], &event["code"]), (Some(2), &"error".into(), &2.into()));
}

/// A result without what times say.
fn timeless(mut value: Value) -> Value {
    match &mut value {
        Value::Object(map) => {
            map.retain(|key, _| !key.contains("seconds"));
            map.values_mut().for_each(|v| *v = timeless(v.take()));
        }
        Value::Array(list) => list.iter_mut().for_each(|v| *v = timeless(v.take())),
        _ => {}
    }
    value
}

fn read(path: &Path) -> Value {
    timeless(serde_json::from_str(&fs::read_to_string(path).expect("it was written")).expect("it is JSON"))
}

/// Kills a command `kills` times, each time when `journal` has some more lines, and lets it end; returns how often it was killed before its end.
fn killed(command: &dyn Fn(bool) -> Command, journal: &Path, kills: usize) -> usize {
    let lines = || fs::read(journal).map_or(0, |b| b.iter().filter(|b| **b == b'\n').count());
    let mut done = 0;
    for k in 0..kills {
        let had = if k == 0 { 0 } else { lines() };
        let mut child = command(k > 0).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
        let begun = Instant::now();
        loop {
            if child.try_wait().expect("it can be asked").is_some() {
                return done;
            }
            // Line by line deeper into it, whatever of a line is written by then.
            if lines() > had + k % 3 {
                child.kill().expect("it runs");
                child.wait().expect("it was killed");
                done += 1;
                break;
            }
            assert!(begun.elapsed() < PATIENCE, "nothing is written to {}", journal.display());
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    let mut last = command(true).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it starts");
    assert_eq!(wait(&mut last), Some(0));
    done
}

fn fits_that_are_killed(kills: usize, least: usize) {
    let place = Place::new();
    let scene = place.observed();
    let of = |out: &str, resume: bool| {
        let mut command = fit(&scene, &place.at(out));
        if resume {
            command.arg("--resume");
        }
        command
    };
    assert_eq!(run(&mut of("whole", false)).0, Some(0));
    let done = killed(&|resume| of("cut", resume), &place.at("cut/journal.jsonl"), kills);
    assert!(done >= least, "only {done} kills before it ended");
    assert_eq!(read(&place.at("cut/result.json")), read(&place.at("whole/result.json")));
}

#[test]
fn a_fit_that_is_killed_three_times_comes_to_the_same_bits() {
    fits_that_are_killed(3, 2);
}

// Some minutes: every kill costs a start of the program.
#[ignore = "slow: cargo xtask test --full"]
#[test]
fn fits_and_diagnoses_that_are_killed_fifty_times_come_to_the_same_bits() {
    // A fit has some thirty lines in its journal: eight rounds of three kills, and the rest of the fifty on diagnoses.
    for _ in 0..8 {
        fits_that_are_killed(3, 2);
    }
    let place = Place::new();
    let scene = place.observed();
    // Pushed more slowly than it was: something is missing, and is looked for.
    let text = fs::read_to_string(&scene).expect("a scene");
    assert!(text.contains("velocity = [0.6"));
    fs::write(&scene, text.replace("velocity = [0.6", "velocity = [0.5")).expect("writable");
    let of = |out: &str, resume: bool| {
        let mut command = program();
        command.arg("diagnose").arg(&scene).args(["--backend", "cpu", "--pictures", "0", "--out"]).arg(place.at(out));
        if resume {
            command.arg("--resume");
        }
        command
    };
    assert_eq!(run(&mut of("whole", false)).0, Some(0));
    let mut done = 0;
    while done < 26 {
        drop(fs::remove_dir_all(place.at("cut")));
        let kills = killed(&|resume| of("cut", resume), &place.at("cut/journal.jsonl"), 6);
        assert!(kills > 0, "it ends before it is killed");
        done += kills;
        assert_eq!(read(&place.at("cut/diagnosis.json")), read(&place.at("whole/diagnosis.json")));
    }
}
