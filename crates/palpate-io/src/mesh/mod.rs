//! Surface meshes: OBJ, PLY and STL files to a closed triangle mesh; and volume meshes to tetrahedra.

mod fast;
mod parse;
#[cfg(test)]
mod tests;
mod volume;

pub(crate) use parse::announces_no_more_than_it_holds;

pub use volume::read_tets;

use crate::error::{InputError, Loaded, number};
use crate::input::read_bytes;
use glam::DVec3;
use palpate_model::shape::{MeshReport, MeshShape, TriMesh, repair};
use rayon::prelude::*;
use std::path::Path;

/// Longest side of an object [m]; anything larger was written in another unit.
pub(crate) const LARGEST_SIDE: f64 = 50.0;

/// Shortest longest side [m]; anything smaller was written in another unit.
const SMALLEST_SIDE: f64 = 1e-4;

/// Reads a closed surface (`.obj`, `.ply`, `.stl`; metres). Polygons are split into triangles and equal vertices merged.
///
/// # Errors
/// A file that cannot be parsed, holds no triangle, is in the wrong unit, is open, one-sided, or encloses no volume. Small holes
/// are closed and inward faces turned, with a warning.
pub fn read_mesh(path: impl AsRef<Path>) -> Result<Loaded<TriMesh>, InputError> {
    repaired(path.as_ref(), &mut |_| 1.0)
}

/// The same of a mesh in any unit: `metres` is asked with its longest side in the file's own unit and answers with the metres of one.
///
/// # Errors
/// As [`read_mesh`].
pub fn read_mesh_in(path: impl AsRef<Path>, mut metres: impl FnMut(f64) -> f64) -> Result<Loaded<TriMesh>, InputError> {
    repaired(path.as_ref(), &mut metres)
}

fn repaired(path: &Path, metres: &mut dyn FnMut(f64) -> f64) -> Result<Loaded<TriMesh>, InputError> {
    let Loaded { value, warnings } = read_scaled(path, metres)?;
    Ok(Loaded { value: value.shape.into_mesh(), warnings })
}

/// A surface that was read.
pub(crate) struct Surface {
    /// Repaired, and ready to be asked for distances.
    pub shape: MeshShape,
    /// Edges with one triangle in the file, which the repair has closed.
    pub open_edges: usize,
}

/// As [`read_mesh`], with what the file was like.
pub(crate) fn read_repaired(path: &Path) -> Result<Loaded<Surface>, InputError> {
    read_scaled(path, &mut |_| 1.0)
}

fn read_scaled(path: &Path, metres: &mut dyn FnMut(f64) -> f64) -> Result<Loaded<Surface>, InputError> {
    let bytes = read_bytes(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let raw = match extension.as_str() {
        "obj" => parse::obj(&bytes),
        "ply" => parse::ply(&bytes),
        "stl" => parse::stl(&bytes),
        other => Err(format!("\".{other}\" is not a mesh format that is read; allowed: .obj, .ply, .stl")),
    };
    let mut mesh = merge(raw.map_err(|e| InputError::file(path, e))?);
    let (min, max) = bounds(&mesh.vertices);
    let scale = metres((max - min).max_element());
    mesh.vertices.iter_mut().for_each(|v| *v *= scale);
    check(path, mesh)
}

/// Lowest and highest corner of points [m].
pub(crate) fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
}

/// Equal vertices become one, unused ones and collapsed triangles go; the order of the rest is kept.
fn merge(mesh: TriMesh) -> TriMesh {
    // Adding zero turns −0 into +0, which have different bits.
    let bits = |v: u32| (mesh.vertices[v as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    order.par_sort_unstable_by_key(|v| (bits(*v), *v));
    let mut first: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for group in order.chunk_by(|a, b| bits(*a) == bits(*b)) {
        group.iter().for_each(|v| first[*v as usize] = group[0]);
    }
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    let mut out = TriMesh::default();
    for t in &mesh.triangles {
        let corners = t.map(|v| {
            let (own, n) = (first[v as usize], out.vertices.len() as u32);
            if number[own as usize] == u32::MAX {
                number[own as usize] = n;
                out.vertices.push(mesh.vertices[own as usize] + DVec3::ZERO);
            }
            number[own as usize]
        });
        if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
            out.triangles.push(corners);
        }
    }
    out
}

fn check(path: &Path, mesh: TriMesh) -> Result<Loaded<Surface>, InputError> {
    let refuse = |message: String| Err(InputError::file(path, message));
    if mesh.triangles.is_empty() {
        return refuse("holds no triangle with area".to_string());
    }
    let (min, max) = bounds(&mesh.vertices);
    let side = (max - min).max_element();
    if side > LARGEST_SIDE {
        return refuse(format!(
            "its longest side is {} m; in millimetres? convert the file to metres (scale by 0.001)",
            number(side)
        ));
    }
    if side < SMALLEST_SIDE {
        return refuse(format!("its longest side is {side:e} m; lengths are in metres: convert the file"));
    }
    // Coordinates of files carry six or more digits; a millionth of the length is flat.
    if (max - min).min_element() < 1e-6 * side {
        return refuse("encloses no volume: it is flat; a closed surface of a solid is needed".to_string());
    }
    let repaired = repair(&mesh);
    let mut warnings: Vec<String> = repaired.done.iter().map(|r| format!("repaired: {r}")).collect();
    let open_edges = repaired.open_edges;
    let (shape, report) = MeshShape::examined(repaired.mesh);
    if let Some(fault) = fault(&report, side) {
        return refuse(fault);
    }
    if report.non_manifold_edges > 0 {
        warnings.push(format!("touches itself along {} edges", report.non_manifold_edges));
    }
    if report.intersecting_pairs > 0 {
        warnings.push(format!(
            "touches or passes through itself: {} pairs of triangles; the union of its parts is used, where the parts by themselves \
             have {:.4e} m³ in all",
            report.intersecting_pairs, report.signed_volume
        ));
    }
    let warnings = warnings.into_iter().map(|w| InputError::file(path, w).to_string()).collect();
    Ok(Loaded { value: Surface { shape, open_edges }, warnings })
}

/// What keeps a repaired mesh from enclosing a solid.
fn fault(report: &MeshReport, side: f64) -> Option<String> {
    if report.open_edges > 0 {
        let largest = match report.holes.first() {
            Some((edges, rim)) => format!(", the largest hole has {edges} of them and a rim of {rim:.4} m"),
            None => String::new(),
        };
        let edges = report.open_edges;
        return Some(format!("is open: {edges} border edges{largest}; a closed surface is needed: fill it in a mesh editor"));
    }
    if report.inconsistent_edges > 0 {
        let edges = report.inconsistent_edges;
        return Some(format!("has no inside: its surface is one-sided (like a Möbius strip), seen along {edges} edges"));
    }
    // A flattened surface's volume is rounding noise; a fibre a thousandth as thick as long is far above this.
    (report.signed_volume < 1e-9 * side.powi(3))
        .then(|| format!("encloses no volume ({:e} m³, its longest side is {side} m)", report.signed_volume))
}
