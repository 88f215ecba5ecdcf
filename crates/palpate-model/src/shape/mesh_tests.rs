//! Signed distance to meshes.

use super::*;
use crate::scene::Analytic;
use crate::shape::Placed;
use glam::DAffine3;

fn points(n: usize, size: f64) -> impl Iterator<Item = DVec3> {
    (0..n).map(move |i| {
        let t = i as f64;
        DVec3::new((t * 0.618_034).fract() - 0.5, (t * 0.754_877).fract() - 0.5, (t * 0.569_84).fract() - 0.5) * size
    })
}

fn torus() -> (Placed, TriMesh) {
    let axis = DVec3::new(0.2, 0.3, 1.0);
    let exact = Placed::new(Analytic::Torus { major: 0.5, minor: 0.2, center: DVec3::ZERO, axis }, DAffine3::IDENTITY);
    let mesh = exact.surface(0.03);
    (exact, mesh)
}

#[test]
fn distance_agrees_with_brute_force_and_the_exact_shape() {
    let (exact, mesh) = torus();
    let shape = MeshShape::new(mesh.clone());
    for p in points(300, 1.6) {
        let brute = (0..mesh.triangles.len())
            .map(|t| closest_on_triangle(p, mesh.corners(t)).0.distance(p))
            .fold(f64::INFINITY, f64::min);
        let d = shape.signed_distance(p);
        assert_eq!(d.abs(), brute);
        // Chords of 0.03 on a radius of 0.2 lie up to 0.0009 inside.
        assert!((d - exact.signed_distance(p)).abs() < 1e-3, "{p}: {d}");
        let (q, t) = shape.closest(p).unwrap();
        assert!((closest_on_triangle(p, mesh.corners(t)).0 - q).length() < 1e-15);
    }
}

#[test]
fn winding_number_by_clusters_agrees_with_the_sum() {
    let (_, mesh) = torus();
    let shape = MeshShape::new(mesh.clone());
    for p in points(200, 1.6) {
        let sum: f64 = (0..mesh.triangles.len()).map(|t| solid_angle(p, mesh.corners(t))).sum::<f64>() / (4.0 * PI);
        assert!((sum - sum.round()).abs() < 1e-10, "a closed mesh winds a whole number of times: {sum}");
        // Far clusters count as dipoles; a tenth is far from deciding the other way.
        assert!((shape.winding_number(p) - sum).abs() < 0.1, "{p}: {sum} {}", shape.winding_number(p));
    }
}

#[test]
fn sign_survives_holes_and_overlaps() {
    let (exact, mut mesh) = torus();
    let all = mesh.triangles.len();
    // A hole a tenth of the tube wide, and a second copy shifted along x.
    let vertices = mesh.vertices.clone();
    let rim = vertices[0];
    mesh.triangles.retain(|t| t.iter().any(|&v| vertices[v as usize].distance(rim) > 0.03));
    assert!(mesh.triangles.len() < all);
    let shift = DVec3::X * 0.1;
    let n = mesh.vertices.len() as u32;
    mesh.vertices.extend(vertices.iter().map(|&v| v + shift));
    mesh.triangles.extend(mesh.triangles.clone().into_iter().map(|t| t.map(|v| v + n)));
    let shape = MeshShape::new(mesh);
    for p in points(500, 1.6).filter(|p| p.distance(rim) > 0.1 && p.distance(rim + shift) > 0.1) {
        let union = exact.signed_distance(p).min(exact.signed_distance(p - shift));
        if union.abs() > 2e-3 {
            assert_eq!(shape.signed_distance(p) < 0.0, union < 0.0, "{p}: {union}");
        }
    }
}

#[test]
fn mesh_measures_follow_the_exact_shape() {
    let (_, mesh) = torus();
    assert!(mesh.centroid().length() < 1e-12);
    let moved = mesh.transformed(&DAffine3::from_translation(DVec3::X));
    assert!((moved.centroid() - DVec3::X).length() < 1e-12 && (moved.volume() - mesh.volume()).abs() < 1e-12);
    let mirrored = mesh.transformed(&DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    assert!((mirrored.volume() - mesh.volume()).abs() < 1e-12, "mirroring keeps the outside outside");
    assert_eq!(mesh.edges().len(), mesh.triangles.len() * 3 / 2);
    let fine = mesh.refined(0.011);
    let (volume, area) = (fine.volume() / mesh.volume() - 1.0, fine.area() / mesh.area() - 1.0);
    // Rounding of sums over 10⁵ triangles.
    assert!(volume.abs() < 1e-10 && area.abs() < 1e-10, "{volume} {area}");
    assert!(fine.edges().iter().all(|&[a, b]| fine.vertices[a as usize].distance(fine.vertices[b as usize]) <= 0.011));
}

#[test]
fn clean_meshes_take_their_sign_from_normals_and_others_do_not() {
    let (_, mesh) = torus();
    // Sharp edges and corners, where a face normal alone would err.
    let sharp = Placed::new(Analytic::Box { min: DVec3::splat(-0.3), max: DVec3::new(0.4, 0.3, 0.1) }, DAffine3::IDENTITY);
    for mesh in [mesh.clone(), sharp.surface(0.2)] {
        let (clean, winding) = (MeshShape::new(mesh.clone()), MeshShape::unsigned(mesh));
        assert!(clean.normals.is_some() && winding.normals.is_none());
        for p in points(2000, 1.2) {
            assert_eq!(clean.signed_distance(p), winding.signed_distance(p), "{p}");
        }
    }
    // Two boxes back to back, sharing a wall, edges or vertices of it doubled: only winding numbers see the inside.
    let (left, right) = (sharp.surface(0.2), sharp.surface(0.2).transformed(&DAffine3::from_translation(DVec3::X * 0.7)));
    let n = left.vertices.len() as u32;
    let both = TriMesh {
        vertices: [left.vertices, right.vertices].concat(),
        triangles: left.triangles.iter().copied().chain(right.triangles.iter().map(|t| t.map(|v| v + n))).collect(),
    };
    let shape = MeshShape::new(both);
    assert!(shape.normals.is_none());
    assert!([0.39, 0.41].into_iter().all(|x| shape.signed_distance(DVec3::new(x, 0.01, 0.02)) < 0.0));
}
