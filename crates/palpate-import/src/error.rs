//! Why an import stopped.

use palpate_io::{InputError, OutputError, shown};
use std::path::Path;

/// Why nothing was imported, in one line that says what is allowed.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Something is wrong with a file of the source: which, its line and its key where there are such.
    #[error(transparent)]
    File(#[from] InputError),
    /// An option contradicts the source, or is wrong by itself.
    #[error("--{option}{}{}: {message}", if given.is_empty() { "" } else { " " }, shown(given))]
    Option {
        /// Its name, without dashes.
        option: &'static str,
        /// What was given; empty where nothing was.
        given: String,
        /// What is wrong with it and what is allowed.
        message: String,
    },
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The user asked to stop.
    #[error("interrupted: nothing was written")]
    Interrupted,
}

/// Something is wrong with a whole file or folder.
pub(crate) fn refuse<T>(file: impl AsRef<Path>, message: impl Into<String>) -> Result<T, ImportError> {
    Err(InputError::file(file, message).into())
}

/// Something is wrong with a key of a file.
pub(crate) fn refuse_key<T>(
    file: impl AsRef<Path>,
    key: impl Into<String>,
    message: impl Into<String>,
) -> Result<T, ImportError> {
    Err(InputError { key: key.into(), ..InputError::file(file, message) }.into())
}

/// Something is wrong with an option.
pub(crate) fn refuse_option<T>(option: &'static str, given: impl ToString, message: impl Into<String>) -> Result<T, ImportError> {
    Err(ImportError::Option { option, given: given.to_string(), message: message.into() })
}

/// The bytes of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, ImportError> {
    Ok(palpate_io::read_bytes(path)?)
}

/// The text of a file; what is no UTF-8 is replaced, since names in older files are in other encodings.
pub(crate) fn read_text(path: &Path) -> Result<String, ImportError> {
    let bytes = read(path)?;
    Ok(String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes)).into_owned())
}
