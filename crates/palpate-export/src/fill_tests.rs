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
fn a_block_keeps_its_section_and_ends_at_the_clamp() {
    // No side is a whole number of edges.
    let (low, high) = (DVec3::new(0.0, -0.021, -0.017), DVec3::new(0.203, 0.021, 0.017));
    let held = clamp(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(0.0237, 1.0, 1.0));
    let f = fill(&placed(Analytic::Box { min: low, max: high }), &[held], 0.0113).unwrap();
    let volume = (0.203 - 0.0237) * 0.042 * 0.034;
    // Sides are planes of the lattice, so the mesh is exact; the cells that its volume is measured by round off edges by some 1e-4 of it, and the
    // surface is moved by as much.
    assert!((f.mesh.volume() / volume - 1.0).abs() < 2e-4, "{} {volume}", f.mesh.volume());
    assert!(f.kept.moved.abs() < 1e-3 * 0.0113 && (f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{f:?}");
    let near = |x: &DVec3| (x.x - 0.0237).abs() < 1e-3 * 0.0113;
    assert!(!f.held[0].is_empty() && f.held[0].iter().all(|n| near(&f.mesh.nodes[*n as usize])));
    assert_eq!(f.mesh.nodes.iter().filter(|x| near(x)).count(), f.held[0].len(), "every node of the cut is held");
}

#[test]
fn a_clamp_amid_a_body_is_cut_out_of_it() {
    let ball = placed(Analytic::Ball { radius: 0.1, center: DVec3::ZERO });
    let inner = clamp(DVec3::splat(-0.03), DVec3::splat(0.03));
    let f = fill(&ball, &[inner], 0.025).unwrap();
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 1e-3 - 0.06f64.powi(3);
    // Chords of reference cells that are a few millimetres long lose some hundredths of a per cent.
    assert!((f.volume / volume - 1.0).abs() < 2e-3, "{} {volume}", f.volume);
    assert!((f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{f:?}");
    let near = |n: &u32| (f.mesh.nodes[*n as usize].abs().max_element() - 0.03).abs() < 0.2 * 0.025;
    assert!(f.held[0].len() > 20 && f.held[0].iter().all(near), "{} nodes", f.held[0].len());
}

#[test]
fn a_turned_clamp_holds_what_lies_at_its_face() {
    let rod = placed(Analytic::Cylinder { radius: 0.02, height: 0.2, center: DVec3::new(0.1, 0.0, 0.0), axis: DVec3::X });
    let turn = DAffine3::from_rotation_y(0.3);
    let region = ClipBox { to_frame: turn, min: DVec3::new(-1.0, -1.0, -1.0), max: DVec3::new(0.03, 1.0, 1.0) };
    let f = fill(&rod, &[region], 0.01).unwrap();
    assert!((f.mesh.volume() / f.volume - 1.0).abs() < 1e-6, "{f:?}");
    assert!(f.held[0].len() > 10);
    // The surface is moved by a small part of an edge, so that the volume is kept.
    let off = |n: &u32| (turn.transform_point3(f.mesh.nodes[*n as usize]).x - 0.03).abs();
    assert!(f.held[0].iter().all(|n| off(n) <= f.kept.moved.abs() + ON * 0.01), "{:?}", f.kept);
}

#[test]
fn what_cannot_be_filled_says_why() {
    let ball = placed(Analytic::Ball { radius: 0.1, center: DVec3::ZERO });
    let all = clamp(DVec3::splat(-1.0), DVec3::splat(1.0));
    assert_eq!(fill(&ball, &[all], 0.02).unwrap_err().to_string(), "clamps hold the whole body: nothing is left that deforms");
    let fine = fill(&ball, &[], 1e-4).unwrap_err().to_string();
    assert!(fine.starts_with("0.0001 m gives a lattice of 1.6e10 points") && fine.contains("use 2."), "{fine}");
}
