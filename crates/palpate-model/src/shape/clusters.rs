//! Triangles of a node of the tree as one, seen from afar: for winding numbers.

use super::mesh::Node;
use glam::DVec3;

/// What the triangles of a node are from afar.
#[derive(Clone, Debug, Default)]
pub(super) struct Cluster {
    /// Sum of area vectors [m²].
    pub dipole: DVec3,
    /// Their centre [m].
    pub center: DVec3,
    /// Greatest distance of a corner from it [m].
    pub radius: f64,
}

/// Sums over the triangles of a node: area vectors, middles times area, area.
type Sums = (DVec3, DVec3, f64);

/// The clusters of all nodes over these triangles, which are in the tree's order.
pub(super) fn clusters(corners: &[[DVec3; 3]], tree: &[Node]) -> Vec<Cluster> {
    let mut all: Vec<(Cluster, Sums)> = vec![Default::default(); tree.len()];
    // Children come after their node.
    for (n, node) in tree.iter().enumerate().rev() {
        let own = &corners[node.range.0 as usize..node.range.1 as usize];
        let sums = match node.second {
            0 => own.iter().fold((DVec3::ZERO, DVec3::ZERO, 0.0), |sums: Sums, c| {
                let vector = 0.5 * (c[1] - c[0]).cross(c[2] - c[0]);
                let area = vector.length();
                (sums.0 + vector, sums.1 + (c[0] + c[1] + c[2]) / 3.0 * area, sums.2 + area)
            }),
            second => {
                let (a, b) = (&all[n + 1].1, &all[second as usize].1);
                (a.0 + b.0, a.1 + b.1, a.2 + b.2)
            }
        };
        let middle = || {
            let ends = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (lo, hi) = own.iter().flatten().fold(ends, |(lo, hi), p| (lo.min(*p), hi.max(*p)));
            0.5 * (lo + hi)
        };
        let center = if sums.2 > 0.0 { sums.1 / sums.2 } else { middle() };
        let radius = own.iter().flatten().map(|p| p.distance_squared(center)).fold(0.0, f64::max).sqrt();
        all[n] = (Cluster { dipole: sums.0, center, radius }, sums);
    }
    all.into_iter().map(|(c, _)| c).collect()
}
