//! Formats that are written: one file each, and one line in [`ALL`].

mod calculix;
mod febio;
mod gmsh;
mod mujoco;
mod sofa;
mod urdf;
mod usd;

use crate::feature::{Carried, Feature};
use crate::specimen::Specimen;
use crate::{ExportError, File};

/// A law of a program, and whether it is that of the scene at any strain.
pub(crate) type Law = Option<(&'static str, bool)>;

/// A format of another program.
pub struct Format {
    /// As `--format` names it.
    pub name: &'static str,
    /// In words.
    pub what: &'static str,
    /// Ending of its main file.
    pub ending: &'static str,
    /// True where it has quadratic elements.
    pub has_quadratic: bool,
    /// What it makes of a feature, with quadratic elements or without.
    pub carries: fn(Feature, bool) -> Carried,
    /// Its law for a material of scenes; `None` where it has no law at all.
    pub(crate) law: fn(&str) -> Law,
    /// Writes a specimen, whose head names what is lost.
    pub(crate) write: fn(&Specimen, &[String]) -> Result<Vec<File>, ExportError>,
}

impl std::fmt::Debug for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Every format.
pub const ALL: [&Format; 7] =
    [&mujoco::FORMAT, &calculix::FORMAT, &febio::FORMAT, &sofa::FORMAT, &usd::FORMAT, &gmsh::FORMAT, &urdf::FORMAT];

/// The main file of a specimen.
fn file(s: &Specimen, format: &Format, text: String) -> File {
    File { name: format!("{}.{}", s.name, format.ending), text }
}
