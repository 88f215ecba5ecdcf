//! Vertices at the same place become one.

use super::TriMesh;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A direction with which no edge of a grid, and no face of a box, is parallel or at right angles; of length 1 at most.
const SKEW: DVec3 = DVec3::new(0.365_148_371_670_110_7, 0.546_872_513_919_921_8, 0.753_372_441_126_347_8);

/// Vertices that have another within `tolerance` [m], as flags `[V]`. Sorted along a skew direction, only neighbours in the order need be
/// compared.
fn crowded(vertices: &[DVec3], tolerance: f64) -> Vec<bool> {
    let mut order: Vec<(f64, u32)> = vertices.iter().zip(0u32..).map(|(p, v)| (p.dot(SKEW), v)).collect();
    order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // The direction may be longer than 1 by rounding, and sums are rounded as well.
    let reach = tolerance * 1.01 + 1e-15 * order.iter().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let mut flags = vec![false; vertices.len()];
    for (i, &(x, v)) in order.iter().enumerate() {
        for &(y, w) in order[i + 1..].iter().take_while(|(y, _)| *y - x <= reach) {
            debug_assert!(y >= x);
            if vertices[v as usize].distance(vertices[w as usize]) <= tolerance {
                (flags[v as usize], flags[w as usize]) = (true, true);
            }
        }
    }
    flags
}

/// Joins vertices closer than f32 can tell apart; returns how many went. Each goes to the first that it is near to.
pub(super) fn join_vertices(mesh: &TriMesh) -> (TriMesh, usize) {
    let largest = mesh.vertices.iter().map(|v| v.abs().max_element()).fold(mesh.size(), f64::max);
    let tolerance = 1e-7 * largest;
    let crowded = crowded(&mesh.vertices, tolerance);
    if !crowded.contains(&true) {
        return (mesh.clone(), 0);
    }
    let key = |p: DVec3| (p / (2.0 * tolerance).max(f64::MIN_POSITIVE)).floor().to_array().map(|x| x as i64);
    let mut grid: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut number = Vec::with_capacity(mesh.vertices.len());
    for (&p, crowded) in mesh.vertices.iter().zip(crowded) {
        let near = crowded.then(|| {
            let [x, y, z] = key(p);
            let near = (0..27).find_map(|o| {
                let cell = [x + o % 3 - 1, y + o / 3 % 3 - 1, z + o / 9 - 1];
                grid.get(&cell)?.iter().copied().find(|&v| vertices[v as usize].distance(p) <= tolerance)
            });
            if near.is_none() {
                grid.entry([x, y, z]).or_default().push(vertices.len() as u32);
            }
            near
        });
        number.push(near.flatten().unwrap_or_else(|| {
            vertices.push(p);
            vertices.len() as u32 - 1
        }));
    }
    let joined = mesh.vertices.len() - vertices.len();
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
    (TriMesh { vertices, triangles }, joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_vertices_at_the_same_place_are_joined() {
        // Points of a grid, every seventh again, and every eleventh again a little beside it: a tenth of the tolerance of 1e-7.
        let grid: Vec<DVec3> =
            (0..1000).map(|k| DVec3::new((k % 10) as f64, (k / 10 % 10) as f64, (k / 100) as f64) / 9.0).collect();
        let mut mesh = TriMesh { vertices: grid.clone(), triangles: vec![[0, 9, 99], [0, 99, 999]] };
        mesh.vertices.extend(grid.iter().step_by(7));
        mesh.vertices.extend(grid.iter().step_by(11).map(|p| *p + 1e-8));
        mesh.vertices.push(DVec3::splat(1e-6));
        let last = mesh.vertices.len() as u32 - 1;
        mesh.triangles.push([1000, 1143 + 1, last]);
        let (joined, gone) = join_vertices(&mesh);
        assert_eq!((gone, joined.vertices.len()), (143 + 91, 1001));
        // The first of the doubles is vertex 0 again, and so is the first that lies beside it but one: the second is vertex 11.
        assert_eq!(joined.triangles[2], [0, 11, 1000]);
        assert_eq!(join_vertices(&joined), (joined.clone(), 0));
    }
}
