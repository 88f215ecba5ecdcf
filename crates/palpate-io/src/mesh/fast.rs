//! The common case of every mesh format, read at the pace of the disk: binary triangles, plain vertices and faces. Whatever is unusual is left to
//! the crates that know all of a format, which also say what is wrong: [`None`].

use super::parse::fan;
use glam::DVec3;
use palpate_model::shape::TriMesh;
use rayon::prelude::*;

/// Bytes of a text that one thread reads at once.
const PART: usize = 1 << 20;

/// Bytes of a triangle in a binary STL file: normal, three corners, two bytes of attributes.
const TRIANGLE: usize = 50;

fn float(bytes: &[u8]) -> f64 {
    f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

/// A binary STL file whose size is right.
pub(super) fn stl(bytes: &[u8]) -> TriMesh {
    let triangles = bytes[84..].chunks_exact(TRIANGLE);
    let corners = |t: &[u8]| [12, 24, 36].map(|at| DVec3::new(float(&t[at..]), float(&t[at + 4..]), float(&t[at + 8..])));
    let vertices: Vec<DVec3> = triangles.flat_map(corners).collect();
    let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    TriMesh { vertices, triangles }
}

/// Vertices and polygons of one part of an OBJ file.
#[derive(Default)]
struct Part {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// An OBJ file of vertices and faces that are counted from 1.
pub(super) fn obj(bytes: &[u8]) -> Option<TriMesh> {
    let mut parts = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let after = rest.len().min(PART);
        let end = rest[after..].iter().position(|b| *b == b'\n').map_or(rest.len(), |n| after + n + 1);
        let (part, others) = rest.split_at(end);
        parts.push(part);
        rest = others;
    }
    let parts: Vec<Part> = parts.into_par_iter().map(obj_part).collect::<Option<_>>()?;
    let mut mesh = TriMesh::default();
    for part in parts {
        mesh.vertices.extend(part.vertices);
        mesh.triangles.extend(part.triangles);
    }
    let count = mesh.vertices.len() as u32;
    mesh.triangles.iter().flatten().all(|v| *v < count).then_some(mesh)
}

fn obj_part(bytes: &[u8]) -> Option<Part> {
    let mut part = Part::default();
    let mut polygon: Vec<u32> = Vec::new();
    for line in bytes.split(|b| *b == b'\n') {
        let mut words = line.split(|b| b.is_ascii_whitespace()).filter(|w| !w.is_empty());
        match words.next() {
            Some(b"v") => {
                let mut number = || std::str::from_utf8(words.next()?).ok()?.parse::<f64>().ok();
                part.vertices.push(DVec3::new(number()?, number()?, number()?));
            }
            Some(b"f") => {
                polygon.clear();
                for word in words {
                    polygon.push(index(word)?);
                }
                fan(polygon.len(), |k| polygon[k], &mut part.triangles);
            }
            // Normals, textures, names and materials; points and lines have no area.
            Some(b"vn" | b"vt" | b"o" | b"g" | b"s" | b"usemtl" | b"mtllib" | b"p" | b"l") | None => {}
            Some([b'#', ..]) => {}
            Some(_) => return None,
        }
        if line.ends_with(b"\\") || line.ends_with(b"\\\r") {
            return None;
        }
    }
    Some(part)
}

/// Number of a face's vertex, counted from 0, of `7`, `7/1`, `7//3` or `7/1/3`.
fn index(word: &[u8]) -> Option<u32> {
    let digits = word.split(|b| *b == b'/').next()?;
    if digits.is_empty() || digits.len() > 9 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    digits.iter().fold(0u32, |n, d| 10 * n + u32::from(d - b'0')).checked_sub(1)
}

/// What a property of a PLY file takes [B]; `None` of a list or of an unknown type.
fn width(kind: &str) -> Option<usize> {
    match kind {
        "char" | "uchar" | "int8" | "uint8" => Some(1),
        "short" | "ushort" | "int16" | "uint16" => Some(2),
        "int" | "uint" | "float" | "int32" | "uint32" | "float32" => Some(4),
        "double" | "float64" => Some(8),
        _ => None,
    }
}

/// A binary PLY file, lowest bytes first, of vertices with three coordinates and faces that are one list.
pub(super) fn ply(bytes: &[u8]) -> Option<TriMesh> {
    const END: &[u8] = b"end_header\n";
    let end = bytes.windows(END.len()).take(1 << 14).position(|w| w == END)?;
    let head = std::str::from_utf8(&bytes[..end]).ok()?;
    let mut lines = head.lines().filter(|l| !l.starts_with("comment") && !l.starts_with("obj_info"));
    if (lines.next()?, lines.next()?) != ("ply", "format binary_little_endian 1.0") {
        return None;
    }
    let (mut vertices, mut faces, mut stride, mut places) = (0usize, 0usize, 0usize, [None; 3]);
    let mut in_vertex = false;
    let mut lists = 0;
    for line in lines {
        match line.split_ascii_whitespace().collect::<Vec<_>>()[..] {
            ["element", "vertex", n] if faces == 0 && !in_vertex => (vertices, in_vertex) = (n.parse().ok()?, true),
            ["element", "face", n] if in_vertex && lists == 0 => (faces, in_vertex) = (n.parse().ok()?, false),
            ["property", "list", "uchar" | "uint8", "int" | "uint" | "int32" | "uint32", "vertex_indices" | "vertex_index"]
                if faces > 0 && lists == 0 =>
            {
                lists = 1;
            }
            ["property", kind, name] if in_vertex => {
                if let Some(k) = ["x", "y", "z"].iter().position(|n| *n == name) {
                    let wide = matches!(kind, "double" | "float64");
                    places[k] = (wide || matches!(kind, "float" | "float32")).then_some((stride, wide));
                    places[k]?;
                }
                stride += width(kind)?;
            }
            _ => return None,
        }
    }
    let [Some(x), Some(y), Some(z)] = places else { return None };
    if lists == 0 {
        return None;
    }
    let body = &bytes[end + END.len()..];
    let (of_vertices, mut of_faces) = body.split_at_checked(vertices.checked_mul(stride)?)?;
    // Every face has a byte at least: what is announced beyond is not there.
    if faces > of_faces.len() {
        return None;
    }
    let number = |v: &[u8], (at, wide): (usize, bool)| match wide {
        false => float(&v[at..]),
        true => f64::from_le_bytes(std::array::from_fn(|k| v[at + k])),
    };
    let mut mesh = TriMesh::default();
    mesh.vertices.extend(of_vertices.chunks_exact(stride).map(|v| DVec3::new(number(v, x), number(v, y), number(v, z))));
    mesh.triangles.reserve(faces);
    for _ in 0..faces {
        let (count, rest) = of_faces.split_first()?;
        let (list, rest) = rest.split_at_checked(4 * usize::from(*count))?;
        let corner = |k: usize| u32::from_le_bytes(std::array::from_fn(|b| list[4 * k + b]));
        if (0..usize::from(*count)).any(|k| corner(k) as usize >= vertices) {
            return None;
        }
        fan(usize::from(*count), corner, &mut mesh.triangles);
        of_faces = rest;
    }
    Some(mesh)
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    /// Corners of every triangle, in order: what both ways of reading must agree in, however they number vertices.
    fn corners(mesh: &TriMesh) -> Vec<[DVec3; 3]> {
        (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect()
    }

    #[test]
    fn plain_files_give_the_corners_that_the_crates_give() {
        let text =
            b"# made by hand\no body\nv 0 0 0\nv 0.1 1e-1 0\nv -0.25 0 .3\r\nv 1 1 1\nvt 0 0\nvn 0 0 1\ns off\nusemtl none\n\
                     f 1 2 3\nf 1/1 3/1 4/1\n\ng side\nf 1//1 2//1 3//1 4//1\nl 1 2\nf 4/1/1 3/1/1 2/1/1\n";
        let fast = obj(text).expect("it is plain");
        assert_eq!((fast.vertices.len(), fast.triangles.len()), (4, 5));
        assert_eq!(corners(&fast), corners(&parse::slow_obj(text).unwrap()));
        // Parts of a long file are read side by side.
        let long: String =
            (0..150_000).map(|k| format!("v {} {} {}\n", 0.1 * f64::from(k), k % 7, 1.0 / f64::from(k + 1))).collect();
        let faces: String = (0..100_000).map(|k| format!("f {} {} {}\n", k + 1, k + 2, 150_000 - k)).collect();
        let long = long + &faces;
        assert!(long.len() > 3 * PART);
        assert_eq!(corners(&obj(long.as_bytes()).unwrap()), corners(&parse::slow_obj(long.as_bytes()).unwrap()));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.ply");
        crate::surface::write_ply(&path, &fast).unwrap();
        let bytes = std::fs::read(path).unwrap();
        let again = ply(&bytes);
        assert!(again.is_none_or(|m| corners(&m) == corners(&parse::slow_ply(&bytes).unwrap())));
    }

    #[test]
    fn binary_ply_is_read_with_other_properties_beside_the_coordinates() {
        let head = "ply\nformat binary_little_endian 1.0\ncomment by hand\nelement vertex 4\nproperty uchar red\nproperty float x\nproperty double y\n\
                    property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
        let mut bytes = head.as_bytes().to_vec();
        for k in 0..4u8 {
            bytes.push(k);
            bytes.extend(f32::from(k).to_le_bytes());
            bytes.extend((0.1 * f64::from(k * k)).to_le_bytes());
            bytes.extend((0.3f32 * f32::from(k % 2)).to_le_bytes());
        }
        bytes.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
        bytes.extend([4, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]);
        let fast = ply(&bytes).expect("it is plain");
        assert_eq!(corners(&fast), corners(&parse::slow_ply(&bytes).unwrap()));
        assert_eq!(fast.triangles.len(), 3);
        // Cut short, or with a corner that is not there: the crate says what is wrong.
        assert!(ply(&bytes[..bytes.len() - 1]).is_none());
        let last = bytes.len() - 4;
        bytes[last] = 9;
        assert!(ply(&bytes).is_none());
        for k in 0..bytes.len() {
            let mut b = bytes.clone();
            b[k] = b[k].wrapping_mul(31).wrapping_add(7);
            let _ = (ply(&b), ply(&b[..k]), obj(&b));
        }
    }

    #[test]
    fn what_is_unusual_is_left_alone() {
        for text in [
            "v 0 0\n",
            "v 0 0 x\n",
            "f -1 -2 -3\n",
            "f 0 1 2\n",
            "f 1 2 9\n",
            "curv 1\n",
            "v 0 0 0 \\\n1\n",
            "f 1 2 99999999999\n",
        ] {
            assert!(obj(format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{text}").as_bytes()).is_none(), "{text}");
        }
    }
}
