//! The engine waits in one place, and has no clock and no files: else a page in a browser could not use it. The source is looked through.

use std::fs;
use std::path::{Path, PathBuf};

/// The one file that may wait.
const WAITS: &str = "device/wait.rs";

/// What waits, and what asks the system for time or files; the first kind is allowed where this crate waits.
const WAITING: [&str; 9] =
    [".poll(", "PollType", "block_on", "thread::park", "thread::sleep", "std::time", ".recv(", "Condvar", "wait_indefinitely"];
const ASKING: [&str; 9] =
    ["Instant::now", "SystemTime", "std::fs", "fs::", "File::", "std::net", "std::process", "thread::spawn", "thread::scope"];

/// What of this a file holds that it may not, with the number of the line.
fn forbidden(file: &str, text: &str) -> Vec<String> {
    let code = |line: &str| line.split("//").next().unwrap_or_default().to_string();
    let waiting = if file == WAITS { &[][..] } else { &WAITING };
    let found = |line: &str| waiting.iter().chain(&ASKING).find(|word| line.contains(**word)).copied();
    let named = |(n, line)| Some(format!("{file}:{}: {}", n + 1, found(&code(line))?));
    text.lines().enumerate().filter_map(named).collect()
}

/// Source files below a folder, but for those of tests.
fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.unwrap_or_else(|e| panic!("{e}")).path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && name != "tests" {
            sources(&path, all);
        } else if name.ends_with(".rs") && !name.ends_with("tests.rs") {
            all.push(path);
        }
    }
}

#[test]
fn only_one_file_waits_and_none_has_a_clock_or_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut all = Vec::new();
    sources(&root, &mut all);
    assert!(all.len() > 50 && all.contains(&root.join(WAITS)), "{}", all.len());
    let text = |path: &Path| fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let name = |path: &Path| path.strip_prefix(&root).unwrap_or(path).to_string_lossy().replace('\\', "/");
    let found: Vec<String> = all.iter().flat_map(|path| forbidden(&name(path), &text(path))).collect();
    assert!(found.is_empty(), "what waits belongs into src/{WAITS}, clock and files to the `Host`:\n{}", found.join("\n"));
    // The file that waits would be found anywhere else.
    assert!(!forbidden("device/other.rs", &text(&root.join(WAITS))).is_empty());
}

#[test]
fn every_way_to_wait_or_to_ask_the_system_is_found() {
    for line in [
        "let _ = self.device.poll(wgpu::PollType::Poll);",
        "pollster::block_on(guard.pop())",
        "let clock = std::time::Instant::now();",
        "use std::time::Instant;",
        "std::fs::read_to_string(path)",
        "let text = fs::read(path)?;",
        "let answer = receiver.recv()?;",
        "thread::sleep(pause);",
        "let now = SystemTime::now();",
    ] {
        assert_eq!(forbidden("world/mod.rs", line).len(), 1, "{line}");
    }
    assert!(forbidden(WAITS, "self.device.poll(wgpu::PollType::Poll)").is_empty());
    assert_eq!(forbidden(WAITS, "let begun = Instant::now();").len(), 1, "waiting needs no clock");
    assert!(forbidden("world/mod.rs", "// It would wait for std::fs here.").is_empty());
}
