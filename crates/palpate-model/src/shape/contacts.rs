//! Where a mesh touches or pierces itself: pairs of triangles whose boxes are close, found by a descent through the tree with itself.

use super::TriMesh;
use super::mesh::{MeshShape, closest_on_triangle};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Distance at which a segment touches a triangle, over their size: rounding of coordinates in f64.
const TOUCHING: f64 = 1e-9;

fn shares_vertex(mesh: &TriMesh, s: usize, t: usize) -> bool {
    mesh.triangles[s].iter().any(|v| mesh.triangles[t].contains(v))
}

/// Number of pairs of triangles without common vertex of which an edge of one meets the other. `tree` holds the same mesh.
pub(super) fn intersecting_pairs(mesh: &TriMesh, tree: &MeshShape) -> usize {
    let pierces = |s: usize, t: usize| {
        let ([a, b, c], other) = (mesh.corners(s), mesh.corners(t));
        [(a, b), (b, c), (c, a)].iter().any(|&(p, q)| meets(p, q, other))
    };
    let count = |s: usize, t: usize| usize::from(!shares_vertex(mesh, s, t) && (pierces(s, t) || pierces(t, s)));
    tree.count_close(TOUCHING * mesh.size(), &count)
}

/// True if a vertex lies within `tolerance` [m] of a triangle that it is no corner of.
pub(super) fn touches_itself(mesh: &TriMesh, tree: &MeshShape, tolerance: f64) -> bool {
    // Whoever finds one first: the answer is the same.
    let found = AtomicBool::new(false);
    let near = |s: usize, t: usize| {
        let corners = mesh.corners(t);
        let (lo, hi) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        mesh.triangles[s].iter().filter(|v| !mesh.triangles[t].contains(v)).any(|&v| {
            let p = mesh.vertices[v as usize];
            (p.clamp(lo, hi) - p).length_squared() <= tolerance * tolerance
                && closest_on_triangle(p, corners).0.distance(p) <= tolerance
        })
    };
    let look = |s: usize, t: usize| {
        if !found.load(Ordering::Relaxed) && (near(s, t) || near(t, s)) {
            found.store(true, Ordering::Relaxed);
        }
        0
    };
    tree.count_close(tolerance, &look);
    found.into_inner()
}

/// True if the segment meets the triangle, its edges and its plane included: bodies that overlap by whole faces, or by corners that
/// lie on the diagonal of a face, pierce nothing strictly.
fn meets(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    let size = normal.length();
    if size == 0.0 {
        return false;
    }
    let near = TOUCHING * (q - p).length().max((b - a).length()).max((c - a).length());
    let (above, below) = (normal.dot(p - a) / size, normal.dot(q - a) / size);
    let inside = |x: DVec3| {
        [(a, b), (b, c), (c, a)].iter().all(|&(s, e)| (e - s).cross(x - s).dot(normal) >= -near * size * (e - s).length())
    };
    if above.abs() > near || below.abs() > near {
        // A segment that only ends in the plane meets it as well.
        return above.min(below) <= near
            && above.max(below) >= -near
            && inside(p + (q - p) * (above / (above - below)).clamp(0.0, 1.0));
    }
    // In the plane of the triangle: an end inside, or an edge crossed.
    let crosses = |&(s, e): &(DVec3, DVec3)| {
        let side = |x: DVec3, from: DVec3, to: DVec3| (to - from).cross(x - from).dot(normal);
        side(p, s, e) * side(q, s, e) < 0.0 && side(s, p, q) * side(e, p, q) < 0.0
    };
    inside(p) || inside(q) || [(a, b), (b, c), (c, a)].iter().any(crosses)
}
