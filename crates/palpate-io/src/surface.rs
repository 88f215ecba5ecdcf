//! Surface meshes to OBJ and PLY files.

use crate::error::OutputError;
use crate::output::write_file;
use palpate_model::shape::TriMesh;
use std::path::Path;

/// Writes a surface as Wavefront OBJ (metres; every digit of the coordinates is kept).
///
/// # Errors
/// The file that could not be written and why.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<(), OutputError> {
    obj(path.as_ref(), mesh)
}

fn obj(path: &Path, mesh: &TriMesh) -> Result<(), OutputError> {
    write_file(path, |out| {
        for v in &mesh.vertices {
            writeln!(out, "v {:?} {:?} {:?}", v.x, v.y, v.z)?;
        }
        for t in &mesh.triangles {
            writeln!(out, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
        }
        Ok(())
    })
}

/// Writes a surface as binary little-endian PLY with double coordinates (metres).
///
/// # Errors
/// The file that could not be written and why.
pub fn write_ply(path: impl AsRef<Path>, mesh: &TriMesh) -> Result<(), OutputError> {
    ply(path.as_ref(), mesh)
}

fn ply(path: &Path, mesh: &TriMesh) -> Result<(), OutputError> {
    write_file(path, |out| {
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            mesh.vertices.len(),
            mesh.triangles.len()
        )?;
        for v in &mesh.vertices {
            v.to_array().iter().try_for_each(|x| out.write_all(&x.to_le_bytes()))?;
        }
        for t in &mesh.triangles {
            out.write_all(&[3])?;
            t.iter().try_for_each(|i| out.write_all(&i.to_le_bytes()))?;
        }
        Ok(())
    })
}
