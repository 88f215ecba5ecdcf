//! A batch in several processes: parts, locks, what is merged, and what the recipes for clusters start.

use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository is there")
}

/// The three scenes of `assets/batch` with one change each, in a folder of their own.
fn scenes(folder: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let scenes = folder.join("scenes");
    fs::create_dir_all(&scenes).expect("writable");
    let recordings = root().join("assets/recordings").display().to_string();
    for name in ["firm.toml", "medium.toml", "soft.toml"] {
        let text = fs::read_to_string(root().join("assets/batch").join(name)).expect("the scene is there");
        let text = text.replace("../recordings", &recordings).replace("iterations = 8", "iterations = 3");
        fs::write(scenes.join(name), change(text)).expect("writable");
    }
    scenes
}

/// `palpate` without a scheduler around it.
fn palpate() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    for name in ["ID", "COUNT", "MIN", "MAX", "STEP"] {
        command.env_remove(format!("SLURM_ARRAY_TASK_{name}"));
    }
    command.env_remove("JOB_COMPLETION_INDEX").env_remove("PALPATE_ADAPTER");
    command
}

fn batch(scenes: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = palpate();
    command
        .arg("batch")
        .arg(scenes)
        .args(["--backend", "cpu", "--no-grid-check", "--pictures", "0", "--out"])
        .arg(out)
        .args(more);
    command
}

fn run(command: &mut Command) -> (i32, String, String) {
    let done = command.output().expect("the program starts");
    let text = |b: Vec<u8>| String::from_utf8(b).expect("the command line speaks UTF-8");
    (done.status.code().expect("no signal"), text(done.stdout), text(done.stderr))
}

fn merge(out: &Path) -> (i32, String, String) {
    run(palpate().args(["batch", "--merge"]).arg(out))
}

fn json(path: impl AsRef<Path>) -> Value {
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.as_ref().display()));
    serde_json::from_str(&text).expect("it is JSON")
}

/// Rows of a summary, but for how long they took.
fn rows(out: &Path) -> Vec<Value> {
    let mut rows = json(out.join("summary.json"))["scenes"].as_array().expect("a list").clone();
    rows.iter_mut().for_each(|r| r["seconds"] = Value::Null);
    rows
}

fn bytes(out: &Path) -> [Vec<u8>; 2] {
    ["summary.json", "summary.csv"].map(|f| fs::read(out.join(f)).expect("it was written"))
}

#[test]
fn shards_are_merged_to_what_one_process_finds_and_lost_ones_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = scenes(folder.path(), |t| t);
    let (one, out) = (folder.path().join("one"), folder.path().join("out"));
    assert_eq!(run(&mut batch(&scenes, &one, &[])).0, 0);

    let (code, told, err) = run(&mut batch(&scenes, &out, &["--shard", "1/3"]));
    assert_eq!(code, 0, "{err}");
    assert!(told.contains("1 of 1 scenes complete") && told.contains("1-of-3.csv"), "{told}");
    assert!(err.contains("shard 1/3: 1 of 3 scenes\n1/1 firm: complete in "), "{err}");
    assert_eq!(run(&mut batch(&scenes, &out, &["--shard", "3/3"])).0, 0);
    // Nothing of the second was seen yet.
    let (code, told, err) = merge(&out);
    assert_eq!(code, 1, "{err}");
    assert!(err.starts_with("warning: shard 2/3 has not begun: medium has no result\n"), "{err}");
    assert!(err.contains("run these shards again with --resume") && told.starts_with("2 of 3 scenes complete: "), "{told}{err}");
    let statuses: Vec<Value> = rows(&out).iter().map(|r| r["status"].clone()).collect();
    assert_eq!(statuses, ["complete", "lost", "complete"]);
    assert_eq!(json(out.join("summary.json"))["lost"], 1);

    // The environment of a task of Slurm, without a value of the option.
    let mut slurm = batch(&scenes, &out, &["--shard", "--resume"]);
    for (name, value) in [("ID", "4"), ("COUNT", "3"), ("MIN", "2"), ("MAX", "6"), ("STEP", "2")] {
        slurm.env(format!("SLURM_ARRAY_TASK_{name}"), value);
    }
    let (code, _, err) = run(&mut slurm);
    assert!(code == 0 && err.contains("shard 2/3: 1 of 3 scenes\n1/1 medium: complete in "), "{err}");
    let (code, told, err) = merge(&out);
    assert_eq!((code, err.as_str()), (0, ""), "{told}");
    assert_eq!(rows(&out), rows(&one));
    // However often, and whichever shard is asked again.
    let before = bytes(&out);
    let (code, _, err) = run(&mut batch(&scenes, &out, &["--shard", "2/3", "--resume", "--threads", "1"]));
    assert!(code == 0 && err.contains("1/1 medium: taken over\n"), "{err}");
    assert_eq!(merge(&out).0, 0);
    assert_eq!(bytes(&out), before);

    // In another number of shards it goes on where it was, but only when told so.
    fs::remove_file(out.join("soft/row.json")).expect("removable");
    let (code, _, err) = run(&mut batch(&scenes, &out, &["--shard", "1/2"]));
    assert!(code == 2 && err.contains("1-of-3.json is of 3 shards; with --resume"), "{err}");
    let (code, _, err) = run(&mut batch(&scenes, &out, &["--shard", "2/2", "--resume"]));
    assert!(code == 0 && err.contains("1/1 medium: taken over"), "{err}");
    let (code, _, err) = merge(&out);
    assert!(code == 1 && err.contains("shard 1/2 or 3/3 is not finished: soft has no result"), "{err}");
    assert_eq!(run(&mut batch(&scenes, &out, &["--shard", "1/2", "--resume"])).0, 0);
    assert_eq!(merge(&out).0, 0);

    // A scene more, and only one shard that knows of it.
    fs::copy(scenes.join("soft.toml"), scenes.join("hard.toml")).expect("writable");
    assert_eq!(run(&mut batch(&scenes, &out, &["--shard", "2/2", "--resume"])).0, 0);
    let (code, _, err) = merge(&out);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("2-of-2.json: is of other scenes than ") && err.contains("number 2 is \"hard\" here and"), "{err}");
}

#[test]
fn a_bad_scene_is_no_lost_one_and_shards_may_be_more_than_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = scenes(folder.path(), |t| t.replace("recordings/ball-firm", "recordings/nowhere"));
    let out = folder.path().join("out");
    for (shard, code) in [("1/5", 1), ("2/5", 0), ("3/5", 0), ("4/5", 0)] {
        let (found, told, err) = run(&mut batch(&scenes, &out, &["--shard", shard]));
        assert_eq!(found, code, "{shard}: {told}{err}");
        assert_eq!(told.starts_with("0 of 0 scenes"), shard == "4/5", "{told}");
    }
    // The fifth has nothing to do: whether it ran is nobody's loss.
    let (code, told, err) = merge(&out);
    assert!(code == 1 && told.starts_with("2 of 3 scenes complete: "), "{told}{err}");
    assert!(err.starts_with("firm: bad-input: ") && err.contains("nowhere") && err.lines().count() == 1, "{err}");
}

#[test]
fn wrong_shards_are_told_what_is_allowed() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = scenes(folder.path(), |t| t);
    let out = folder.path().join("out");
    for (shard, word) in [
        ("5/3", "there is no shard 5 of 3"),
        ("0/0", "must be K/N with K from 1 to N"),
        ("x", "must be K/N with K from 1 to N"),
        ("1/0", "must be K/N with K from 1 to N"),
        ("auto", "neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set"),
        ("auto/3", "outside of a Slurm array and an indexed Kubernetes job write --shard K/N"),
    ] {
        let (code, told, err) = run(&mut batch(&scenes, &out, &["--shard", shard]));
        assert_eq!((code, told.as_str(), err.lines().count()), (2, "", 1), "{shard}: {err}");
        assert!(err.contains(word) && err.contains("auto/N") == (shard != "auto" && shard != "auto/3"), "{shard}: {err}");
    }
    let (code, _, err) = run(batch(&scenes, &out, &["--shard", "auto"]).env("JOB_COMPLETION_INDEX", "1"));
    assert!(code == 2 && err.contains("--shard auto/N with N the job's completions"), "{err}");
    assert!(!out.exists(), "nothing was begun");
    let (code, _, err) = merge(folder.path());
    assert!(code == 2 && err.contains("holds no summary of a shard (shards/K-of-N.json)"), "{err}");
    let (code, _, err) = run(palpate().arg("batch"));
    assert!(code == 2 && err.contains("<PATH>"), "{err}");
}

/// A process that is ended with its owner.
struct Running(Child);

impl Running {
    fn start(command: &mut Command, log: &Path) -> Running {
        let log = fs::File::create(log).expect("writable");
        Running(command.stdout(Stdio::null()).stderr(log).spawn().expect("the program starts"))
    }

    fn code(&mut self) -> Option<i32> {
        self.0.wait().expect("it ends").code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It has usually ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn wait_for(path: &Path) {
    let begun = Instant::now();
    while fs::metadata(path).map_or(0, |m| m.len()) == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "{} does not come", path.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn two_processes_with_the_same_scenes_share_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = scenes(folder.path(), |t| t);
    let path = |name: &str| folder.path().join(name);
    let out = path("out");
    // Under two names, so that each writes a summary of its own; and nobody said --resume.
    let mut first = Running::start(&mut batch(&scenes, &out, &[]), &path("first"));
    let mut second = Running::start(&mut batch(&scenes, &out, &["--shard", "1/1"]), &path("second"));
    let codes = [first.code(), second.code()];
    let log = ["first", "second"].map(|n| fs::read_to_string(path(n)).expect("a log"));
    // Who finds the last scene in work leaves it, and says so.
    assert!(codes.iter().all(|c| matches!(c, Some(0 | 1))) && codes.contains(&Some(0)), "{codes:?} {log:?}");
    for (code, log) in codes.iter().zip(&log) {
        assert_eq!(*code == Some(1), log.contains(": busy in ") && log.contains(" fits it"), "{log}");
    }
    for name in ["firm", "medium", "soft"] {
        assert_eq!(log.concat().matches(&format!("{name}: complete in ")).count(), 1, "{name}: {log:?}");
        assert!(!out.join(name).join("previous-1").exists(), "{name} was fitted twice");
        assert!(out.join(name).join("row.json").exists() && !out.join(name).join("palpate.lock").exists(), "{name}");
    }
    assert_eq!(merge(&out).0, 0);
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_process_held_is_taken_at_once_and_what_another_holds_is_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = scenes(folder.path(), |t| t);
    let out = folder.path().join("out");
    let lock = out.join("medium/palpate.lock");
    // What an earlier batch left in the folder is no result of this one.
    assert_eq!(run(&mut batch(&scenes, &out, &["--shard", "2/3"])).0, 0);
    {
        let mut shard = Running::start(&mut batch(&scenes, &out, &["--shard", "2/3"]), &folder.path().join("log"));
        wait_for(&lock);
        shard.0.kill().expect("it runs");
        assert_eq!(shard.code(), None);
    }
    assert!(lock.exists(), "it ended before it was killed");
    for shard in ["1/3", "3/3"] {
        assert_eq!(run(&mut batch(&scenes, &out, &["--shard", shard])).0, 0);
    }
    let (code, _, err) = merge(&out);
    assert!(code == 1 && err.starts_with("warning: shard 2/3 is not finished: medium has no result\n"), "{err}");
    let begun = Instant::now();
    let (code, _, err) = run(&mut batch(&scenes, &out, &["--shard", "2/3", "--resume"]));
    assert!(code == 0 && err.contains("1/1 medium: complete in "), "{err}");
    assert!(begun.elapsed() < Duration::from_secs(20), "it waited");
    assert!(!lock.exists());
    assert_eq!(merge(&out).0, 0);

    // On another machine a process lives: its heart beats while it is watched.
    fs::remove_file(out.join("medium/row.json")).expect("removable");
    let beat = |count: u64, patience: f64| {
        let text = format!(
            "{{\"format\": \"lock/1\", \"beat\": \"{count:010}\", \"host\": \"elsewhere\", \"process\": 7, \"since\": \
             \"2026-01-31T12:00:00Z\", \"patience\": {patience}, \"namespace\": \"\", \"token\": \"t\"}}"
        );
        fs::write(&lock, text).expect("writable");
    };
    beat(0, 60.0);
    let log = folder.path().join("log");
    let mut shard = Running::start(&mut batch(&scenes, &out, &["--shard", "2/3", "--resume"]), &log);
    let text = || fs::read_to_string(&log).unwrap_or_default();
    while !text().contains("1/1 medium: waiting for a sign of life of process 7 on elsewhere") {
        assert!(shard.0.try_wait().expect("it can be asked").is_none(), "{}", text());
        std::thread::sleep(Duration::from_millis(10));
    }
    beat(1, 60.0);
    assert_eq!(shard.code(), Some(1));
    assert!(
        text().contains("medium: busy in ") && text().contains("process 7 on elsewhere (since 2026-01-31T12:00:00Z) fits it")
    );
    let (code, _, err) = merge(&out);
    assert!(code == 1 && err.contains("medium has no result; process 7 on elsewhere (since"), "{err}");
    // There it dies. Nothing changes for as long as its lock says.
    beat(2, 0.5);
    let (code, _, err) = run(&mut batch(&scenes, &out, &["--shard", "2/3", "--resume"]));
    assert!(code == 0 && err.contains("1/1 medium: left to process 7") && err.contains("1/1 medium: complete in "), "{err}");
    assert_eq!(merge(&out).0, 0);
}

/// What the container of `assets/cluster/batch-job.yaml` would run, by its own words and variables.
#[test]
fn the_job_of_kubernetes_fits_all_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    scenes(folder.path(), |t| t);
    let job = fs::read_to_string(root().join("assets/cluster/batch-job.yaml")).expect("the recipe is there");
    let value = |key: &str| {
        let line = job.lines().find_map(|l| l.trim().strip_prefix(key)).unwrap_or_else(|| panic!("{key} is not in the recipe"));
        line.trim().to_string()
    };
    let pods: usize = value("completions:").parse().expect("a number");
    let command = value("command:");
    let words: Vec<String> =
        command.trim_matches(['[', ']']).split(", ").map(|w| w.replace("/work", &folder.path().display().to_string())).collect();
    assert_eq!((value("completionMode:").as_str(), words[0].as_str()), ("Indexed", "palpate"));
    assert!(words.contains(&format!("auto/{pods}")), "{words:?}");
    let found = folder.path().join("found");
    for index in 0..pods {
        let mut pod = palpate();
        // An index says less than a scheduler's array, and wins nothing over it: none is set here.
        let (code, _, err) = run(pod.args(&words[1..]).args(["--no-grid-check"]).env("JOB_COMPLETION_INDEX", index.to_string()));
        assert!(code == 0 && err.contains(&format!("shard {}/{pods}: ", index + 1)), "{err}");
    }
    assert_eq!(merge(&found).0, 0);
    let counted: BTreeMap<String, usize> =
        rows(&found).iter().map(|r| (r["name"].as_str().unwrap_or_default().to_string(), 1)).collect();
    assert_eq!(counted.keys().collect::<Vec<_>>(), ["firm", "medium", "soft"]);
}
