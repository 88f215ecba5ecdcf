//! Edges of a triangle mesh with the triangles at each, in flat arrays: linear in the number of triangles.

use super::TriMesh;

/// One triangle at an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Use {
    /// The edge's larger vertex.
    other: u32,
    /// The triangle.
    pub triangle: u32,
    /// Number of the triangle's corner that the edge begins at.
    pub side: u8,
    /// True where the triangle runs along it from the smaller to the larger vertex.
    pub rising: bool,
}

/// Triangles at every undirected edge.
#[derive(Clone, Debug)]
pub(super) struct EdgeUses {
    /// Where the edges of each smaller vertex begin `[V + 1]`.
    first: Vec<u32>,
    /// By smaller vertex, larger vertex and triangle.
    uses: Vec<Use>,
}

/// Sorts items into buckets, in the order in which they come: where each of the `count` buckets begins, and the items.
pub(super) fn bucketed<T: Copy>(count: usize, items: impl Iterator<Item = (u32, T)> + Clone) -> (Vec<u32>, Vec<T>) {
    let mut first = vec![0u32; count + 1];
    let mut any = None;
    for (bucket, item) in items.clone() {
        first[bucket as usize + 1] += 1;
        any = any.or(Some(item));
    }
    for b in 0..count {
        first[b + 1] += first[b];
    }
    let Some(any) = any else { return (first, Vec::new()) };
    let mut next = first.clone();
    let mut all = vec![any; first[count] as usize];
    for (bucket, item) in items {
        let at = &mut next[bucket as usize];
        all[*at as usize] = item;
        *at += 1;
    }
    (first, all)
}

impl EdgeUses {
    /// Of a mesh.
    pub fn of(mesh: &TriMesh) -> EdgeUses {
        let sides = mesh.triangles.iter().zip(0u32..).flat_map(|(&[a, b, c], triangle)| {
            [(a, b, 0), (b, c, 1), (c, a, 2)]
                .map(|(p, q, side)| (p.min(q), Use { other: p.max(q), triangle, side, rising: p < q }))
        });
        let (first, mut uses) = bucketed(mesh.vertices.len(), sides);
        for w in first.windows(2) {
            // Stable: triangles stay in their order.
            uses[w[0] as usize..w[1] as usize].sort_by_key(|u| u.other);
        }
        EdgeUses { first, uses }
    }

    /// Every edge once, as (smaller, larger) vertex number in rising order, with its triangles in theirs.
    pub fn groups(&self) -> impl Iterator<Item = ([u32; 2], &[Use])> {
        (self.first.windows(2).zip(0u32..)).flat_map(|(w, v)| {
            let own = &self.uses[w[0] as usize..w[1] as usize];
            own.chunk_by(|a, b| a.other == b.other).map(move |group| ([v, group[0].other], group))
        })
    }

    /// Number of edges with one triangle.
    pub fn open(&self) -> usize {
        self.groups().filter(|(_, u)| u.len() == 1).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn edges_come_once_in_order_with_their_triangles() {
        let mesh = TriMesh { vertices: vec![DVec3::ZERO; 4], triangles: vec![[3, 1, 0], [0, 1, 2], [1, 0, 2]] };
        let uses = EdgeUses::of(&mesh);
        let told: Vec<_> =
            uses.groups().map(|(e, u)| (e, u.iter().map(|u| (u.triangle, u.side, u.rising)).collect::<Vec<_>>())).collect();
        let expected = vec![
            ([0, 1], vec![(0, 1, false), (1, 0, true), (2, 0, false)]),
            ([0, 2], vec![(1, 2, false), (2, 1, true)]),
            ([0, 3], vec![(0, 2, true)]),
            ([1, 2], vec![(1, 1, true), (2, 2, false)]),
            ([1, 3], vec![(0, 0, false)]),
        ];
        assert_eq!(told, expected);
        assert_eq!(uses.open(), 2);
        assert_eq!(EdgeUses::of(&TriMesh::default()).groups().count(), 0);
    }
}
