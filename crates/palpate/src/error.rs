//! What can go wrong, sorted by whose fault it is.

use palpate_diagnose::LabError;
use palpate_engine::{BuildError, Failure};
use palpate_fit::{FitError, JournalError};
use palpate_gpu::GpuError;
use palpate_import::ImportError;
use palpate_io::{InputError, OutputError, shown};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Why a command stopped. Displays as one line: what is wrong, where, and what is allowed or may help.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Something is wrong with a file: which one, and its line and key where there are such.
    #[error(transparent)]
    File(#[from] InputError),
    /// A scene by itself is in order, but not for what is asked of it.
    #[error("{}: {key} {message}", file.display())]
    Scene {
        /// The scene's file.
        file: PathBuf,
        /// Dotted path of the key.
        key: String,
        /// What is wrong with it and what is allowed.
        message: String,
    },
    /// An option of the command line is wrong.
    #[error("--{option}{}{}: {message}", if given.is_empty() { "" } else { " " }, shown(given))]
    Option {
        /// Its name, without dashes.
        option: &'static str,
        /// What was given; empty where that is long.
        given: String,
        /// What is wrong with it and what is allowed.
        message: String,
    },
    /// Something else given by the user is wrong, in one line that says what is allowed.
    #[error("{0}")]
    Input(String),
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A simulation failed: its kind, time, details and hint.
    #[error(transparent)]
    Simulation(#[from] Failure),
    /// A backend refused a body.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The graphics device cannot be had, or refused one simulation.
    #[error("--backend gpu: {e} (hint: {hint})", e = .0, hint = .0.hint_alone())]
    Device(#[source] GpuError),
    /// A fit has no result.
    #[error(transparent)]
    Fit(FitError),
    /// A diagnosis has no answer.
    #[error(transparent)]
    Diagnosis(LabError),
    /// The device failed on the way, or memory ran short; what was known by then is written.
    #[error("{why}; {kept} is in {}, --resume goes on from there", folder.display())]
    BrokenOff {
        /// Why, in the words of who broke off.
        why: String,
        /// What is kept.
        kept: &'static str,
        /// Where it is kept.
        folder: PathBuf,
    },
    /// Memory has no room for what was asked for; nothing of it was taken.
    #[error("{0}")]
    Memory(String),
    /// The input is fine, but the computation or the writing of its result failed otherwise.
    #[error("{0}")]
    Failed(String),
    /// The user asked to stop before there was anything worth keeping.
    #[error("interrupted: nothing was written")]
    Interrupted,
    /// The user asked to stop before there was a result; what was computed until then is kept.
    #[error("interrupted before there was a result; what was computed is in {}, --resume goes on from there", kept.display())]
    InterruptedKept {
        /// The journal or the checkpoints.
        kept: PathBuf,
    },
}

impl Error {
    /// A scene that does not do for what is asked of it: its file, the key, what is wrong and what is allowed.
    pub(crate) fn scene(file: &Path, key: &str, message: impl Into<String>) -> Error {
        Error::Scene { file: file.to_path_buf(), key: key.into(), message: message.into() }
    }

    /// An option with what was given, what is wrong and what is allowed.
    pub(crate) fn option(option: &'static str, given: impl ToString, message: impl Into<String>) -> Error {
        Error::Option { option, given: given.to_string(), message: message.into() }
    }

    /// A file could not be written.
    pub(crate) fn write(path: &Path, cause: std::io::Error) -> Error {
        Error::Output(OutputError::new(path, cause))
    }

    /// Of an interrupted computation with a journal says that this is kept, where anything stands in it.
    pub(crate) fn with_kept(self, journal: &Path) -> Error {
        match self {
            // The first line is the head.
            Error::Interrupted if std::fs::read_to_string(journal).is_ok_and(|text| text.lines().count() > 1) => {
                Error::InterruptedKept { kept: journal.into() }
            }
            other => other,
        }
    }

    /// True where somebody asked to stop.
    pub fn is_interrupt(&self) -> bool {
        matches!(self, Error::Interrupted | Error::InterruptedKept { .. })
    }

    /// Exit code of the command line: 2 for bad input, 1 for a failed computation, 130 when interrupted.
    pub fn exit_code(&self) -> i32 {
        match self {
            Error::File(_) | Error::Scene { .. } | Error::Option { .. } | Error::Input(_) => 2,
            Error::Fit(FitError::Journal(JournalError::Content { .. }) | FitError::Residuals { .. }) => 2,
            Error::Interrupted | Error::InterruptedKept { .. } => crate::cli::INTERRUPTED,
            _ => 1,
        }
    }

    /// The file that is meant, where it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Error::File(e) => Some(&e.file),
            Error::Scene { file, .. } => Some(file),
            Error::Output(e) => Some(&e.file),
            Error::Fit(FitError::Journal(JournalError::Io { path, .. } | JournalError::Content { path, .. })) => Some(path),
            _ => self.cause().and_then(Error::file),
        }
    }

    /// Line of that file, from 1, where it is known.
    pub fn line(&self) -> Option<usize> {
        match self {
            Error::File(e) => e.line,
            Error::Fit(FitError::Journal(JournalError::Content { line, .. })) => Some(*line),
            _ => self.cause().and_then(Error::line),
        }
    }

    /// Dotted path of the key in that file, or name of the option, where one is meant.
    pub fn key(&self) -> Option<&str> {
        match self {
            Error::File(e) => Some(e.key.as_str()).filter(|k| !k.is_empty()),
            Error::Scene { key, .. } => Some(key),
            Error::Option { option, .. } => Some(option),
            _ => self.cause().and_then(Error::key),
        }
    }

    /// What may help, where whoever failed knows.
    pub fn hint(&self) -> Option<Cow<'_, str>> {
        match self {
            Error::Simulation(f) => Some(Cow::Borrowed(&f.hint)),
            Error::Build(e) => Some(Cow::Borrowed(&e.hint)),
            Error::Device(e) => Some(Cow::Owned(e.hint_alone())),
            _ => self.cause().and_then(Error::hint),
        }
    }

    /// The simulation that failed, if one did: kind, time [s] and details.
    pub fn failure(&self) -> Option<&Failure> {
        match self {
            Error::Simulation(f) => Some(f),
            _ => self.cause().and_then(Error::failure),
        }
    }

    /// The error of this kind behind that of a diagnosis.
    fn cause(&self) -> Option<&Error> {
        match self {
            Error::Diagnosis(LabError::Failed(cause)) => cause.downcast_ref(),
            _ => None,
        }
    }
}

impl From<ImportError> for Error {
    fn from(e: ImportError) -> Error {
        match e {
            ImportError::File(e) => Error::File(e),
            ImportError::Option { option, given, message } => Error::Option { option, given, message },
            ImportError::Output(e) => Error::Output(e),
            ImportError::Interrupted => Error::Interrupted,
        }
    }
}

impl From<FitError> for Error {
    fn from(e: FitError) -> Error {
        match e {
            FitError::Interrupted => Error::Interrupted,
            e => Error::Fit(e),
        }
    }
}

impl From<LabError> for Error {
    fn from(e: LabError) -> Error {
        match e {
            LabError::Interrupted => Error::Interrupted,
            e => Error::Diagnosis(e),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_engine::FailureKind;
    use std::error::Error as _;

    #[test]
    fn a_failed_simulation_keeps_its_kind_time_and_hint_also_behind_a_diagnosis() {
        let failure = Failure::new(FailureKind::FellOut, 0.25, "node 3");
        let text = failure.to_string();
        for e in [Error::from(failure.clone()), Error::from(LabError::failed(Error::from(failure.clone())))] {
            assert_eq!((e.to_string(), e.exit_code()), (text.clone(), 1));
            assert_eq!(e.failure(), Some(&failure));
            assert_eq!(e.hint().as_deref(), Some(&*failure.hint));
            assert!(e.file().is_none() && e.line().is_none() && e.key().is_none());
        }
    }

    #[test]
    fn what_is_wrong_with_input_keeps_its_place() {
        let file = InputError { key: "time.step".into(), ..InputError::line("a.toml", 7, "must be > 0") };
        let scene = Error::scene(Path::new("a.toml"), "fit.parameter", "is missing");
        let option = Error::option("fps", 0.0, "must be > 0");
        let said = [
            (Error::from(file), "a.toml:7: time.step: must be > 0", Some("a.toml"), Some(7), Some("time.step")),
            (scene, "a.toml: fit.parameter is missing", Some("a.toml"), None, Some("fit.parameter")),
            (option, "--fps 0: must be > 0", None, None, Some("fps")),
            (Error::option("times", "", "give times"), "--times: give times", None, None, Some("times")),
        ];
        for (e, text, file, line, key) in said {
            assert_eq!((e.to_string().as_str(), e.exit_code()), (text, 2));
            assert_eq!((e.file(), e.line(), e.key(), e.hint()), (file.map(Path::new), line, key, None));
        }
    }

    #[test]
    fn what_cannot_be_written_names_the_systems_reason() {
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let e = Error::write(Path::new("out/result.json"), full);
        assert_eq!((e.to_string().as_str(), e.exit_code()), ("out/result.json: cannot be written: no storage space", 1));
        let cause = e.source().and_then(|c| c.downcast_ref::<std::io::Error>()).map(std::io::Error::kind);
        assert_eq!((e.file(), cause), (Some(Path::new("out/result.json")), Some(std::io::ErrorKind::StorageFull)));
    }

    #[test]
    fn a_journal_of_another_fit_is_bad_input_and_no_start_is_none() {
        let journal = JournalError::Content { path: "journal.jsonl".into(), line: 1, message: "another fit".into() };
        let e = Error::from(FitError::from(journal));
        assert_eq!((e.exit_code(), e.file(), e.line()), (2, Some(Path::new("journal.jsonl")), Some(1)));
        assert_eq!(Error::from(FitError::NoStart("it fell".into())).exit_code(), 1);
        assert_eq!(Error::from(FitError::Interrupted).exit_code(), crate::cli::INTERRUPTED);
        assert_eq!(Error::from(LabError::Interrupted).exit_code(), crate::cli::INTERRUPTED);
    }
}
