//! Meshes reported on and repaired.

use super::*;
use crate::scene::Analytic;
use crate::shape::{Placed, Shape};
use glam::DAffine3;

fn ball(radius: f64, center: DVec3) -> TriMesh {
    Placed::new(Analytic::Ball { radius, center }, DAffine3::IDENTITY).surface(0.06)
}

fn joined(a: &TriMesh, b: &TriMesh) -> TriMesh {
    let n = a.vertices.len() as u32;
    TriMesh {
        vertices: [a.vertices.clone(), b.vertices.clone()].concat(),
        triangles: a.triangles.iter().copied().chain(b.triangles.iter().map(|t| t.map(|v| v + n))).collect(),
    }
}

#[test]
fn sound_mesh_is_left_alone() {
    let mesh = ball(0.5, DVec3::ONE);
    let report = diagnose(&mesh);
    assert!(report.is_closed() && report.components == 1 && report.holes.is_empty());
    assert_eq!((report.inconsistent_edges, report.intersecting_pairs, report.degenerate_triangles), (0, 0, 0));
    assert_eq!(repair(&mesh), Repaired { mesh, done: vec![], open_edges: 0 });
}

#[test]
fn triangle_soup_flips_and_small_holes_are_repaired() {
    let mesh = ball(0.5, DVec3::ZERO);
    // Every triangle with vertices of its own, rounded to f32; some flipped, one missing with its neighbours, one doubled.
    let mut soup = TriMesh::default();
    for (t, c) in mesh.triangles.iter().enumerate().filter(|(_, c)| !c.contains(&50)) {
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(c.map(|v| mesh.vertices[v as usize].as_vec3().as_dvec3()));
        let n = [first, first + 1, first + 2];
        soup.triangles.push(if t % 3 == 0 { [n[0], n[2], n[1]] } else { n });
    }
    soup.triangles.push(soup.triangles[7]);
    soup.triangles.push([0, 0, 1]);
    assert!(diagnose(&soup).open_edges > 100);
    let Repaired { mesh: fixed, done, open_edges } = repair(&soup);
    let report = diagnose(&fixed);
    assert!(report.is_closed() && report.inconsistent_edges == 0 && report.components == 1, "{report:?}");
    // One of about 1200 fans is flat now.
    assert!((report.signed_volume / mesh.volume() - 1.0).abs() < 0.01, "{report:?}");
    assert_eq!(fixed.triangles.len(), mesh.triangles.len());
    assert_eq!(done.len(), 5, "{done:?}");
    // The rim of the fan that is missing; what the triangles of the soup do not share is not counted.
    assert_eq!(open_edges, mesh.triangles.iter().filter(|c| c.contains(&50)).count());
}

#[test]
fn large_holes_are_reported_and_left() {
    let mut mesh = ball(0.5, DVec3::ZERO);
    let vertices = mesh.vertices.clone();
    mesh.triangles.retain(|t| t.iter().all(|&v| vertices[v as usize].z < 0.3));
    let Repaired { mesh: fixed, done, open_edges } = repair(&mesh);
    assert!(done.is_empty(), "{done:?}");
    let report = diagnose(&fixed);
    assert_eq!(report.holes.len(), 1);
    // The rim is the circle of radius 0.4, zigzagging along triangles.
    assert!(report.holes[0].1 > 2.2 && report.holes[0].1 < 4.0 && report.holes[0].0 == open_edges, "{report:?}");
}

#[test]
fn inside_out_parts_are_turned_and_cavities_kept() {
    let inverted = |m: TriMesh| TriMesh { triangles: m.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..m };
    let (outer, cavity) = (ball(0.5, DVec3::ZERO), inverted(ball(0.2, DVec3::ZERO)));
    let apart = ball(0.3, DVec3::X * 2.0);
    let volume = outer.volume() + cavity.volume() + apart.volume();
    let Repaired { mesh: fixed, done, .. } = repair(&joined(&joined(&inverted(outer.clone()), &cavity), &inverted(apart)));
    assert!((fixed.volume() - volume).abs() < 1e-12, "{} {volume} {done:?}", fixed.volume());
    assert_eq!(diagnose(&fixed).components, 3);
}

#[test]
fn overlapping_parts_are_seen() {
    let report = diagnose(&joined(&ball(0.5, DVec3::ZERO), &ball(0.5, DVec3::X * 0.7)));
    assert!(report.is_closed() && report.components == 2 && report.intersecting_pairs > 20, "{report:?}");
}

#[test]
fn parts_that_overlap_by_faces_edges_or_corners_are_seen() {
    let cube = |at: DVec3| {
        let corner = |k: usize| at + 0.1 * DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriMesh { vertices: (0..8).map(corner).collect(), triangles }
    };
    let one = cube(DVec3::ZERO);
    assert!((one.volume() - 1e-3).abs() < 1e-15 && diagnose(&one).intersecting_pairs == 0);
    for (by, seen) in [
        (DVec3::splat(0.05), true),
        (DVec3::new(0.05, 0.0, 0.0), true),
        (DVec3::new(0.05, 0.05, 0.0), true),
        (DVec3::new(0.03, 0.02, 0.01), true),
        (DVec3::new(0.1, 0.05, 0.0), true),
        (DVec3::new(0.11, 0.0, 0.0), false),
        (DVec3::new(0.1 + 1e-6, 0.0, 0.0), false),
    ] {
        let pairs = diagnose(&joined(&one, &cube(by))).intersecting_pairs;
        assert_eq!(pairs > 0, seen, "{by}: {pairs}");
    }
}
