//! Shapes, cells and clamps that do not go together.

use super::{plan_fault, scene_fault};
use palpate_io::read_mesh;

#[test]
fn mesh_without_volume() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sheet.obj");
    for (text, wanted) in [
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", "encloses no volume: it is flat"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.2\nf 1 2 3\nf 1 3 4\n", "is open: 4 border edges"),
        // A folded sheet with a front and a back.
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.2\nf 1 2 3\nf 1 3 4\nf 1 3 2\nf 1 4 3\n", "a closed surface is needed"),
    ] {
        std::fs::write(&path, text).unwrap();
        let e = read_mesh(&path).unwrap_err().to_string();
        assert!(e.contains("sheet.obj") && e.contains(wanted), "{e}");
    }
}

#[test]
fn mesh_in_millimetres() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part.obj");
    std::fs::write(&path, "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n").unwrap();
    let e = read_mesh(&path).unwrap_err().to_string();
    assert!(e.contains("longest side is 100 m; in millimetres? convert the file to metres (scale by 0.001)"), "{e}");
}

#[test]
fn cell_size_larger_than_the_object() {
    let e = scene_fault("cell_size = 0.01", "cell_size = 0.2", 5);
    assert!(e.contains("object.cell_size: 0.2 m is larger than the object, whose longest side is 0.1000 m"), "{e}");
}

#[test]
fn clamp_that_touches_nothing() {
    let e = plan_fault("max = [0.0005, 0.04, 0.04]", "max = [-0.005, 0.04, 0.04]", 13);
    assert!(e.contains("clamp.0.box: ") && e.contains("holds no part of the body"), "{e}");
}

#[test]
fn mass_beside_the_body() {
    let e = plan_fault("[time]", "[[mass]]\npoint = [0.5, 0, 0]\nmass = 0.05\n\n[time]", 16);
    assert!(e.contains("mass.0.point: ") && e.contains("away from the body"), "{e}");
}
