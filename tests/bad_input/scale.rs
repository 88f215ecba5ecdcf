//! Objects in millimetres in a scene in metres.

use super::{SCENE, changed, folder, refused, scene_fault, write};
use palpate_io::recording::{MarkerSample, RecordedMarkers};
use palpate_io::{Recording, write_recording};
use palpate_model::observation::MarkerRest;
use std::path::{Path, PathBuf};
use support::command::{arg, succeed};

const BOX: &str = "max = [0.1, 0.03, 0.03] } }\ncell_size = 0.01";

/// A box of 40 mm × 12 mm × 12 mm, written as if these were metres.
const MILLIMETRES: &str = "max = [40, 12, 12] } }\ncell_size = 4";

const CLAMP: &str = "[[clamp]]\nbox = { min = [-0.01, -0.01, -0.01], max = [0.0005, 0.04, 0.04] }";

#[test]
fn a_mesh_in_millimetres() {
    let folder = folder();
    let mesh = folder.path().join("part.obj");
    std::fs::write(&mesh, "v 0 0 0\nv 100 0 0\nv 0 100 0\nv 0 0 100\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n").unwrap();
    let text = SCENE.replace("shape = { box = { min = [0, 0, 0], max = [0.1, 0.03, 0.03] } }", "mesh = \"part.obj\"");
    let scene = write(folder.path(), &text);
    let wanted = "its longest side is 100 m; in millimetres? convert the file to metres (scale by 0.001)";
    assert_eq!(refused(&["inspect", arg(&scene)], 2), format!("{}: {wanted}", mesh.display()));
}

#[test]
fn cells_in_metres_of_an_object_in_millimetres() {
    let hint = "; is the object in millimetres or centimetres? convert it to metres (scale by 0.001 or 0.01)";
    let e = scene_fault(BOX, &changed(MILLIMETRES, "cell_size = 4", "cell_size = 0.005"), 5);
    let wanted = "0.005 m makes 8000 cells along the longest side of 40 m, at most 4096 are allowed";
    assert_eq!(e, format!("object.cell_size: {wanted}{hint}"));
    // The clamp of the scene is small enough for eight metres.
    let e = scene_fault(BOX, "max = [8, 2.4, 2.4] } }\ncell_size = 0.01", 5);
    assert!(e.starts_with("object.cell_size: cell size 0.01 m gives a lattice of ") && e.ends_with(hint), "{e}");
}

#[test]
fn a_clamp_a_thousand_times_smaller_than_the_object() {
    let e = scene_fault(BOX, MILLIMETRES, 13);
    assert!(e.starts_with("clamp.0.box: its diagonal is 0.0715 m, the object's longest side is 40.0000 m; "), "{e}");
    assert!(e.ends_with("is the object in millimetres? convert it to metres (scale by 0.001)"), "{e}");
}

#[test]
fn a_plane_through_an_object_that_should_lie_on_it() {
    let folder = folder();
    let scene = |plane: &str| {
        let body = MILLIMETRES.replace("[40, 12, 12]", "[40, 12, 6]");
        let text = changed(&changed(SCENE, BOX, &body), "min = [0, 0, 0]", "min = [0, 0, -6]");
        write(folder.path(), &changed(&text, CLAMP, plane))
    };
    let path = scene("[[plane]]\npoint = [0, 0, -0.006]\nnormal = [0, 0, 1]");
    let e = refused(&["inspect", arg(&path)], 2);
    assert!(e.contains("scene.toml:13: plane.0.point: it cuts the object -0.0060 m from the origin"), "{e}");
    assert!(e.contains("is the object in millimetres?"), "{e}");
    // On the ground, or on a plane through the origin, an object of forty metres is possible: a word is enough.
    for height in [-6.0, 0.0] {
        let path = scene(&format!("[[plane]]\npoint = [0, 0, {height}]\nnormal = [0, 0, 1]"));
        assert!(succeed(&["inspect", arg(&path)]).out.contains("in millimetres? lengths are in metres"));
    }
}

/// A recording of one marker at two places.
fn marker(folder: &Path, places: [glam::DVec3; 2]) -> PathBuf {
    let samples = places.iter().enumerate().map(|(k, p)| MarkerSample { time: 0.05 * k as f64, marker: 0, position: *p });
    let markers = RecordedMarkers {
        file: PathBuf::new(),
        names: vec!["tip".into()],
        samples: samples.collect(),
        noise_sigma: Some(0.001),
        noise_systematic: 0.0,
        rest: vec![MarkerRest { name: "tip".into(), position: places[0], surface: None }],
    };
    let (title, source) = (String::new(), String::new());
    let recording = Recording {
        path: PathBuf::new(),
        title,
        source,
        cameras: vec![],
        frames: vec![],
        clouds: vec![],
        markers: Some(markers),
        points: None,
        displacements: None,
        warnings: vec![],
    };
    let seen = folder.join("seen");
    write_recording(&seen, &recording).unwrap();
    seen
}

#[test]
fn a_recording_a_thousand_times_smaller_than_the_object() {
    let folder = folder();
    let observation = "[observation]\nrecording = \"seen\"\ncost = \"markers\"";
    let path = write(folder.path(), &changed(&changed(SCENE, BOX, MILLIMETRES), CLAMP, observation));
    marker(folder.path(), [glam::DVec3::new(0.04, 0.006, 0.012), glam::DVec3::new(0.04, 0.006, -0.01)]);
    let e = refused(&["inspect", arg(&path)], 2);
    assert!(e.contains("scene.toml:13: observation.recording: all 2 points of the recording lie within 0.0220 m"), "{e}");
    assert!(e.contains("the object's longest side is 40.0000 m; is the object in millimetres?"), "{e}");
    // The tip of an object of forty metres may be still.
    marker(folder.path(), [glam::DVec3::new(40.0, 6.0, 6.0), glam::DVec3::new(40.0, 6.0, 6.0)]);
    succeed(&["inspect", arg(&path)]);
}

#[test]
fn objects_of_some_metres_are_possible_and_get_a_word() {
    let folder = folder();
    // A rope held at its end: long, thin, and with a clamp that is small against its length.
    let rope = changed(SCENE, BOX, "max = [5, 0.04, 0.04] } }\ncell_size = 0.04");
    let path = write(folder.path(), &rope);
    let told = succeed(&["inspect", arg(&path)]).out;
    let line = told.lines().find(|l| l.contains("warning: ")).unwrap_or_else(|| panic!("{told}"));
    // 1070 kg/m³ in 5 m × 4 cm × 4 cm.
    let wanted = "scene.toml:4: object.shape: its longest side is 5.0000 m and its mass 8.56 kg; in millimetres?";
    assert!(line.contains(wanted), "{line}");
    assert_eq!(told.matches("warning: ").count(), 1, "{told}");
}

#[test]
fn an_angle_that_starts_far_from_the_planes_own_gets_a_word() {
    let folder = folder();
    // A slope of 20°, whose azimuth counts from z towards x: 0.349 rad, not the 1.222 rad of its elevation.
    let slope = |start: &str| {
        let plane = "[[plane]]\npoint = [0, 0, -0.1]\nnormal = [0.34202, 0, 0.939693]\n";
        let fit = format!("{plane}[[fit.parameter]]\npath = {start}\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\n");
        write(folder.path(), &changed(SCENE, "[[fit.parameter]]\npath = \"material.youngs_modulus\"\n", &fit))
    };
    let told = |start: &str| succeed(&["inspect", arg(&slope(start))]).out;
    let wrong = told("\"plane.0.phi\"\nstart = 1.222");
    assert!(wrong.contains("plane.0.phi starts 50° from the scene's own normal, of which it is 0.349 rad"), "{wrong}");
    for right in
        ["\"plane.0.phi\"\nstart = 0.3", "\"plane.0.phi\"\nstart = [0.0, 1.5]", "\"plane.0.normal\"\nstart = [0.9, 0, 0.1]"]
    {
        assert!(!told(right).contains("own normal"), "{right}");
    }
}
