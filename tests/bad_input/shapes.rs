//! Shapes, cells and clamps that do not go together.

use super::{SCENE, after_place, changed, folder, refused, scene_fault, write};
use support::command::arg;

const SHAPE: &str = "shape = { box = { min = [0, 0, 0], max = [0.1, 0.03, 0.03] } }";

#[test]
fn mesh_without_volume() {
    let folder = folder();
    let mesh = folder.path().join("sheet.obj");
    let scene = write(folder.path(), &changed(SCENE, SHAPE, "mesh = \"sheet.obj\""));
    for (text, wanted) in [
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", "encloses no volume: it is flat"),
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.2\nf 1 2 3\nf 1 3 4\n", "is open: 4 border edges"),
        // A folded sheet with a front and a back.
        ("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.2\nf 1 2 3\nf 1 3 4\nf 1 3 2\nf 1 4 3\n", "a closed surface is needed"),
    ] {
        std::fs::write(&mesh, text).unwrap();
        let e = refused(&["inspect", arg(&scene)], 2);
        assert!(e.starts_with(&format!("{}: ", mesh.display())) && e.contains(wanted), "{e}");
    }
}

#[test]
fn files_that_are_not_there() {
    let folder = folder();
    let place = |name: &str| folder.path().join(name).display().to_string();
    let seen = "[observation]\ncost = \"markers\"\nrecording = \"lost\"\n\n[time]";
    for (from, to, line, wanted) in [
        (SHAPE, "mesh = \"lost.obj\"", 4, format!("object.mesh: there is no file {}", place("lost.obj"))),
        (SHAPE, "mesh = \"\"", 4, "object.mesh: is empty; expected a path, relative to the folder of this file".into()),
        ("[time]", "motion = \"lost.csv\"\n\n[time]", 15, format!("clamp.0.motion: there is no file {}", place("lost.csv"))),
        ("[time]", seen, 17, format!("observation.recording: there is no recording at {}", place("lost"))),
        (
            "[time]",
            &seen.replace("lost", ""),
            17,
            "observation.recording: is empty; expected a path, relative to the folder of this file".into(),
        ),
    ] {
        let scene = write(folder.path(), &changed(SCENE, from, to));
        let e = refused(&["fit", arg(&scene), "--out", &place("out")], 2);
        assert_eq!(after_place(&e, &scene, line), wanted);
    }
    // A folder, but no recording in it.
    let scene = write(folder.path(), &changed(SCENE, "[time]", &seen.replace("\"lost\"", "\".\"")));
    let e = refused(&["fit", arg(&scene), "--out", &place("out")], 2);
    assert!(after_place(&e, &scene, 17).ends_with("recording.toml"), "{e}");
}

#[test]
fn cell_size_larger_than_the_object() {
    let e = scene_fault("cell_size = 0.01", "cell_size = 0.2", 5);
    assert_eq!(e, "object.cell_size: 0.2 m is larger than the object, whose longest side is 0.1000 m");
}

#[test]
fn more_cells_than_can_be_had() {
    let e = scene_fault("cell_size = 0.01", "cells = 4000", 5);
    assert!(e.starts_with("object.cells: "), "{e}");
    // 300 × 90 × 90 cells fit on a lattice, but not into most machines: 2.7 kB each while they are cut, as `room` measures.
    let e = scene_fault("cell_size = 0.01", "cells = 300", 5);
    assert!(
        e.starts_with("object.cells: ") && e.contains("2.4e6 cells, which take 6.6 GB") && e.contains("4.57e-4 m or more"),
        "{e}"
    );
}

#[test]
fn clamp_that_touches_nothing() {
    let e = scene_fault("max = [0.0005, 0.04, 0.04]", "max = [-0.005, 0.04, 0.04]", 13);
    assert!(e.starts_with("clamp.0.box: ") && e.contains("holds no part of the body"), "{e}");
}

#[test]
fn mass_beside_the_body() {
    let e = scene_fault("[time]", "[[mass]]\npoint = [0.5, 0, 0]\nmass = 0.05\n\n[time]", 16);
    assert!(e.starts_with("mass.0.point: ") && e.contains("away from the body"), "{e}");
}

#[test]
fn a_scene_given_as_text_has_lines_too() {
    let text = changed(SCENE, "max = [0.0005, 0.04, 0.04]", "max = [-0.005, 0.04, 0.04]");
    let e = palpate::Experiment::from_toml(&text, "nowhere/scene.toml").unwrap_err();
    assert!(e.exit_code() == 2 && e.to_string().starts_with("nowhere/scene.toml:13: clamp.0.box: "), "{e}");
}
