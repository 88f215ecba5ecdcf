//! Every recording is read, and lies where its body is.

use palpate_io::{Recording, check_overlap, read_mesh, read_recording, read_sdf};
use palpate_model::observation::MarkerRest;
use palpate_model::observation::ReadingKind;

use palpate_model::shape::Shape;
use std::path::Path;
use support::data::data_dir;
use support::measured::compared;

fn read(data: &Path, name: &str) -> Recording {
    let r = read_recording(data.join(name)).unwrap_or_else(|e| panic!("{e}"));
    assert!(r.warnings.is_empty(), "{name}: {:?}", r.warnings);
    r
}

/// Volume [m³] and bounding box of a recording's mesh, which must need no repair.
fn check_mesh(data: &Path, name: &str, volume: f64, tolerance: f64) -> (glam::DVec3, glam::DVec3) {
    let mesh = read_mesh(data.join(name).join("object.obj")).unwrap_or_else(|e| panic!("{e}"));
    assert!(mesh.warnings.is_empty(), "{name}: {:?}", mesh.warnings);
    let found = mesh.value.volume();
    assert!((found / volume - 1.0).abs() < tolerance, "{name}: {found}");
    mesh.value.bounds()
}

#[test]
fn motion_capture_of_a_beam() {
    let Some(data) = data_dir() else { return };
    for (name, times) in [("beam-mocap-gravity-a", 429), ("beam-mocap-load52-a", 556)] {
        let r = read(&data, name);
        let mut warnings = Vec::new();
        let (o, rest) = r.observation(&compared(ReadingKind::Marker), &mut warnings).unwrap();
        assert_eq!((o.frames.len(), rest.len(), warnings.len()), (times, 3, 0), "{name}");
        assert_eq!((o.noise(ReadingKind::Marker), o.systematic(ReadingKind::Marker)), (0.0003, 0.0008));
        let (min, max) = check_mesh(&data, name, 9e-5, 1e-9);
        check_overlap(&o, min, max).unwrap();
    }
}

#[test]
fn depth_of_hanging_cantilevers() {
    let Some(data) = data_dir() else { return };
    for name in ["cantilever-ecoflex-hanging", "cantilever-two-materials-hanging"] {
        for file in ["recording.toml", "recording-corrected.toml"] {
            let r = read(&data, &format!("{name}/{file}"));
            let (o, _) = r.observation(&compared(ReadingKind::Depth), &mut Vec::new()).unwrap();
            assert_eq!((o.frames.len(), o.noise(ReadingKind::Depth)), (1, 0.001));
            assert!(o.frames[0].points.len() > 5000, "{name}: {} points", o.frames[0].points.len());
            // The stated 234 cm³.
            let (min, max) = check_mesh(&data, name, 234e-6, 5e-3);
            check_overlap(&o, min, max).unwrap();
        }
    }
}

#[test]
fn silhouettes_and_derived_points_of_an_oscillating_cantilever() {
    let Some(data) = data_dir() else { return };
    let name = "cantilever-moldstar-oscillating";
    let silhouettes = read(&data, &format!("{name}/silhouettes.toml"));
    assert_eq!(silhouettes.frames.len(), 18);
    assert!(silhouettes.frames.iter().all(|f| f.depth.is_none() && f.mask.is_some()));
    assert!(silhouettes.observation(&compared(ReadingKind::Depth), &mut Vec::new()).is_err(), "a silhouette has no points");

    let r = read(&data, name);
    let mut spec = compared(ReadingKind::Marker);
    let e = r.observation(&spec, &mut Vec::new()).unwrap_err().to_string();
    assert!(e.contains("no rest position for head_outer_top") && e.contains("[[observation.marker]]"), "{e}");
    // The recording's description places them on the front face z = 15 mm.
    let places = [
        ("head_outer_top", -0.1, 0.03),
        ("head_outer_bottom", -0.1, -0.03),
        ("head_inner_top", -0.07, 0.03),
        ("head_inner_bottom", -0.07, -0.03),
        ("axis_m070", -0.07, 0.0),
        ("axis_m035", -0.035, 0.0),
        ("axis_000", 0.0, 0.0),
        ("axis_p035", 0.035, 0.0),
    ];
    let rest =
        |(name, x, y): (&str, f64, f64)| MarkerRest { name: name.into(), position: glam::DVec3::new(x, y, 0.015), surface: None };
    spec.markers = places.map(rest).to_vec();
    let (o, rest) = r.observation(&spec, &mut Vec::new()).unwrap();
    assert_eq!((o.frames.len(), rest.len()), (18, 8));
    let (min, max) = check_mesh(&data, name, 234e-6, 5e-3);
    check_overlap(&o, min, max).unwrap();
}

#[test]
fn dragon_of_the_benchmark() {
    let Some(data) = data_dir() else { return };
    let dragon = read_sdf(data.join("dragon-sdf/dragon.sdf"), 0.06).unwrap().snapped();
    assert_eq!(dragon.size, [17, 23, 36]);
    // Sparse Surface Constraints, Table 2: 1562 elements, 2489 active nodes, 11 587 other nodes.
    let cells = dragon.active_cells();
    assert_eq!(cells.len(), 1562);
    let mut nodes: Vec<[usize; 3]> =
        cells.iter().flat_map(|c| (0..8).map(move |n| [c[0] + (n & 1), c[1] + (n >> 1 & 1), c[2] + (n >> 2)])).collect();
    nodes.sort_unstable();
    nodes.dedup();
    assert_eq!((nodes.len(), 17 * 23 * 36 - nodes.len()), (2489, 11_587));
    let (min, max) = dragon.bounds();
    // Five units of 6 cm.
    assert!(((max - min).max_element() - 0.3).abs() < 2.0 * dragon.h, "{min} {max}");
    assert!(dragon.surface(dragon.h).volume() > 0.0);
}
