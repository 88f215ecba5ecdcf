//! What can be wrong with files, in one line each.

use std::fmt;
use std::path::{Path, PathBuf};

/// Something is wrong with an input file. Displays as one line: `file:line: key: what is wrong and what is allowed`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputError {
    /// The file, as it was named.
    pub file: PathBuf,
    /// Line in the file, counted from 1, where there is one.
    pub line: Option<usize>,
    /// Dotted path of the key in the file; empty when the whole file is meant.
    pub key: String,
    /// What is wrong and what is allowed.
    pub message: String,
}

impl InputError {
    /// An error about a whole file.
    pub fn file(file: impl AsRef<Path>, message: impl Into<String>) -> InputError {
        InputError { file: file.as_ref().to_path_buf(), line: None, key: String::new(), message: message.into() }
    }

    /// An error about one line (from 1) of a file without keys.
    pub fn line(file: impl AsRef<Path>, line: usize, message: impl Into<String>) -> InputError {
        InputError { line: Some(line), ..InputError::file(file, message) }
    }

    /// An error of the operating system.
    pub(crate) fn io(file: impl AsRef<Path>, cause: &std::io::Error) -> InputError {
        let what = match cause.kind() {
            std::io::ErrorKind::NotFound => "no such file".to_string(),
            std::io::ErrorKind::PermissionDenied => "may not be read (permission denied)".to_string(),
            std::io::ErrorKind::InvalidData => "is not UTF-8 text".to_string(),
            _ => format!("cannot be read: {cause}"),
        };
        InputError::file(file, what)
    }
}

/// A number as people write it: with an exponent where it would be all zeros.
pub(crate) fn number(x: f64) -> String {
    if x == 0.0 || !x.is_finite() || (1e-6..1e9).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

/// Longest text that an error repeats in full.
const LONGEST: usize = 400;

/// A text as an error repeats it: a number without hundreds of zeros, the middle of anything very long left out.
pub fn shown(text: &str) -> String {
    if text.len() > 24
        && let Ok(x) = text.parse::<f64>()
    {
        return format!("{x:e}");
    }
    let count = text.chars().count();
    if count <= LONGEST {
        return text.to_string();
    }
    let (head, tail) = (text.chars().take(LONGEST / 2), text.chars().skip(count - LONGEST / 4));
    format!("{}…{}", head.collect::<String>(), tail.collect::<String>())
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", shown(&self.file.to_string_lossy()))?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        if !self.key.is_empty() {
            write!(f, ": {}", self.key)?;
        }
        // Messages of parsers may span lines; ours must not.
        write!(f, ": {}", self.message.split_whitespace().collect::<Vec<_>>().join(" "))
    }
}

impl std::error::Error for InputError {}

/// A file could not be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {cause}", shown(&file.to_string_lossy()))]
pub struct OutputError {
    /// The file.
    pub file: PathBuf,
    /// Why; mostly an error of the operating system.
    #[source]
    pub cause: Box<dyn std::error::Error + Send + Sync>,
}

impl OutputError {
    /// A file and why it could not be written.
    pub fn new(file: impl AsRef<Path>, cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> OutputError {
        OutputError { file: file.as_ref().to_path_buf(), cause: cause.into() }
    }
}

/// Something read from a file, and what looked suspicious without being wrong.
#[derive(Clone, Debug)]
pub struct Loaded<T> {
    /// What was read.
    pub value: T,
    /// One line each.
    pub warnings: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_long_is_repeated_in_full() {
        assert_eq!(shown(&format!("1{}", "0".repeat(300))), "1e300");
        assert_eq!(shown("0.25"), "0.25");
        let long = format!("a{}é", "x".repeat(100_000));
        let e = InputError::file(&long, "no such file").to_string();
        assert!(e.len() < 500 && e.starts_with("axx") && e.ends_with("é: no such file") && e.contains('…'), "{e}");
    }
}
