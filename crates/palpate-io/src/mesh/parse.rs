//! The three mesh formats to vertices and triangles, nothing more.

use super::fast;
use glam::DVec3;
use palpate_model::shape::TriMesh;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property, PropertyAccess, PropertyAccessResult};
use std::io::Cursor;

/// Fan of a polygon with vertices `at(0..n)`; the solid is the same for planar polygons that are convex.
pub(super) fn fan(n: usize, at: impl Fn(usize) -> u32, out: &mut Vec<[u32; 3]>) {
    out.extend((2..n).map(|i| [at(0), at(i - 1), at(i)]));
}

fn finite(mesh: TriMesh) -> Result<TriMesh, String> {
    match mesh.vertices.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(format!("vertex {} is not finite", i + 1)),
        None => Ok(mesh),
    }
}

/// Wavefront OBJ; materials, normals, groups are passed over.
pub(super) fn obj(bytes: &[u8]) -> Result<TriMesh, String> {
    fast::obj(bytes).map_or_else(|| slow_obj(bytes), finite)
}

pub(super) fn slow_obj(bytes: &[u8]) -> Result<TriMesh, String> {
    let options = tobj::LoadOptions { ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &std::path::Path| Ok((Vec::new(), Default::default()));
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|e| format!("not a readable OBJ file: {e}"))?;
    let mut mesh = TriMesh::default();
    for model in models {
        let base = mesh.vertices.len() as u32;
        let m = model.mesh;
        mesh.vertices.extend(m.positions.chunks_exact(3).map(|p| DVec3::new(p[0], p[1], p[2])));
        let mut first = 0;
        let arities = if m.face_arities.is_empty() { vec![3; m.indices.len() / 3] } else { m.face_arities };
        for n in arities {
            fan(n as usize, |i| base + m.indices[first + i], &mut mesh.triangles);
            first += n as usize;
        }
    }
    finite(mesh)
}

/// What is read of a vertex or a face; other properties are passed over.
#[derive(Default)]
struct Row {
    coordinates: [Option<f64>; 3],
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Row {
    fn new() -> Row {
        Row::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let number = match property {
            Property::Float(x) => Some(f64::from(x)),
            Property::Double(x) => Some(x),
            Property::Int(x) => Some(f64::from(x)),
            Property::Short(x) => Some(f64::from(x)),
            _ => None,
        };
        match name {
            "x" => self.coordinates[0] = number,
            "y" => self.coordinates[1] = number,
            "z" => self.coordinates[2] = number,
            "vertex_indices" | "vertex_index" => self.corners = property.to_u32_list().or(self.corners.take()),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// Stanford PLY, ASCII or binary.
pub(super) fn ply(bytes: &[u8]) -> Result<TriMesh, String> {
    fast::ply(bytes).map_or_else(|| slow_ply(bytes), finite)
}

/// Refuses a PLY file that announces more items of an element than it has bytes: even items without properties, which take none, would be kept.
///
/// # Errors
/// It does; the element is named. A header that cannot be read is left to whoever reads the file.
pub(crate) fn announces_no_more_than_it_holds(bytes: &[u8]) -> Result<(), String> {
    let header = Parser::<DefaultElement>::new().read_ply_header(&mut Cursor::new(bytes));
    let many = header.ok().and_then(|h| h.elements.into_iter().find(|(_, e)| e.count > bytes.len()));
    many.map_or(Ok(()), |(name, e)| {
        Err(format!("not a readable PLY file: announces {} of element \"{name}\" in {} bytes", e.count, bytes.len()))
    })
}

pub(super) fn slow_ply(bytes: &[u8]) -> Result<TriMesh, String> {
    announces_no_more_than_it_holds(bytes)?;
    let ply = Parser::<Row>::new().read_ply(&mut Cursor::new(bytes)).map_err(|e| format!("not a readable PLY file: {e}"))?;
    let part = |name: &str| ply.payload.get(name).ok_or_else(|| format!("has no element \"{name}\""));
    let mut mesh = TriMesh::default();
    for (i, v) in part("vertex")?.iter().enumerate() {
        let get =
            |k: usize| v.coordinates[k].ok_or_else(|| format!("vertex {} has no coordinate \"{}\"", i + 1, ["x", "y", "z"][k]));
        mesh.vertices.push(DVec3::new(get(0)?, get(1)?, get(2)?));
    }
    for (i, f) in part("face")?.iter().enumerate() {
        let list = f.corners.as_ref().ok_or_else(|| format!("face {} has no list \"vertex_indices\"", i + 1))?;
        if let Some(v) = list.iter().find(|v| **v as usize >= mesh.vertices.len()) {
            return Err(format!("face {} names vertex {v}, there are {}", i + 1, mesh.vertices.len()));
        }
        fan(list.len(), |k| list[k], &mut mesh.triangles);
    }
    finite(mesh)
}

/// STL, ASCII or binary; corners come unconnected and are merged later.
pub(super) fn stl(bytes: &[u8]) -> Result<TriMesh, String> {
    // A binary header may begin with "solid"; only a text whose size is not the binary one is ASCII.
    let count = bytes.get(80..84).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let binary = count.is_some_and(|n| n.checked_mul(50).and_then(|b| b.checked_add(84)) == Some(bytes.len()));
    if !binary && !bytes.starts_with(b"solid") {
        return Err("not a readable STL file: neither text nor a whole binary file (truncated?)".to_string());
    }
    if binary {
        return finite(fast::stl(bytes));
    }
    let broken = |e: std::io::Error| format!("not a readable STL file: {e}");
    let mut cursor = Cursor::new(bytes);
    let mut mesh = TriMesh::default();
    for triangle in stl_io::create_stl_reader(&mut cursor).map_err(broken)? {
        let corners = triangle.map_err(broken)?.vertices;
        let base = mesh.vertices.len() as u32;
        mesh.vertices.extend(corners.map(|p| DVec3::new(f64::from(p.0[0]), f64::from(p.0[1]), f64::from(p.0[2]))));
        mesh.triangles.push([base, base + 1, base + 2]);
    }
    finite(mesh)
}

#[cfg(test)]
mod tests {
    use super::slow_ply;

    #[test]
    fn a_ply_file_that_announces_more_than_it_holds_is_refused_before_memory_is_taken() {
        let file =
            b"ply\nformat binary_little_endian 1.0\nelement ver 4294967295\nelement vertex 1\nproperty float x\nend_header\n";
        let said = slow_ply(file).unwrap_err();
        assert!(said.contains("announces 4294967295 of element \"ver\""), "{said}");
    }
}
