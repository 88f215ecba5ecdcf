//! Shapes that are filled: volume, planes of clamps, and what cannot be filled.

use super::*;
use palpate_model::scene::Analytic;
use palpate_model::shape::Placed;

/// A box of the world.
fn clamp(min: DVec3, max: DVec3) -> ClipBox {
    ClipBox { to_frame: DAffine3::IDENTITY, min, max }
}

fn placed(shape: Analytic) -> Placed {
    Placed::new(shape, DAffine3::IDENTITY)
}

#[test]
fn a_block_keeps_its_section_and_a_clamp_its_face() {
    // No side is a whole number of edges.
    let (low, high) = (DVec3::new(0.0, -0.021, -0.017), DVec3::new(0.203, 0.021, 0.017));
    let held = clamp(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(0.0237, 1.0, 1.0));
    let f = fill(&placed(Analytic::Box { min: low, max: high }), &[held], 0.0113).unwrap();
    let volume = 0.203 * 0.042 * 0.034;
    // Sides are planes of the lattice, so the mesh is exact; the cells that its volume is measured by round off edges by some 1e-4 of it, and the
    // surface is moved by as much.
    assert!((f.mesh.volume() / volume - 1.0).abs() < 2e-4, "{} {volume}", f.mesh.volume());
    assert!(f.kept.moved.abs() < 1e-3 * 0.0113 && (f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{f:?}");
    let x = |n: &u32| f.mesh.nodes[*n as usize].x - 0.0237;
    let plane = f.held[0].iter().filter(|n| x(n).abs() < 1e-3 * 0.0113).count();
    // Four edges by three, all their corners on the plane, and nothing beyond it.
    assert!(plane == 5 * 5 || plane == 5 * 4, "{plane} nodes on the face");
    assert!(f.held[0].iter().all(|n| x(n) < 1e-3 * 0.0113));
}

#[test]
fn a_thin_clamp_at_an_end_holds_its_face_too() {
    let rod = placed(Analytic::Cylinder { radius: 0.02, height: 0.2, center: DVec3::new(0.1, 0.0, 0.0), axis: DVec3::X });
    let region = clamp(DVec3::splat(-1.0), DVec3::new(0.001, 1.0, 1.0));
    let f = fill(&rod, &[region], 0.01).unwrap();
    assert!((f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{:?}", f.kept);
    let at = |place: f64| f.held[0].iter().filter(|n| (f.mesh.nodes[**n as usize].x - place).abs() < 1e-4).count();
    // The rim of the end is rounded, that of the face within the body is not.
    assert!(at(0.001) > at(0.0) && at(0.0) >= 8, "{} {}", at(0.001), at(0.0));
}

#[test]
fn a_turned_clamp_holds_what_lies_in_it() {
    let rod = placed(Analytic::Cylinder { radius: 0.02, height: 0.2, center: DVec3::new(0.1, 0.0, 0.0), axis: DVec3::X });
    let turn = DAffine3::from_rotation_y(0.3);
    let region = ClipBox { to_frame: turn, min: DVec3::splat(-1.0), max: DVec3::new(0.03, 1.0, 1.0) };
    let f = fill(&rod, &[region], 0.01).unwrap();
    assert!((f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{:?}", f.kept);
    let depth = |n: u32| turn.transform_point3(f.mesh.nodes[n as usize]).x - 0.03;
    let slack = f.kept.moved.abs() + ON * 0.01;
    let is_held = |n: u32| f.held[0].binary_search(&n).is_ok();
    assert!((0..f.mesh.nodes.len() as u32).all(|n| if is_held(n) { depth(n) < slack } else { depth(n) > -slack }));
}

#[test]
fn what_cannot_be_filled_says_why() {
    let ball = placed(Analytic::Ball { radius: 0.1, center: DVec3::ZERO });
    let all = clamp(DVec3::splat(-1.0), DVec3::splat(1.0));
    assert_eq!(fill(&ball, &[all], 0.02).unwrap_err().to_string(), "clamps hold the whole body: nothing is left that deforms");
    let fine = fill(&ball, &[], 1e-4).unwrap_err().to_string();
    assert!(fine.starts_with("0.0001 m gives a lattice of 1.6e10 points") && fine.contains("use 2."), "{fine}");
}
