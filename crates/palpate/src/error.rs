//! What can go wrong, sorted by whose fault it is.

use palpate_engine::{BuildError, Failure};
use palpate_io::{InputError, OutputError};

/// Why a command stopped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// Something given by the user is wrong: one line that names the file, key or option, and what is allowed.
    #[error("{0}")]
    Input(String),
    /// The input is fine, but the computation or the writing of its result failed.
    #[error("{0}")]
    Failed(String),
    /// The user asked to stop before there was anything worth keeping.
    #[error("interrupted: nothing was written")]
    Interrupted,
}

impl Error {
    /// Exit code of the command line: 2 for bad input, 1 for a failed computation, 130 when interrupted.
    pub fn exit_code(&self) -> i32 {
        match self {
            Error::Input(_) => 2,
            Error::Failed(_) => 1,
            Error::Interrupted => crate::cli::INTERRUPTED,
        }
    }

    /// A file could not be written.
    pub fn write(path: &std::path::Path, cause: impl std::fmt::Display) -> Error {
        Error::Failed(format!("{}: cannot be written: {cause}", path.display()))
    }
}

impl From<InputError> for Error {
    fn from(e: InputError) -> Error {
        Error::Input(e.to_string())
    }
}

impl From<OutputError> for Error {
    fn from(e: OutputError) -> Error {
        Error::Failed(e.to_string())
    }
}

impl From<Failure> for Error {
    fn from(e: Failure) -> Error {
        Error::Failed(e.to_string())
    }
}

impl From<BuildError> for Error {
    fn from(e: BuildError) -> Error {
        Error::Failed(e.to_string())
    }
}
