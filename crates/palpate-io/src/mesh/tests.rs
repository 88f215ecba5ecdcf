//! Mesh files read, and refused with what is wrong.

use super::*;
use crate::surface::{write_obj, write_ply};
use tempfile::TempDir;

const QUADS: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// A box; every side is divided into n × n squares of two triangles.
fn cuboid(size: DVec3, n: u32) -> TriMesh {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * size;
    let mut mesh = TriMesh::default();
    for q in QUADS {
        let [a, b, _, d] = q.map(corner);
        let base = mesh.vertices.len() as u32;
        let f = |i: u32| f64::from(i) / f64::from(n);
        mesh.vertices
            .extend((0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| a + (b - a) * f(i) + (d - a) * f(j)));
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let v = base + i + j * (n + 1);
            mesh.triangles.extend([[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]);
        }
    }
    mesh
}

fn unit() -> TriMesh {
    merge(cuboid(DVec3::new(0.1, 0.2, 0.3), 5))
}

fn read(folder: &TempDir, name: &str, bytes: &[u8]) -> Result<Loaded<TriMesh>, InputError> {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read_mesh(path)
}

fn read_back(mesh: &TriMesh) -> Result<Loaded<TriMesh>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.obj");
    write_obj(&path, mesh).unwrap();
    read_mesh(&path).map_err(|e| e.to_string())
}

#[test]
fn obj_and_ply_give_the_same_mesh_back() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = unit();
    assert!((mesh.volume() - 0.006).abs() < 1e-15, "the test's box faces outward");
    for name in ["m.obj", "m.PLY"] {
        let path = folder.path().join(name);
        if name == "m.obj" { write_obj(&path, &mesh) } else { write_ply(&path, &mesh) }.unwrap();
        let back = read_mesh(&path).unwrap();
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
        assert_eq!(back.value.volume(), mesh.volume(), "{name}");
        assert_eq!((back.value.vertices.len(), back.value.triangles.len()), (mesh.vertices.len(), mesh.triangles.len()));
    }
}

#[test]
fn stl_corners_are_merged_in_text_and_binary() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = unit();
    let mut text = "solid box\n".to_string();
    let mut binary = b"solid but binary".to_vec();
    binary.resize(80, 0);
    binary.extend((mesh.triangles.len() as u32).to_le_bytes());
    for t in 0..mesh.triangles.len() {
        text += "facet normal 0 0 0\nouter loop\n";
        binary.extend([0; 12]);
        for p in mesh.corners(t) {
            text += &format!("vertex {} {} {}\n", p.x, p.y, p.z);
            p.to_array().iter().for_each(|x| binary.extend((*x as f32).to_le_bytes()));
        }
        text += "endloop\nendfacet\n";
        binary.extend([0; 2]);
    }
    text += "endsolid box\n";
    for bytes in [text.as_bytes(), &binary] {
        let back = read(&folder, "m.stl", bytes).unwrap();
        assert_eq!(back.value.vertices.len(), mesh.vertices.len());
        // Single precision in the file.
        assert!((back.value.volume() / 0.006 - 1.0).abs() < 1e-6 && back.warnings.is_empty());
    }
    assert!(read(&folder, "m.stl", &binary[..500]).unwrap_err().to_string().contains("not a readable STL file"));
}

#[test]
fn polygons_are_split() {
    let folder = tempfile::tempdir().unwrap();
    let mut obj = String::new();
    for i in 0..8 {
        obj += &format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
    }
    for q in QUADS {
        obj += &format!("f {} {} {} {}\n", q[0] + 1, q[1] + 1, q[2] + 1, q[3] + 1);
    }
    let m = read(&folder, "m.obj", obj.as_bytes()).unwrap();
    assert_eq!((m.value.triangles.len(), m.value.volume()), (12, 1.0));
    assert!(read(&folder, "m.obj", b"v 0 0 x\n").unwrap_err().to_string().contains("not a readable OBJ file"));
    assert!(read(&folder, "m.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap_err().to_string().contains("not finite"));
    assert!(read(&folder, "m.obj", b"v 0 0 0\nf 1 2 3\n").is_err());
    assert!(read(&folder, "m.step", b"").unwrap_err().to_string().contains("allowed: .obj, .ply, .stl"));
    assert!(
        read(&folder, "m.ply", b"ply\nformat ascii 1.0\nelement ver").unwrap_err().to_string().contains("not a readable PLY")
    );
}

#[test]
fn inward_and_mixed_faces_are_turned_with_a_warning() {
    let mut m = unit();
    m.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let r = read_back(&m).unwrap();
    assert!((r.value.volume() - 0.006).abs() < 1e-15);
    assert!(
        r.warnings.len() == 1 && r.warnings[0].contains("turned inside-out parts outward, triangles: 300"),
        "{:?}",
        r.warnings
    );
    let mut m = unit();
    for t in [7, 20, 21] {
        m.triangles[t].swap(0, 1);
    }
    let r = read_back(&m).unwrap();
    assert!((r.value.volume() - 0.006).abs() < 1e-15);
    assert!(r.warnings[0].contains("turned triangles to agree with their neighbours: 3"), "{:?}", r.warnings);
}

#[test]
fn small_holes_and_cracks_are_closed_and_large_holes_refused() {
    let mut m = cuboid(DVec3::splat(0.1), 20);
    m.triangles.remove(0);
    let r = read_back(&m).unwrap();
    assert!((r.value.volume() - 1e-3).abs() < 1e-15, "a missing piece of a flat side changes nothing once filled");
    assert!(r.warnings[0].contains("closed small holes: 1"), "{:?}", r.warnings);
    let mut m = cuboid(DVec3::splat(0.1), 4);
    m.triangles.drain(..32);
    let e = read_back(&m).unwrap_err();
    assert!(e.contains("is open: 16 border edges, the largest hole has 16 of them and a rim of 0.4000 m"), "{e}");
    let mut m = cuboid(DVec3::splat(0.1), 4);
    m.vertices.iter_mut().take(25).for_each(|v| v.z += 1e-8);
    let r = read_back(&m).unwrap();
    assert!((r.value.volume() - 1e-3).abs() < 1e-9 && r.warnings[0].contains("joined vertices"), "{:?}", r.warnings);
}

#[test]
fn cavities_stay_and_overlaps_are_told() {
    let join = |mut inner: TriMesh, inward: bool| {
        let mut m = cuboid(DVec3::splat(0.1), 2);
        inner.vertices.iter_mut().for_each(|v| *v += 0.03);
        if inward {
            inner.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        }
        let base = m.vertices.len() as u32;
        m.vertices.extend(inner.vertices);
        m.triangles.extend(inner.triangles.iter().map(|t| t.map(|v| v + base)));
        read_back(&m).unwrap()
    };
    let r = join(cuboid(DVec3::splat(0.04), 2), true);
    assert!((r.value.volume() - (1e-3 - 6.4e-5)).abs() < 1e-12 && r.warnings.is_empty(), "{:?}", r.warnings);
    // Twice as far out as the inner box reached: it sticks out of the outer one.
    let r = join(cuboid(DVec3::splat(0.09), 2), false);
    assert!(r.warnings.iter().any(|w| w.contains("touches or passes through itself") && w.contains("union")), "{:?}", r.warnings);
}

#[test]
fn what_is_no_solid_is_refused() {
    let flat = TriMesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2], [0, 2, 1]] };
    assert!(read_back(&flat).unwrap_err().contains("encloses no volume: it is flat"));
    let e = read_back(&cuboid(DVec3::splat(100.0), 1)).unwrap_err();
    assert!(e.contains("longest side is 100 m; in millimetres? convert the file to metres (scale by 0.001)"), "{e}");
    assert!(read_back(&cuboid(DVec3::splat(1e-5), 1)).unwrap_err().contains("lengths are in metres"));
    assert!(read_back(&TriMesh::default()).unwrap_err().contains("no triangle"));
}

#[test]
fn a_one_sided_surface_is_refused() {
    // The projective plane on six vertices: closed, every edge between two triangles, no inside.
    let faces = [[1, 2, 3], [1, 3, 4], [1, 4, 5], [1, 5, 6], [1, 2, 6], [2, 3, 5], [3, 4, 6], [2, 4, 5], [3, 5, 6], [2, 4, 6]];
    let at = |i: i32| DVec3::new(f64::from(i * i % 7), f64::from(i), f64::from(i % 3)) * 0.1;
    let plane = TriMesh { vertices: (1..7).map(at).collect(), triangles: faces.map(|t: [u32; 3]| t.map(|v| v - 1)).to_vec() };
    assert!(read_back(&plane).unwrap_err().contains("one-sided"));
}

#[test]
fn solids_that_share_an_edge_are_kept_as_they_are() {
    let mut m = cuboid(DVec3::splat(0.1), 1);
    let other = cuboid(DVec3::splat(0.1), 1);
    let base = m.vertices.len() as u32;
    m.vertices.extend(other.vertices.iter().map(|v| *v + DVec3::new(0.1, 0.1, 0.0)));
    m.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + base)));
    let r = read_back(&m).unwrap();
    assert!((r.value.volume() - 2e-3).abs() < 1e-12);
    assert!(r.warnings.len() == 1 && r.warnings[0].contains("touches itself along 1 edges"), "{:?}", r.warnings);
}
