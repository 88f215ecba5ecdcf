//! The second kind of elastic domain: points that stand for a volume each, with a stencil for the deformation gradient there. A linear
//! tetrahedron is one point with four nodes.

use crate::shape::TriMesh;
use crate::space::stencil::{StencilBuf, Stencils};
use glam::{DAffine3, DMat3, DVec3};
use std::collections::BTreeMap;

/// Elastic points of a body.
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// Place and deformation gradient of every point, with gradients.
    pub stencils: Stencils,
    /// Volume that every point stands for [m³].
    pub volume: Vec<f64>,
}

impl Points {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.volume.len()
    }

    /// True without points: the body is made of cut cells.
    pub fn is_empty(&self) -> bool {
        self.volume.is_empty()
    }

    /// The affine field of the element that holds a place, or of the one that it lies outside of by the least, as a stencil; and how far
    /// outside that is [m], zero inside.
    pub fn carry(&self, nodes: &[DVec3], place: DVec3) -> (StencilBuf, f64) {
        let mut best: Option<(f64, StencilBuf)> = None;
        for (s, volume) in self.stencils.iter().zip(&self.volume) {
            let away = place - s.at(nodes);
            let value: Vec<f64> = s.value.iter().zip(s.gradient).map(|(w, g)| w + g.dot(away)).collect();
            // A weight below zero is the share of the height over the opposite face that the place lies beyond it.
            let outside = -value.iter().copied().fold(f64::INFINITY, f64::min) * volume.cbrt();
            if best.as_ref().is_none_or(|b| outside < b.0) {
                best = Some((outside, StencilBuf { nodes: s.nodes.to_vec(), value, gradient: s.gradient.to_vec() }));
            }
        }
        best.map_or_else(Default::default, |(outside, s)| (s, outside.max(0.0)))
    }
}

/// A mesh of linear tetrahedra.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Nodes [m].
    pub nodes: Vec<DVec3>,
    /// Nodes of every tetrahedron; (b − a) × (c − a) · (d − a) is positive.
    pub tets: Vec<[u32; 4]>,
}

impl TetMesh {
    /// Six times the volume of a tetrahedron [m³].
    fn six_volumes(&self, [a, b, c, d]: [u32; 4]) -> f64 {
        let x = |n: u32| self.nodes[n as usize];
        (x(b) - x(a)).cross(x(c) - x(a)).dot(x(d) - x(a))
    }

    /// Turns tetrahedra that count their nodes the other way round, drops nodes that none has, and checks the rest.
    ///
    /// # Errors
    /// No tetrahedra, nodes that do not exist, flat ones, or several parts that do not touch; with counts.
    pub fn checked(mut self) -> Result<TetMesh, String> {
        if self.tets.is_empty() {
            return Err("holds no tetrahedra".into());
        }
        if let Some(n) = self.tets.iter().flatten().find(|n| **n as usize >= self.nodes.len()) {
            return Err(format!("names node {n}, but there are {}", self.nodes.len()));
        }
        let turned: Vec<bool> = self.tets.iter().map(|t| self.six_volumes(*t) < 0.0).collect();
        self.tets.iter_mut().zip(turned).filter(|t| t.1).for_each(|(t, _)| t.swap(2, 3));
        let longest = |t: &[u32; 4]| {
            let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
            pairs.map(|(i, j)| (self.nodes[t[i] as usize] - self.nodes[t[j] as usize]).length()).fold(0.0, f64::max)
        };
        let flat = self.tets.iter().filter(|t| self.six_volumes(**t) <= 1e-9 * longest(t).powi(3)).count();
        if flat > 0 {
            return Err(format!("{flat} of {} tetrahedra are flat; remesh the body", self.tets.len()));
        }
        let parts = self.parts();
        if parts > 1 {
            return Err(format!("holds {parts} parts that do not touch; a body is one part"));
        }
        Ok(self.without_orphans())
    }

    /// Number of parts that share no node.
    fn parts(&self) -> usize {
        let mut root: Vec<u32> = (0..self.nodes.len() as u32).collect();
        fn find(root: &mut [u32], mut n: u32) -> u32 {
            while root[n as usize] != n {
                root[n as usize] = root[root[n as usize] as usize];
                n = root[n as usize];
            }
            n
        }
        for t in &self.tets {
            let first = find(&mut root, t[0]);
            for n in &t[1..] {
                let other = find(&mut root, *n);
                root[other as usize] = first;
            }
        }
        let mut used: Vec<u32> = self.tets.iter().map(|t| find(&mut root, t[0])).collect();
        used.sort_unstable();
        used.dedup();
        used.len()
    }

    fn without_orphans(self) -> TetMesh {
        let mut number = vec![u32::MAX; self.nodes.len()];
        self.tets.iter().flatten().for_each(|n| number[*n as usize] = 0);
        let mut nodes = Vec::new();
        for (n, x) in number.iter_mut().zip(&self.nodes).filter(|(n, _)| **n == 0) {
            *n = nodes.len() as u32;
            nodes.push(*x);
        }
        TetMesh { nodes, tets: self.tets.iter().map(|t| t.map(|n| number[n as usize])).collect() }
    }

    /// The same, placed.
    pub fn transformed(&self, pose: &DAffine3) -> TetMesh {
        TetMesh { nodes: self.nodes.iter().map(|x| pose.transform_point3(*x)).collect(), tets: self.tets.clone() }
    }

    /// Faces that only one tetrahedron has, seen from outside, each with its tetrahedron.
    pub fn faces(&self) -> Vec<(u32, [u32; 3])> {
        // Of (a, b, c, d) with positive volume these look outwards.
        const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let mut seen: BTreeMap<[u32; 3], Option<(u32, [u32; 3])>> = BTreeMap::new();
        for (e, t) in self.tets.iter().enumerate() {
            for f in FACES.map(|f| f.map(|i| t[i])) {
                let mut key = f;
                key.sort_unstable();
                seen.entry(key).and_modify(|other| *other = None).or_insert(Some((e as u32, f)));
            }
        }
        let mut faces: Vec<_> = seen.into_values().flatten().collect();
        faces.sort_unstable();
        faces
    }

    /// The surface as triangles.
    pub fn surface(&self) -> TriMesh {
        let mut number = BTreeMap::new();
        let mut mesh = TriMesh::default();
        for (_, f) in self.faces() {
            let corner = f.map(|n| {
                *number.entry(n).or_insert_with(|| {
                    mesh.vertices.push(self.nodes[n as usize]);
                    mesh.vertices.len() as u32 - 1
                })
            });
            mesh.triangles.push(corner);
        }
        mesh
    }

    /// Elastic points and nodal volumes: one point in the middle of each tetrahedron, a quarter of its volume at each node.
    pub fn points(&self) -> (Points, Vec<f64>) {
        let (mut points, mut node_volume) = (Points::default(), vec![0.0; self.nodes.len()]);
        for t in &self.tets {
            let x = t.map(|n| self.nodes[n as usize]);
            let edges = DMat3::from_cols(x[1] - x[0], x[2] - x[0], x[3] - x[0]);
            let inverse = edges.inverse().transpose();
            let others = [inverse.x_axis, inverse.y_axis, inverse.z_axis];
            let gradient = [-(others[0] + others[1] + others[2]), others[0], others[1], others[2]];
            let volume = self.six_volumes(*t) / 6.0;
            points.stencils.push_with_gradient(t, &[0.25; 4], &gradient);
            points.volume.push(volume);
            t.iter().for_each(|n| node_volume[*n as usize] += 0.25 * volume);
        }
        (points, node_volume)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 2 × 1 × 1 cubes of six tetrahedra each, and a node that none has.
    pub(super) fn block() -> TetMesh {
        let at = |i: usize, j: usize, k: usize| (i + 3 * (j + 2 * k)) as u32;
        let mut mesh = TetMesh::default();
        for (k, j, i) in (0..2).flat_map(|k| (0..2).flat_map(move |j| (0..3).map(move |i| (k, j, i)))) {
            mesh.nodes.push(0.1 * DVec3::new(i as f64, j as f64, k as f64));
        }
        mesh.nodes.push(DVec3::splat(9.0));
        for i in 0..2 {
            let c = |bits: usize| at(i + (bits & 1), bits >> 1 & 1, bits >> 2);
            for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
                mesh.tets.push([c(0), c(way[0]), c(way[1]), c(7)]);
            }
        }
        mesh
    }

    #[test]
    fn a_block_has_its_volume_surface_and_affine_fields() {
        let mesh = block().checked().unwrap();
        assert_eq!(mesh.nodes.len(), 12);
        let (points, node_volume) = mesh.points();
        assert!((points.volume.iter().sum::<f64>() - 0.002).abs() < 1e-17 && points.volume.iter().all(|v| *v > 0.0));
        assert!((node_volume.iter().sum::<f64>() - 0.002).abs() < 1e-17);
        let f = DMat3::from_cols_array(&[1.2, 0.3, -0.1, 0.0, 0.9, 0.2, 0.1, 0.0, 1.1]);
        let x: Vec<DVec3> = mesh.nodes.iter().map(|x| f * *x + DVec3::Y).collect();
        for s in points.stencils.iter() {
            assert!((0..3).all(|c| (s.gradient_of(&x).col(c) - f.col(c)).length() < 1e-13));
        }
        let (inside, outside) = (DVec3::new(0.13, 0.04, 0.07), DVec3::new(0.25, 0.05, 0.05));
        for (place, far) in [(inside, 0.0), (outside, 0.01)] {
            let (s, away) = points.carry(&mesh.nodes, place);
            assert!((s.get().at(&x) - (f * place + DVec3::Y)).length() < 1e-13);
            assert!((away > 0.0) == (far > 0.0) && away < 0.1);
        }
        let surface = mesh.surface();
        assert_eq!((surface.vertices.len(), surface.triangles.len()), (12, 20));
        let solid: f64 = surface
            .triangles
            .iter()
            .map(|t| t.map(|n| surface.vertices[n as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        assert!((solid - 0.002).abs() < 1e-16, "the surface looks outwards: {solid}");
    }

    #[test]
    fn meshes_that_are_no_body_are_refused_with_counts() {
        let mut flat = block();
        flat.nodes[1] = flat.nodes[0];
        assert!(flat.checked().unwrap_err().contains("tetrahedra are flat"));
        let mut apart = block();
        let n = apart.nodes.len() as u32;
        apart.nodes.extend([DVec3::X, DVec3::X + DVec3::Y, DVec3::X + DVec3::Z, 2.0 * DVec3::X]);
        apart.tets.push([n, n + 1, n + 2, n + 3]);
        assert_eq!(apart.checked().unwrap_err(), "holds 2 parts that do not touch; a body is one part");
        let mut beyond = block();
        beyond.tets[0][0] = 99;
        assert_eq!(beyond.checked().unwrap_err(), "names node 99, but there are 13");
        assert_eq!(TetMesh::default().checked().unwrap_err(), "holds no tetrahedra");
    }
}
