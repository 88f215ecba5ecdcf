//! Shapes filled with tetrahedra: angles, volume, one part, and the same again.

use super::*;
use crate::scene::Analytic;
use crate::shape::{MeshShape, Placed};
use glam::DAffine3;

/// Name, shape, volume [m³] and thickness [m].
fn shapes() -> Vec<(&'static str, Box<dyn Shape>, f64, f64)> {
    let pi = std::f64::consts::PI;
    let axis = DVec3::new(0.3, 1.0, -0.4);
    let placed = |a: Analytic| Placed::new(a, DAffine3::from_rotation_x(0.7));
    let torus = placed(Analytic::Torus { major: 0.07, minor: 0.03, center: DVec3::ONE, axis });
    let tube = MeshShape::new(placed(Analytic::Cylinder { radius: 0.03, height: 0.1, center: DVec3::ZERO, axis }).surface(0.005));
    let block = Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.1, 0.033, 0.02) };
    vec![
        ("ball", Box::new(placed(Analytic::Ball { radius: 0.1, center: DVec3::ZERO })), 4.0 / 3.0 * pi * 1e-3, 0.2),
        ("torus", Box::new(torus), 2.0 * pi * pi * 0.07 * 9e-4, 0.06),
        // Turned, so that its faces meet no face of the lattice.
        ("box", Box::new(placed(block)), 6.6e-5, 0.02),
        ("mesh", Box::new(tube), pi * 9e-5, 0.06),
    ]
}

#[test]
fn angles_stay_within_the_bounds_of_the_method() {
    for (name, shape, volume, thickness) in shapes() {
        for through in [2.0, 5.0] {
            let edge = thickness / through;
            let mut mesh = stuff(shape.as_ref(), edge).unwrap_or_else(|e| panic!("{name}: {e}"));
            let (least, most) = mesh.worst_dihedral_angles();
            assert!(least > 10.7 && most < 164.8, "{name}, {edge} m: {least}° to {most}°");
            // Chords cut off a part that goes with the square of the edge, and edges are rounded.
            let kept = mesh.keep_volume(volume);
            assert!(kept.error < 0.0 && kept.error > -1.5 / (through * through), "{name}, {edge} m: {kept:?}");
            assert!((mesh.volume() / volume - 1.0).abs() < 1e-9, "{name}, {edge} m: {} m³", mesh.volume());
            assert!(kept.moved > 0.0 && kept.moved < 0.2 * edge, "{name}: {kept:?}");
            // It is a body, and nothing of it deserves a word.
            let checked = mesh.clone().with_warnings().unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(checked.warnings.is_empty() && checked.mesh == mesh, "{name}: {:?}", checked.warnings);
        }
    }
}

#[test]
fn a_box_of_whole_cubes_is_met_exactly_and_every_thread_count_gives_the_same() {
    let cube = Analytic::Box { min: DVec3::splat(0.1), max: DVec3::new(0.2, 0.15, 0.15) };
    let shape = Placed::new(cube, DAffine3::IDENTITY);
    let mesh = stuff(&shape, 0.0126).unwrap();
    // Four cubes of 12.5 mm through the short sides: corners and centres, and half of what pokes through each face.
    assert!((mesh.volume() / 2.5e-4 - 1.0).abs() < 1e-12, "{}", mesh.volume());
    let (least, most) = mesh.worst_dihedral_angles();
    assert!((least - 45.0).abs() < 1e-6 && (most - 90.0).abs() < 1e-6, "{least}° to {most}°");
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(one.install(|| stuff(&shape, 0.0126)).unwrap() == mesh);
}

#[test]
fn what_cannot_be_filled_says_what_would_do() {
    let wide = Placed::new(Analytic::Ball { radius: 1.0, center: DVec3::ZERO }, DAffine3::IDENTITY);
    let e = stuff(&wide, 1e-3).unwrap_err().to_string();
    assert!(e.starts_with("0.001 m gives a lattice of 1.6e10 points, at most 1.5e6 are allowed; use 2.31e-2 m or more"), "{e}");
    // Five cubes through the thickness fit, to the digits that are said.
    let plate = |z: f64| Placed::new(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(1.0, 1.0, z) }, DAffine3::IDENTITY);
    let e = stuff(&plate(0.02), 2e-3).unwrap_err().to_string();
    assert!(e.ends_with("use 4.44e-3 m or more"), "{e}");
    assert_eq!(fitted(DVec3::new(1.0, 1.0, 0.02), 4.44e-3), 0.004);
    // A sheet has none.
    let e = stuff(&plate(1e-3), 0.1).unwrap_err().to_string();
    assert!(e.starts_with("tetrahedra are at most as long as the body is thin, 0.001 m: a lattice of 8.0e6 points"), "{e}");
    // Two balls a thin rod apart.
    #[derive(Debug)]
    struct Dumbbell;
    impl Shape for Dumbbell {
        fn signed_distance(&self, p: DVec3) -> f64 {
            let ball = |x: f64| p.distance(DVec3::new(x, 0.011, 0.007)) - 0.05;
            ball(-0.1)
                .min(ball(0.1))
                .min((p - DVec3::new(0.0, 0.011, 0.007)).reject_from(DVec3::X).length().max(p.x.abs() - 0.1) - 0.002)
        }
        fn bounds(&self) -> (DVec3, DVec3) {
            (DVec3::new(-0.15, -0.039, -0.043), DVec3::new(0.15, 0.061, 0.057))
        }
        fn surface(&self, _: f64) -> crate::shape::TriMesh {
            crate::shape::TriMesh::default()
        }
    }
    let e = stuff(&Dumbbell, 0.02).unwrap_err();
    assert!(matches!(e, StuffingError::Torn { lost, .. } if lost > 0.4), "{e}");
}
