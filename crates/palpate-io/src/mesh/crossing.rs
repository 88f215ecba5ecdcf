//! Does a surface pass through itself?

use glam::DVec3;
use palpate_model::shape::TriMesh;
use rayon::prelude::*;

/// Number of triangles that another triangle's edge passes through. Triangles with a common vertex are not compared.
pub(super) fn crossings(mesh: &TriMesh) -> usize {
    let corners = |t: usize| mesh.triangles[t].map(|v| mesh.vertices[v as usize]);
    let boxes: Vec<(DVec3, DVec3)> = (0..mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = corners(t);
            (a.min(b).min(c), a.max(b).max(c))
        })
        .collect();
    // Sweep along the longest side: only triangles whose intervals there overlap can meet.
    let (lo, hi) = super::bounds(&mesh.vertices);
    let axis = (0..3).max_by(|a, b| (hi - lo)[*a].total_cmp(&(hi - lo)[*b])).unwrap_or(0);
    let mut order: Vec<usize> = (0..boxes.len()).collect();
    order.sort_by(|a, b| boxes[*a].0[axis].total_cmp(&boxes[*b].0[axis]));
    let hit: Vec<[usize; 2]> = (0..order.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let t = order[i];
            let later = order[i + 1..].iter().take_while(|u| boxes[**u].0[axis] <= boxes[t].1[axis]);
            let meet = |u: usize| boxes[u].0.cmple(boxes[t].1).all() && boxes[t].0.cmple(boxes[u].1).all();
            let strangers = |u: usize| !mesh.triangles[t].iter().any(|v| mesh.triangles[u].contains(v));
            let mut found = Vec::new();
            for &u in later.filter(|u| meet(**u) && strangers(**u)) {
                if pierces(corners(t), corners(u)) || pierces(corners(u), corners(t)) {
                    found.push([t, u]);
                }
            }
            found
        })
        .collect();
    let mut triangles: Vec<usize> = hit.into_iter().flatten().collect();
    triangles.sort_unstable();
    triangles.dedup();
    triangles.len()
}

/// True when an edge of `a` passes through the inside of `b`.
fn pierces(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    let side = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| (q - p).cross(r - p).dot(s - p);
    (0..3).any(|i| {
        let (p, q) = (a[i], a[(i + 1) % 3]);
        if side(b[0], b[1], b[2], p) * side(b[0], b[1], b[2], q) >= 0.0 {
            return false;
        }
        let s = [side(p, q, b[0], b[1]), side(p, q, b[1], b[2]), side(p, q, b[2], b[0])];
        s.iter().all(|x| *x > 0.0) || s.iter().all(|x| *x < 0.0)
    })
}
