//! The second kind of elastic domain: points that stand for a volume each, with a stencil for the deformation gradient there. A linear
//! tetrahedron is one point with four nodes, a quadratic one five with ten ([`super::tets`]).

use crate::shape::TriMesh;
use crate::space::stars::penalty::Penalty;
use crate::space::stencil::{Stencil, Stencils};
use glam::{DAffine3, DMat3, DVec3};
use std::collections::BTreeMap;

/// Elastic points of a body, element by element: as many of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// Place and deformation gradient of every point, with gradients.
    pub stencils: Stencils,
    /// Volume that every point stands for [m³].
    pub volume: Vec<f64>,
    /// Points of an element, the last of which has its mean; zero without any.
    pub per_element: usize,
    /// Of a cloud's stars, each a node's own, what keeps them from moving otherwise than affinely.
    pub stars: Option<Penalty>,
}

/// What part of the material acts at a point.
///
/// Elements of several points are integrated selectively: at local points the material has the Lamé parameters (λ', μ) with
/// λ' = λ μ c / (λ + μ c), and at the point that stands for the element's mean (λ − λ', 0). Where the strain is uniform both add up to
/// (λ, μ). Near ν = ½ only the mean dilatation of an element is stiff, so nothing locks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Share {
    /// All of it.
    Whole,
    /// Shear, and as much of λ as a local point bears.
    Local,
    /// The rest of λ.
    Mean,
}

/// The most that λ is at local points, over μ: λ' < c μ. Ten is what ν = 0.455 has.
pub const LOCAL: f64 = 10.0;

impl Share {
    /// All, as numbers of their own.
    pub const ALL: [Share; 3] = [Share::Whole, Share::Local, Share::Mean];

    /// Its Lamé parameters and their derivatives by Poisson's ratio, of those of the whole material.
    pub fn of(self, (lambda, mu): (f64, f64), by_nu: (f64, f64)) -> [(f64, f64); 2] {
        let (stiff, sum) = (LOCAL * mu, lambda + LOCAL * mu);
        let local = lambda * stiff / sum;
        let local_by_nu = (stiff * stiff * by_nu.0 + LOCAL * lambda * lambda * by_nu.1) / (sum * sum);
        match self {
            Share::Whole => [(lambda, mu), by_nu],
            Share::Local => [(local, mu), (local_by_nu, by_nu.1)],
            Share::Mean => [(lambda * lambda / sum, 0.0), (by_nu.0 - local_by_nu, 0.0)],
        }
    }
}

impl Points {
    /// None yet, of elements with so many points.
    pub fn new(per_element: usize) -> Points {
        Points { per_element, ..Points::default() }
    }

    /// The same with memory for so many elements of so many nodes.
    pub fn with_capacity(per_element: usize, elements: usize, nodes: usize) -> Points {
        let all = per_element * elements;
        Points { stencils: Stencils::with_capacity(all, nodes), volume: Vec::with_capacity(all), ..Points::new(per_element) }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.volume.len()
    }

    /// True without points: the body is made of cut cells.
    pub fn is_empty(&self) -> bool {
        self.volume.is_empty()
    }

    /// Number of elements.
    pub fn elements(&self) -> usize {
        self.len() / self.per_element.max(1)
    }

    /// Element of a point.
    pub fn element_of(&self, point: usize) -> usize {
        point / self.per_element
    }

    /// Number of the point that has an element's mean.
    pub fn mean_point(&self, element: usize) -> usize {
        self.per_element * element + self.per_element - 1
    }

    /// What acts at a point.
    pub fn share(&self, point: usize) -> Share {
        match (self.per_element, point % self.per_element) {
            (1, _) => Share::Whole,
            (n, k) if k + 1 == n => Share::Mean,
            _ => Share::Local,
        }
    }

    /// Volume of an element [m³].
    pub fn element_volume(&self, element: usize) -> f64 {
        self.volume[self.mean_point(element)]
    }

    /// Place and deformation gradient of an element's mean: of a point of its own, or of its only one.
    pub fn mean(&self, element: usize) -> Stencil<'_> {
        self.stencils.get(self.mean_point(element))
    }

    /// The nodes that bear an element's mass: all of a tetrahedron's, and of a star the point itself.
    pub fn bearers(&self, element: usize) -> Stencil<'_> {
        let s = self.mean(element);
        let n = if self.stars.is_some() { 1 } else { s.nodes.len() };
        Stencil { nodes: &s.nodes[..n], value: &s.value[..n], gradient: &s.gradient[..n] }
    }

    /// The same of all elements.
    pub fn means(&self) -> impl Iterator<Item = Stencil<'_>> + Clone {
        (0..self.elements()).map(|e| self.mean(e))
    }

    /// Every point where the body's stress-free shape is X + W: G⁻¹ and det G of G = I + ∇W.
    pub fn unstrained<'a>(&'a self, w: &'a [DVec3]) -> impl Iterator<Item = (DMat3, f64)> + 'a {
        self.stencils.iter().map(|s| s.gradient_of(w) + DMat3::IDENTITY).map(|g| (g.inverse(), g.determinant()))
    }
}

/// A mesh of linear tetrahedra.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Nodes [m].
    pub nodes: Vec<DVec3>,
    /// Nodes of every tetrahedron; (b − a) × (c − a) · (d − a) is positive.
    pub tets: Vec<[u32; 4]>,
    /// Named groups of nodes, each in increasing order.
    pub groups: BTreeMap<String, Vec<u32>>,
}

impl TetMesh {
    /// Faces of a tetrahedron (a, b, c, d) with positive volume, each seen from outside.
    pub(crate) const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    /// Six times the volume of a tetrahedron [m³].
    pub(crate) fn six_volumes(&self, [a, b, c, d]: [u32; 4]) -> f64 {
        let x = |n: u32| self.nodes[n as usize];
        (x(b) - x(a)).cross(x(c) - x(a)).dot(x(d) - x(a))
    }

    /// The same, placed.
    pub fn transformed(&self, pose: &DAffine3) -> TetMesh {
        TetMesh { nodes: self.nodes.iter().map(|x| pose.transform_point3(*x)).collect(), ..self.clone() }
    }

    /// Faces that only one tetrahedron has, seen from outside, each with its tetrahedron.
    pub fn faces(&self) -> Vec<(u32, [u32; 3])> {
        let mut seen: BTreeMap<[u32; 3], Option<(u32, [u32; 3])>> = BTreeMap::new();
        for (e, t) in self.tets.iter().enumerate() {
            for f in TetMesh::FACES.map(|f| f.map(|i| t[i])) {
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
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A box of 2 × 1 × 1 cubes of six tetrahedra each, and a node that none has.
    pub(crate) fn block() -> TetMesh {
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
    fn a_block_has_a_surface_that_looks_outwards() {
        let mesh = block().checked().unwrap();
        assert_eq!(mesh.nodes.len(), 12);
        let surface = mesh.surface();
        assert_eq!((surface.vertices.len(), surface.triangles.len()), (12, 20));
        let solid: f64 = surface
            .triangles
            .iter()
            .map(|t| t.map(|n| surface.vertices[n as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        assert!((solid - 0.002).abs() < 1e-16, "{solid}");
    }
}
