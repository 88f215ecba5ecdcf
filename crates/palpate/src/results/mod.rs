//! What commands write and print as JSON: one file a format, each a struct with a version.
//!
//! Numbers are in SI units. One that is infinite or undefined is `None`, and `null` in the file. A document begins with its format,
//! `{"format": "fit/2", …}`: the number behind the slash grows when a key changes its meaning or goes. Keys that are new may come at any
//! time, and those that a reader does not know are passed over.
//!
//! A quantity that is a field of thousands of values does not belong here: it lies in an array file beside the document, which names it.

pub mod batch;
pub mod checkpoint;
pub mod coarsening;
pub mod devices;
pub mod diagnosis;
pub mod effects;
pub mod export;
pub mod fit;
pub mod found;
pub mod frames;
pub mod import;
pub mod inspection;
pub mod lock;
pub mod observation;
pub mod pictures;
pub mod placement;
pub mod report;
pub mod simulation;
pub mod synthesis;
pub mod tracking;

use crate::error::Error;
use palpate_io::output::write_file;
use palpate_io::{InputError, read_text};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A kind of document in its present version.
pub trait Document: Serialize + DeserializeOwned {
    /// Name and version, `fit/2`.
    const FORMAT: &'static str;
}

/// A document behind its format.
#[derive(Serialize)]
struct Tagged<'a, T> {
    format: &'static str,
    #[serde(flatten)]
    content: &'a T,
}

/// The beginning of any document.
#[derive(Deserialize)]
struct Head {
    format: Option<String>,
}

/// A number for JSON: `None` where it is infinite or undefined.
pub fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn tagged<T: Document>(content: &T) -> Tagged<'_, T> {
    Tagged { format: T::FORMAT, content }
}

/// A document on one line, for programs that listen.
pub fn line<T: Document>(document: &T) -> String {
    serde_json::to_string(&tagged(document)).expect("numbers, texts and lists can be written as JSON")
}

/// A document on several lines, for files.
pub fn text<T: Document>(document: &T) -> String {
    serde_json::to_string_pretty(&tagged(document)).expect("numbers, texts and lists can be written as JSON") + "\n"
}

/// Writes a document to a file, whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write<T: Document>(path: impl AsRef<Path>, document: &T) -> Result<(), Error> {
    Ok(write_file(path, |w| w.write_all(text(document).as_bytes()))?)
}

/// Reads a document from a file.
///
/// # Errors
/// The file cannot be read, is of another kind or version, or lacks something: the error names the file and what is understood.
pub fn read<T: Document>(path: impl AsRef<Path>) -> Result<T, InputError> {
    parse(&read_text(&path)?, path)
}

/// Reads a document from the text of a file.
///
/// # Errors
/// As [`read`].
pub fn parse<T: Document>(text: &str, path: impl AsRef<Path>) -> Result<T, InputError> {
    let wrong = |e: serde_json::Error| InputError::line(&path, e.line(), format!("is not {}: {e}", T::FORMAT));
    let head: Head = serde_json::from_str(text).map_err(wrong)?;
    let fault = |message: String| InputError { key: "format".into(), ..InputError::file(&path, message) };
    match head.format.as_deref() {
        Some(format) if format == T::FORMAT => serde_json::from_str(text).map_err(wrong),
        Some(other) => Err(fault(format!("is \"{other}\"; this version of palpate understands \"{}\"", T::FORMAT))),
        None => Err(fault(format!("is missing; \"{}\" is expected", T::FORMAT))),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::fmt::Debug;

    /// Writes a document, reads it again, and compares; and refuses it in a version to come. Returns what stood in the file.
    pub fn round_trip<T: Document + Debug + PartialEq>(document: &T) -> serde_json::Value {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("document.json");
        write(&path, document).expect("it can be written");
        assert_eq!(&read::<T>(&path).expect("it can be read"), document);
        assert_eq!(&parse::<T>(&line(document), &path).expect("it can be read from one line"), document);
        let text = std::fs::read_to_string(&path).expect("it was written");
        let (name, version) = T::FORMAT.split_once('/').expect("a format has a version");
        let newer = format!("{name}/{}", version.parse::<u32>().expect("a number") + 1);
        let e = parse::<T>(&text.replacen(T::FORMAT, &newer, 1), "there/result.json").expect_err("it is of a version to come");
        let said = format!("there/result.json: format: is \"{newer}\"; this version of palpate understands \"{}\"", T::FORMAT);
        assert_eq!(e.to_string(), said);
        serde_json::from_str(&text).expect("it is JSON")
    }

    /// Keys of an object, in order.
    pub fn keys(value: &serde_json::Value) -> Vec<&str> {
        value.as_object().expect("an object").keys().map(String::as_str).collect()
    }

    #[test]
    fn what_is_no_document_is_refused_with_its_place() {
        let read = |text: &str| parse::<fit::FitDocument>(text, "a.json").expect_err("it is none").to_string();
        assert_eq!(read("{}"), "a.json: format: is missing; \"fit/2\" is expected");
        assert!(read("{\n\"format\": }").starts_with("a.json:2: is not fit/2: expected value"), "{}", read("{\n\"format\": }"));
        assert!(read("{\"format\": \"fit/2\"}").starts_with("a.json:1: is not fit/2: missing field"));
    }
}
