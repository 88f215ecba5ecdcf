//! Where a mesh touches or pierces itself: pairs of triangles whose boxes are close, found by a descent through the tree with itself.

use super::TriMesh;
use super::mesh::{MeshShape, closest_on_triangle};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Distance at which a segment touches a triangle, over their size: rounding of coordinates in f64.
const TOUCHING: f64 = 1e-9;

/// What a mesh does to itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Contacts {
    /// Pairs of triangles without common vertex of which an edge of one meets the other.
    pub pairs: usize,
    /// True if a vertex lies within a tolerance of a triangle that it is no corner of.
    pub touches: bool,
}

/// Looks at all pairs of triangles that are close to each other; `tolerance` [m] of touching is more than rounding. `tree` holds the same mesh.
pub(super) fn contacts(mesh: &TriMesh, tree: &MeshShape, tolerance: f64) -> Contacts {
    // Whoever finds one first: the answer is the same.
    let found = AtomicBool::new(false);
    let size = mesh.size();
    let look = |s: usize, t: usize| {
        let ((a, of_a), (b, of_b)) = (tree.triangle(s), tree.triangle(t));
        if !found.load(Ordering::Relaxed) && (near(a, of_a, b, of_b, tolerance) || near(b, of_b, a, of_a, tolerance)) {
            found.store(true, Ordering::Relaxed);
        }
        let shared = of_a.iter().any(|v| of_b.contains(v));
        usize::from(!shared && (pierces(a, b) || pierces(b, a)))
    };
    let pairs = tree.count_close(tolerance.max(TOUCHING * size), &look);
    Contacts { pairs, touches: found.into_inner() }
}

/// True if an edge of a triangle meets another triangle.
fn pierces([a, b, c]: [DVec3; 3], other: [DVec3; 3]) -> bool {
    [(a, b), (b, c), (c, a)].iter().any(|&(p, q)| meets(p, q, other))
}

/// True if a corner of the first triangle, which is none of the second, lies within `tolerance` [m] of that.
fn near(first: [DVec3; 3], of_first: [u32; 3], second: [DVec3; 3], of_second: [u32; 3], tolerance: f64) -> bool {
    let [a, b, c] = second;
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    first.iter().zip(of_first).filter(|(_, v)| !of_second.contains(v)).any(|(&p, _)| {
        (p.clamp(lo, hi) - p).length_squared() <= tolerance * tolerance
            && closest_on_triangle(p, second).0.distance(p) <= tolerance
    })
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
