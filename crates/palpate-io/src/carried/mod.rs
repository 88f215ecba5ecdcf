//! Files of places that a motion carries: meshes (OBJ, PLY), clouds of points and Gaussian splats (PLY). What moves is replaced, and all else
//! stays as it is: triangles, texture coordinates, colours, materials.

mod obj;
mod ply;
#[cfg(test)]
mod tests;

use crate::error::{InputError, OutputError};
use crate::input::read_bytes;
use crate::output::write_file;
use glam::{DMat3, DVec3};
use std::path::Path;

/// Where a place went [m], and the deformation gradient there.
pub type Moved = (DVec3, DMat3);

/// A file of places.
#[derive(Debug)]
pub struct Carried {
    places: Vec<DVec3>,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Obj(obj::Lines),
    Ply(Box<ply::Vertices>),
}

impl Carried {
    /// Reads a file.
    ///
    /// # Errors
    /// A format that is not read, a file without places, or one whose places are no numbers.
    pub fn read(path: &Path) -> Result<Carried, InputError> {
        let bytes = read_bytes(path)?;
        let wrong = |text: String| InputError::file(path, text);
        let (places, content) = match ending(path).as_str() {
            "obj" => obj::read(&bytes).map(|(p, l)| (p, Content::Obj(l))).map_err(wrong)?,
            "ply" => ply::read(bytes).map(|(p, v)| (p, Content::Ply(Box::new(v)))).map_err(wrong)?,
            other => {
                let text = format!(
                    "\".{other}\" is no format that a motion carries; allowed: .obj (meshes), .ply (meshes, points, splats)"
                );
                return Err(wrong(text));
            }
        };
        if places.is_empty() {
            return Err(wrong("holds no vertex".into()));
        }
        if let Some(i) = places.iter().position(|p| !p.is_finite()) {
            return Err(wrong(format!("vertex {} is not finite", i + 1)));
        }
        Ok(Carried { places, content })
    }

    /// Places [m] `[V]`.
    pub fn places(&self) -> &[DVec3] {
        &self.places
    }

    /// What it holds, for people.
    pub fn noun(&self) -> &'static str {
        match &self.content {
            Content::Obj(_) => "vertices",
            Content::Ply(v) => v.noun(),
        }
    }

    /// Writes it with every place moved.
    ///
    /// # Errors
    /// The file that could not be written and why.
    pub fn write(&self, path: &Path, moved: impl Fn(usize) -> Moved + Sync) -> Result<(), OutputError> {
        let bytes = match &self.content {
            Content::Obj(lines) => lines.moved(moved),
            Content::Ply(vertices) => vertices.moved(moved),
        };
        write_file(path, |out| out.write_all(&bytes))
    }
}

/// The ending of a file's name in small letters, without the dot.
fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}
