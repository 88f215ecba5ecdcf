//! From a body of tetrahedra with its material, its clamps and its world to files that other programs simulate.
//!
//! Invariant: what a file does not hold of the specimen stands in its head by name, and is told to whoever asked for it. Nothing is left out
//! in silence, and nothing is made up. This room knows no scene, no solver and no disk.

mod cells;
mod feature;
pub mod fill;
mod formats;
mod mesh;
mod specimen;
mod text;

pub use feature::{Carried, Feature, markdown};
pub use formats::Format;
pub use mesh::Mesh;
pub use specimen::{Clock, Displacement, Ground, Held, Material, PointMass, Specimen, Spin};

/// Formats that are written.
pub fn formats() -> impl Iterator<Item = &'static Format> {
    formats::ALL.iter().copied()
}

/// The format of this name.
pub fn find(name: &str) -> Option<&'static Format> {
    formats().find(|f| f.name == name)
}

/// A file that was made.
#[derive(Clone, Debug, PartialEq)]
pub struct File {
    /// Its name, without a folder.
    pub name: String,
    /// What stands in it.
    pub text: String,
}

/// What was made of a specimen.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The main file first.
    pub files: Vec<File>,
    /// What the file does not hold or holds differently, a line each.
    pub lost: Vec<String>,
}

/// Why a specimen cannot be written, in one line that says what helps.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// The format has no place for something without which the file would mislead.
    #[error("{name} cannot be written as {format}: {why}; {instead}")]
    Refused {
        /// What there is no place for, by its key.
        name: String,
        /// The format.
        format: &'static str,
        /// Why there is no place.
        why: String,
        /// What to do instead.
        instead: String,
    },
}

/// Writes a specimen in a format.
///
/// # Errors
/// The format has no place for something without which the file would mislead: a stiffness that varies, or a clamp that holds nothing there.
pub fn export(specimen: &Specimen, format: &'static Format) -> Result<Exported, ExportError> {
    let lost = feature::lost(specimen, format)?;
    let files = (format.write)(specimen, &lost)?;
    Ok(Exported { files, lost })
}

#[cfg(test)]
mod tests;
