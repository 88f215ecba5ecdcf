//! The surface where a field on a lattice is zero, by tetrahedra: six to a cube (Kuhn), so that neighbours share vertices and the mesh is closed.

use super::TriMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Numbers at the points of a lattice; the first index runs fastest.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// Lowest corner [m].
    pub low: DVec3,
    /// Edge of a cube [m].
    pub edge: f64,
    /// Points along each axis.
    pub size: [usize; 3],
    /// The numbers.
    pub values: Vec<f64>,
}

/// Corners of the six tetrahedra of a cube, by bits: each walks from corner 0 to corner 7 along the axes in another order, seen alike.
const TETRAHEDRA: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

impl Field {
    /// Place of a point of the lattice [m].
    pub(super) fn place(&self, n: usize) -> DVec3 {
        let [i, j, _] = self.size;
        self.low + self.edge * DVec3::new((n % i) as f64, (n / i % j) as f64, (n / (i * j)) as f64)
    }

    /// True on the lattice's own border.
    pub(super) fn is_border(&self, n: usize) -> bool {
        let [i, j, k] = self.size;
        let at = [n % i, n / i % j, n / (i * j)];
        at.iter().zip([i, j, k]).any(|(a, size)| *a == 0 || *a + 1 == size)
    }

    /// The six neighbours of a point that is not on the border.
    pub(super) fn beside(&self, n: usize) -> [usize; 6] {
        let (row, layer) = (self.size[0], self.size[0] * self.size[1]);
        [n - 1, n + 1, n - row, n + row, n - layer, n + layer]
    }

    /// The neighbours of any point that are not on the border.
    pub(super) fn inwards(&self, n: usize) -> Vec<usize> {
        let [i, j, _] = self.size;
        let at = [n % i, n / i % j, n / (i * j)];
        let steps = [1, i, i * j];
        let beside = (0..3).flat_map(|a| {
            let up = (at[a] + 1 < self.size[a]).then(|| n + steps[a]);
            let down = (at[a] > 0).then(|| n - steps[a]);
            [up, down]
        });
        beside.flatten().filter(|m| !self.is_border(*m)).collect()
    }

    /// Where the numbers are zero, seen from where they are positive. `least` keeps vertices off the lattice's points, in parts of an edge.
    pub(super) fn surface(&self, least: f64) -> TriMesh {
        let (mut mesh, mut number) = (TriMesh::default(), BTreeMap::new());
        let (row, layer) = (self.size[0], self.size[0] * self.size[1]);
        for n in (0..self.values.len()).filter(|n| !self.is_last(*n)) {
            let corner = |bits: usize| n + (bits & 1) + row * (bits >> 1 & 1) + layer * (bits >> 2);
            let inside = |bits: usize| self.values[corner(bits)] < 0.0;
            if (1..8).all(|bits| inside(bits) == inside(0)) {
                continue;
            }
            for tetrahedron in TETRAHEDRA {
                let (below, above): (Vec<usize>, Vec<usize>) = tetrahedron.into_iter().partition(|bits| inside(*bits));
                let mut between = |a: usize, b: usize| self.vertex(corner(a), corner(b), least, &mut mesh.vertices, &mut number);
                let polygon = match (&below[..], &above[..]) {
                    ([a], [b, c, d]) | ([b, c, d], [a]) => vec![between(*a, *b), between(*a, *c), between(*a, *d)],
                    ([a, b], [c, d]) => vec![between(*a, *c), between(*a, *d), between(*b, *d), between(*b, *c)],
                    _ => continue,
                };
                let x = |k: usize| mesh.vertices[polygon[k] as usize];
                let middle = |of: &[usize]| of.iter().map(|bits| self.place(corner(*bits))).sum::<DVec3>() / of.len() as f64;
                let outwards = middle(&above) - middle(&below);
                let turned = (x(1) - x(0)).cross(x(2) - x(0)).dot(outwards) < 0.0;
                for k in 1..polygon.len() - 1 {
                    let [a, b] = if turned { [k + 1, k] } else { [k, k + 1] };
                    mesh.triangles.push([polygon[0], polygon[a], polygon[b]]);
                }
            }
        }
        mesh
    }

    fn is_last(&self, n: usize) -> bool {
        let [i, j, k] = self.size;
        n % i + 1 == i || n / i % j + 1 == j || n / (i * j) + 1 == k
    }

    fn vertex(
        &self,
        a: usize,
        b: usize,
        least: f64,
        vertices: &mut Vec<DVec3>,
        number: &mut BTreeMap<(usize, usize), u32>,
    ) -> u32 {
        let key = (a.min(b), a.max(b));
        *number.entry(key).or_insert_with(|| {
            let (from, to) = (self.values[key.0], self.values[key.1]);
            let at = (from / (from - to)).clamp(least, 1.0 - least);
            vertices.push(self.place(key.0).lerp(self.place(key.1), at));
            vertices.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_closed_and_measures_up() {
        let mut field = Field { low: DVec3::splat(-1.21), edge: 0.11, size: [23; 3], values: Vec::new() };
        field.values = (0..23usize.pow(3)).map(|n| field.place(n).length() - 1.0).collect();
        let mesh = field.surface(0.01);
        assert!((mesh.volume() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.02, "{}", mesh.volume());
        assert!(super::super::diagnose(&mesh).is_closed());
        let outwards = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            (b - a).cross(c - a).dot(a) > 0.0
        };
        assert!((0..mesh.triangles.len()).all(outwards));
    }
}
