//! Builds the tests with cargo and says where their binaries are.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Packages whose unit tests also run with debug assertions and overflow checks: those that compute.
const CHECKED: [&str; 6] = ["palpate-model", "palpate-io", "palpate-engine", "palpate-fit", "palpate-diagnose", "palpate-cpu"];

/// A binary with tests.
#[derive(Clone, Debug, PartialEq)]
pub struct Binary {
    /// For people: package and target.
    pub label: String,
    /// The binary.
    pub path: PathBuf,
    /// Folder of its package, in which it runs.
    pub folder: PathBuf,
    /// True where every test is worth a process of its own: there are many, long ones.
    pub splits: bool,
}

/// All tests of these packages, or of the workspace, as they are released.
///
/// # Errors
/// They do not compile.
pub fn plain(root: &Path, packages: &[String]) -> Result<Vec<Binary>, String> {
    let mut arguments: Vec<String> = Vec::new();
    match packages {
        [] => arguments.push("--workspace".into()),
        _ => packages.iter().for_each(|p| arguments.extend(["--package".into(), p.clone()])),
    }
    build(root, &arguments, "")
}

/// Unit tests with debug assertions and overflow checks in the workspace's own code. What it depends on is compiled as it was: the
/// checks are options of single packages, so that nothing else is built twice.
///
/// # Errors
/// They do not compile.
pub fn checked(root: &Path, packages: &[String]) -> Result<Vec<Binary>, String> {
    let mut arguments: Vec<String> = vec!["--lib".into()];
    for package in CHECKED.iter().filter(|c| packages.is_empty() || packages.iter().any(|p| p == *c)) {
        arguments.extend(["--package".into(), package.to_string()]);
    }
    if arguments.len() == 1 {
        return Ok(Vec::new());
    }
    // With it, what all depend on has the features that it has in a build of the workspace, and is there already.
    arguments.extend(["--package".into(), "palpate-tests".into()]);
    for package in CHECKED {
        for check in ["debug-assertions", "overflow-checks"] {
            arguments.extend(["--config".into(), format!("profile.release.package.{package}.{check}=true")]);
        }
    }
    build(root, &arguments, ", checked")
}

fn build(root: &Path, arguments: &[String], note: &str) -> Result<Vec<Binary>, String> {
    let mut cargo = Command::new(cargo());
    cargo.current_dir(root).args(["test", "--release", "--no-run", "--message-format=json-render-diagnostics"]);
    let done = cargo.args(arguments).stderr(Stdio::inherit()).output().map_err(|e| format!("cargo cannot be started: {e}"))?;
    if !done.status.success() {
        return Err("the tests do not compile".into());
    }
    let text = String::from_utf8_lossy(&done.stdout);
    Ok(text.lines().filter_map(|line| binary(&serde_json::from_str(line).ok()?, note)).collect())
}

/// The cargo that runs us.
pub fn cargo() -> std::ffi::OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// The binary that a message of cargo tells of, if it does.
fn binary(message: &Value, note: &str) -> Option<Binary> {
    if message["reason"] != "compiler-artifact" || message["profile"]["test"] != true {
        return None;
    }
    let folder = Path::new(message["manifest_path"].as_str()?).parent()?.to_path_buf();
    let package = folder.file_name()?.to_string_lossy().into_owned();
    let (target, kind) = (message["target"]["name"].as_str()?, message["target"]["kind"][0].as_str()?);
    let label = if kind == "test" { format!("{package}, {target}{note}") } else { format!("{package}, {kind}{note}") };
    Some(Binary { label, path: message["executable"].as_str()?.into(), folder, splits: kind == "test" && target == "ladder" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn test_binaries_are_told_from_libraries() {
        let message = |test: bool, kind: &str, name: &str| {
            json!({
                "reason": "compiler-artifact", "manifest_path": "/house/tests/Cargo.toml", "profile": { "test": test },
                "target": { "name": name, "kind": [kind] }, "executable": test.then_some("/house/target/release/deps/x"),
            })
        };
        assert_eq!(binary(&message(false, "lib", "support"), ""), None);
        assert_eq!(binary(&json!({ "reason": "build-finished" }), ""), None);
        let ladder = binary(&message(true, "test", "ladder"), "").unwrap();
        assert_eq!((ladder.label.as_str(), ladder.splits), ("tests, ladder", true));
        let unit = binary(&message(true, "lib", "support"), ", checked").unwrap();
        assert_eq!((unit.label.as_str(), unit.splits), ("tests, lib, checked", false));
    }
}
