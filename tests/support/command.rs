//! `palpate` run inside the test: arguments in, exit code, text and files out.

use palpate::{Interrupt, Liveliness};
use std::path::Path;

/// Exit code, stdout and stderr of one command line.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Exit code.
    pub code: i32,
    /// What went to stdout.
    pub out: String,
    /// What went to stderr.
    pub err: String,
}

/// Runs `palpate` with these arguments.
pub fn palpate(arguments: &[&str]) -> Answer {
    stopped(arguments, Interrupt::default())
}

/// Runs `palpate` until `interrupt`.
pub fn stopped(arguments: &[&str], interrupt: Interrupt) -> Answer {
    let (mut out, mut err) = (Vec::new(), Vec::new());
    let all = std::iter::once("palpate").chain(arguments.iter().copied());
    let code = palpate::cli::run(all, &mut out, &mut err, interrupt, Liveliness::Silent);
    let text = |b: Vec<u8>| String::from_utf8(b).expect("the command line speaks UTF-8");
    Answer { code, out: text(out), err: text(err) }
}

/// A command that must succeed.
pub fn succeed(arguments: &[&str]) -> Answer {
    let a = palpate(arguments);
    assert_eq!(a.code, 0, "{arguments:?}\n{}", a.err);
    a
}

/// A JSON file.
pub fn json(path: impl AsRef<Path>) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A path as an argument.
pub fn arg(path: &Path) -> &str {
    path.to_str().expect("temporary folders have UTF-8 names")
}
