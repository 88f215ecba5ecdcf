//! Files of one point cloud each: PLY (text, binary) and PCD 0.7 (text, binary, compressed), in whatever unit and axes they have.

mod pcd;
mod ply;
#[cfg(test)]
mod tests;

use crate::error::{InputError, OutputError};
use crate::input::read_bytes;
use crate::output::write_file;
use glam::DVec3;
use std::path::Path;

/// Endings of files with one cloud.
pub const ENDINGS: [&str; 2] = ["ply", "pcd"];

/// A point cloud as its file has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CloudFile {
    /// Points in the file's unit and axes `[N]`; what is not finite was not seen.
    pub points: Vec<DVec3>,
    /// Where they were seen from, in the same unit and axes, where the file says it (`VIEWPOINT` of a PCD file, if it is not zero).
    pub viewpoint: Option<DVec3>,
    /// When they were seen [s], where the file says it (`comment time 0.25` in a PLY file).
    pub time: Option<f64>,
}

/// Reads a cloud by the ending of its file.
///
/// # Errors
/// The file cannot be read, is of another format, or is damaged.
pub fn read_cloud(path: &Path) -> Result<CloudFile, InputError> {
    decode_cloud(path, &read_bytes(path)?)
}

/// The cloud in the bytes of a file, whose ending says how.
///
/// # Errors
/// As [`read_cloud`].
pub fn decode_cloud(path: &Path, bytes: &[u8]) -> Result<CloudFile, InputError> {
    match ending(path).as_str() {
        "ply" => ply::decode(path, bytes),
        "pcd" => pcd::decode(path, bytes),
        other => {
            Err(InputError::file(path, format!("\".{other}\" is no format of point clouds that is read; allowed: .ply, .pcd")))
        }
    }
}

/// The ending of a file in small letters.
pub(crate) fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// Writes points as binary PLY or PCD, by the ending of the file; every digit is kept.
///
/// # Errors
/// The file that could not be written and why.
pub fn write_cloud(path: impl AsRef<Path>, points: &[DVec3]) -> Result<(), OutputError> {
    write(path.as_ref(), points)
}

fn write(path: &Path, points: &[DVec3]) -> Result<(), OutputError> {
    let n = points.len();
    let head = match ending(path).as_str() {
        "pcd" => format!(
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n\
             POINTS {n}\nDATA binary\n"
        ),
        _ => format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty double x\nproperty double y\nproperty double z\n\
             end_header\n"
        ),
    };
    write_file(path, |out| {
        out.write_all(head.as_bytes())?;
        points.iter().flat_map(|p| p.to_array()).try_for_each(|x| out.write_all(&x.to_le_bytes()))
    })
}
