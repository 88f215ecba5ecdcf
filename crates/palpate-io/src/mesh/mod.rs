//! Surface meshes: OBJ, PLY and STL files to a closed triangle mesh.

mod parse;

use crate::error::{InputError, Loaded};
use glam::DVec3;
use palpate_model::shape::TriMesh;
use std::path::Path;

/// Longest side of an object [m]; anything larger was written in another unit.
pub(crate) const LARGEST_SIDE: f64 = 50.0;

/// Shortest longest side [m]; anything smaller was written in another unit.
const SMALLEST_SIDE: f64 = 1e-4;

/// Reads a closed surface (`.obj`, `.ply`, `.stl`; metres). Polygons are split into triangles and equal vertices merged.
///
/// # Errors
/// A file that cannot be parsed, holds no triangle, is in the wrong unit, or encloses no volume.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<Loaded<TriMesh>, InputError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let raw = match extension.as_str() {
        "obj" => parse::obj(&bytes),
        "ply" => parse::ply(&bytes),
        "stl" => parse::stl(&bytes),
        other => Err(format!("\".{other}\" is not a mesh format that is read; allowed: .obj, .ply, .stl")),
    };
    let mesh = merge(raw.map_err(|e| InputError::file(path, e))?);
    check(path, mesh)
}

/// Lowest and highest corner of points [m].
pub(crate) fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
}

/// Equal vertices become one, unused ones and triangles without area go; the order of the rest is kept.
fn merge(mesh: TriMesh) -> TriMesh {
    let mut number = std::collections::BTreeMap::new();
    let mut out = TriMesh::default();
    for t in &mesh.triangles {
        let corners = t.map(|v| {
            // Adding zero turns −0 into +0, which have different bits.
            let p = mesh.vertices[v as usize] + DVec3::ZERO;
            *number.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                out.vertices.push(p);
                out.vertices.len() as u32 - 1
            })
        });
        if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
            out.triangles.push(corners);
        }
    }
    out
}

fn check(path: &Path, mesh: TriMesh) -> Result<Loaded<TriMesh>, InputError> {
    let refuse = |message: String| Err(InputError::file(path, message));
    if mesh.triangles.is_empty() {
        return refuse("holds no triangle with area".to_string());
    }
    let (min, max) = bounds(&mesh.vertices);
    let side = (max - min).max_element();
    if side > LARGEST_SIDE {
        return refuse(format!("its longest side is {side} m; in millimetres? convert the file to metres (scale by 0.001)"));
    }
    if side < SMALLEST_SIDE {
        return refuse(format!("its longest side is {side:e} m; lengths are in metres: convert the file"));
    }
    repair(path, mesh, side)
}

/// Thin until the model can report on and repair meshes.
fn repair(path: &Path, mesh: TriMesh, side: f64) -> Result<Loaded<TriMesh>, InputError> {
    let volume: f64 =
        (mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize]))).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    // A flat sheet's volume is rounding noise; a sheet a thousandth as thick as long is far above it.
    if volume.abs() < 1e-9 * side.powi(3) {
        return Err(InputError::file(path, format!("encloses no volume ({volume:e} m³); a closed surface is needed")));
    }
    Ok(Loaded { value: mesh, warnings: Vec::new() })
}
