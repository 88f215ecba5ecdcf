//! `cargo xtask tidy`: what the house promises and the compiler does not check.

use crate::bench::{counts, page};
use crate::coverage;
use crate::figures;
use crate::fuzz;
use crate::mutants;
use crate::pages;
use crate::paper;
use crate::real::report::Report;
use crate::real::{diagnoses, models};
use crate::suite::report as suite;
use crate::suite::rules;
use crate::suite::settle;
use crate::table::{self, mark};
use crate::verify::report::Report as Verification;
use std::fs;
use std::path::{Path, PathBuf};

/// Longest source file, in lines: what one reads in a few minutes.
const LONGEST: usize = 450;
/// Largest asset, in bytes.
const LARGEST: u64 = 300_000;

/// Which rooms a room may import (`palpate-` left out); nobody but tests and xtask imports `palpate`.
const ARROWS: [(&str, &[&str]); 10] = [
    ("palpate-model", &[]),
    ("palpate-io", &["model"]),
    ("palpate-import", &["model", "io"]),
    ("palpate-export", &["model"]),
    ("palpate-engine", &["model"]),
    ("palpate-cpu", &["model", "engine"]),
    ("palpate-gpu", &["model", "engine"]),
    ("palpate-fit", &["model", "engine"]),
    ("palpate-diagnose", &["model", "engine"]),
    ("palpate", &["model", "io", "import", "export", "engine", "cpu", "gpu", "fit", "diagnose"]),
];

/// Checks the workspace at `root`; one line per finding.
pub fn check(root: &Path) -> Vec<String> {
    let mut found = Vec::new();
    rooms(root, &mut found);
    tables(root, &mut found);
    measured(root, &mut found);
    generated(root, &mut found);
    verified(root, &mut found);
    effects(root, &mut found);
    pages::check(root, &mut found);
    figures::check(root, &mut found);
    for file in files(root) {
        let name = file.strip_prefix(root).unwrap_or(&file).display().to_string();
        let size = fs::metadata(&file).map_or(0, |m| m.len());
        if name.starts_with("assets/") && size > LARGEST {
            found.push(format!("{name}: {size} bytes; assets may have {LARGEST}"));
        }
        // Libraries of others are as they come.
        let own = !name.contains("/vendor/");
        if own && matches!(file.extension().and_then(|e| e.to_str()), Some("rs" | "wgsl" | "js" | "css")) {
            let text = fs::read_to_string(&file).unwrap_or_default();
            source(&name, &text, &mut found);
        }
    }
    found
}

/// Folders under `crates/` against the arrows and the room lists of README and ARCHITECTURE.
fn rooms(root: &Path, found: &mut Vec<String>) {
    let mut names: Vec<String> = fs::read_dir(root.join("crates"))
        .into_iter()
        .flatten()
        .filter_map(|e| Some(e.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    names.sort();
    for name in &names {
        let Some((_, allowed)) = ARROWS.iter().find(|a| a.0 == name) else {
            found.push(format!("crates/{name}: no arrow in xtask/src/tidy.rs says what it may import"));
            continue;
        };
        let manifest = fs::read_to_string(root.join("crates").join(name).join("Cargo.toml")).unwrap_or_default();
        // Tests may import anything: another backend is an oracle.
        let built = manifest.lines().take_while(|l| *l != "[dev-dependencies]");
        for line in built.filter_map(|l| l.strip_prefix("palpate")) {
            let other = line.split(['.', ' ', '=']).next().unwrap_or("").trim_start_matches('-');
            if !allowed.contains(&other) {
                found.push(format!("crates/{name}/Cargo.toml: may not import palpate-{other}"));
            }
        }
    }
    for page in ["README.md", "ARCHITECTURE.md"] {
        let text = fs::read_to_string(root.join(page)).unwrap_or_default();
        for name in names.iter().filter(|n| !text.contains(n.as_str())) {
            found.push(format!("{page}: does not name the room {name}"));
        }
    }
}

/// Tables that README shares with a page under `docs/`: the text between two lines `<!-- NAME table -->` is the same in both.
fn tables(root: &Path, found: &mut Vec<String>) {
    const SHARED: [(&str, &str); 1] = [("docs/real-data.md", "<!-- real-data table -->")];
    for (page, mark) in SHARED {
        let table = |page: &str| {
            let text = fs::read_to_string(root.join(page)).unwrap_or_default();
            let parts: Vec<&str> = text.split(mark).collect();
            (parts.len() == 3).then(|| parts[1].to_string())
        };
        if table(page).is_none() || table(page) != table("README.md") {
            found.push(format!("README.md: the table between two lines {mark} is not that of {page}"));
        }
    }
}

/// Tables of real recordings are what `bench/real.json` holds.
fn measured(root: &Path, found: &mut Vec<String>) {
    let text = fs::read_to_string(root.join("docs/real-data.md")).unwrap_or_default();
    let report = match Report::load(root) {
        Ok(report) => report,
        Err(e) => return found.push(e),
    };
    for (name, table) in [("models", models::markdown(&report.models)), ("diagnoses", diagnoses::markdown(&report.diagnoses))] {
        if text.split(&mark(name)).nth(1) != Some(&table) {
            found.push(format!("docs/real-data.md: the table of {name} is not that of bench/real.json"));
        }
    }
}

/// Tables of pages that are generated from what `bench/` holds.
fn generated(root: &Path, found: &mut Vec<String>) {
    let suite = suite::stored(root).map(|lines| suite::markdown(&lines));
    let coverage = coverage::report::stored(root).map(|lines| coverage::report::markdown(&lines));
    let counts = counts::stored(root).map(|rows| counts::markdown(&rows));
    let mut check = |page: &str, name: &str, table: Result<String, String>, verb: &str| {
        let text = fs::read_to_string(root.join(page)).unwrap_or_default();
        match table {
            Ok(table) if text.split(&mark(name)).nth(1) == Some(&table) => {}
            Ok(_) => found.push(format!("{page}: the table of {name} is not what bench/ holds; cargo xtask {verb}")),
            Err(e) => found.push(e),
        }
    };
    for (number, name) in ["mutants", "alive"].into_iter().enumerate() {
        let table = mutants::stored(root).map(|r| mutants::markdown(&r)[number].clone());
        check("docs/mutants.md", name, table, "mutants --report");
    }
    check("docs/fuzzing.md", "fuzz", fuzz::markdown(root), "fuzz --report");
    check("docs/suite.md", "suite", suite, "suite --report");
    check(
        "docs/suite.md",
        "rules",
        table::stored(root, "rules").map(|l: Vec<rules::Line>| rules::markdown(&l)),
        "suite --report",
    );
    let settle = table::stored(root, "settle").map(|l: Vec<settle::Line>| settle::markdown(&l));
    check("docs/suite.md", "settle", settle, "suite --report");
    check("docs/coverage.md", "coverage", coverage, "coverage --report");
    check("docs/gpu.md", "counts", counts, "bench --gpu --counts --only torus");
    check("docs/speed.md", "speed", page::shown(root), "bench, and its name in xtask/src/bench/page.rs");
    for set in paper::SETS {
        let verb = format!("paper --only {} --report", set.name);
        match set.stored(root) {
            Ok(rows) => set.tables(&rows).into_iter().for_each(|(name, table)| check(set.page, name, Ok(table), &verb)),
            Err(e) => check(set.page, set.name, Err(e), &verb),
        }
    }
}

/// The page of verification is what `bench/verify.json` holds, and says of nothing that it fails.
fn verified(root: &Path, found: &mut Vec<String>) {
    let text = fs::read_to_string(root.join("docs/verification.md")).unwrap_or_default();
    match Verification::load(root) {
        Ok(report) if text == report.page() => {
            found.extend(report.failures().iter().map(|r| format!("docs/verification.md: \"{}\" fails", r.what)));
        }
        Ok(_) => found.push("docs/verification.md: is not what bench/verify.json says".into()),
        Err(e) => found.push(e),
    }
}

/// README says how many effects there are.
fn effects(root: &Path, found: &mut Vec<String>) {
    let text = fs::read_to_string(root.join("README.md")).unwrap_or_default();
    let stated = format!("{} [effects](docs/effects.md)", palpate_model::effects::ALL.len());
    if !text.contains(&stated) {
        found.push(format!("README.md: does not say \"{stated}\""));
    }
}

/// Rules for one source file.
fn source(name: &str, text: &str, found: &mut Vec<String>) {
    let lines = text.lines().count();
    if lines > LONGEST {
        found.push(format!("{name}: {lines} lines; split it by ideas (at most {LONGEST})"));
    }
    if !text.starts_with("//!") && name.ends_with(".rs") {
        found.push(format!("{name}: begins without a //! that says what it is for"));
    }
    let lines: Vec<&str> = text.lines().collect();
    for (i, line) in lines.iter().enumerate() {
        let ignored = line.trim_start().starts_with("#[ignore");
        if ignored && !(i > 0 && lines[i - 1].trim_start().starts_with("//")) {
            found.push(format!("{name}:{}: an ignored test needs its reason in the line above", i + 1));
        }
        let unfinished = ["todo!(", "unimplemented!("].iter().any(|w| line.contains(w));
        if unfinished && !name.ends_with("tidy.rs") {
            found.push(format!("{name}:{}: unfinished", i + 1));
        }
    }
}

/// All files of the workspace but builds, outputs and git's own, sorted.
fn files(root: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let mut waiting = vec![root.to_path_buf()];
    while let Some(folder) = waiting.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if path.is_dir() {
                if !(name.starts_with("target") || name == ".git" || name == "out") {
                    waiting.push(path);
                }
            } else {
                all.push(path);
            }
        }
    }
    all.sort();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let room = folder.path().join("crates/palpate-fit");
        fs::create_dir_all(room.join("src")).unwrap();
        fs::write(room.join("Cargo.toml"), "[dependencies]\npalpate-model.workspace = true\npalpate-cpu.workspace = true\n")
            .unwrap();
        fs::write(room.join("src/lib.rs"), format!("fn f() {{}}\n#[ignore]\n{}", "\n".repeat(LONGEST))).unwrap();
        fs::create_dir_all(folder.path().join("assets")).unwrap();
        fs::write(folder.path().join("assets/big.bin"), vec![0; LARGEST as usize + 1]).unwrap();
        // Both pages have the table, with one figure changed in one of them.
        fs::create_dir_all(folder.path().join("docs")).unwrap();
        let table = |figure: u8| format!("<!-- real-data table -->\n| {figure} |\n<!-- real-data table -->\n");
        fs::write(folder.path().join("docs/real-data.md"), table(1)).unwrap();
        fs::write(folder.path().join("README.md"), table(1)).unwrap();
        assert!(!check(folder.path()).join("\n").contains("is not that of docs/real-data.md"));
        // Of materials and schemes nothing was measured, and the page says so until it does not.
        let none = format!("{m}{}{m}", diagnoses::markdown(&[]), m = mark("diagnoses"));
        let models = |rows: &str| format!("{}{m}{}{rows}{m}{none}", table(1), models::markdown(&[]), m = mark("models"));
        fs::write(folder.path().join("docs/real-data.md"), models("")).unwrap();
        assert!(!check(folder.path()).join("\n").contains("is not that of bench/real.json"));
        fs::write(folder.path().join("docs/real-data.md"), models("| one row |\n")).unwrap();
        fs::write(folder.path().join("README.md"), table(2)).unwrap();
        let found = check(folder.path()).join("\n");
        for part in [
            "may not import palpate-cpu",
            "lines; split",
            "begins without",
            "needs its reason",
            "assets may have",
            "README.md",
            "is not that of docs/real-data.md",
            "is not that of bench/real.json",
            "[effects](docs/effects.md)",
        ] {
            assert!(found.contains(part), "{part} in\n{found}");
        }
        assert!(!found.contains("may not import palpate-model"));
    }
}
