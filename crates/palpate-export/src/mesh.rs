//! The mesh of a specimen: tetrahedra, with nodes in the middle of edges where they are quadratic.

use glam::{DMat3, DVec3};
use palpate_model::space::body::Body;
use palpate_model::space::points::TetMesh;
use palpate_model::space::tets::Tetrahedron;

/// Tetrahedra; (b − a) × (c − a) · (d − a) is positive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Nodes [m]: corners, then middles of edges.
    pub nodes: Vec<DVec3>,
    /// Number of corners.
    pub corners: usize,
    /// Corners of every tetrahedron.
    pub tets: Vec<[u32; 4]>,
    /// Nodes in the middle of its edges, in the order of [`palpate_model::space::tets::EDGES`]; empty where elements are linear.
    pub middles: Vec<[u32; 6]>,
    /// Surface: every face with its tetrahedron, seen from outside.
    pub faces: Vec<(u32, [u32; 3])>,
}

impl Mesh {
    /// A mesh of linear or quadratic elements.
    pub fn new(mesh: &TetMesh, quadratic: bool) -> Mesh {
        let (corners, faces, tets) = (mesh.nodes.len(), mesh.faces(), mesh.tets.clone());
        if !quadratic {
            return Mesh { nodes: mesh.nodes.clone(), corners, tets, middles: Vec::new(), faces };
        }
        let body = Body::of_tets(mesh, Tetrahedron::Quadratic);
        let middles = body.element_nodes().map(|t| std::array::from_fn(|k| t[4 + k])).collect();
        Mesh { nodes: body.nodes, corners, tets, middles, faces }
    }

    /// True of quadratic elements.
    pub fn is_quadratic(&self) -> bool {
        !self.middles.is_empty()
    }

    /// The same with linear elements, which have the corners alone.
    pub fn linear(&self) -> Mesh {
        Mesh { nodes: self.nodes[..self.corners].to_vec(), middles: Vec::new(), ..self.clone() }
    }

    /// All nodes of a tetrahedron, corners first.
    pub fn element(&self, tet: usize) -> impl Iterator<Item = u32> + '_ {
        self.tets[tet].iter().chain(self.middles.get(tet).into_iter().flatten()).copied()
    }

    /// Places of the corners of a tetrahedron [m].
    pub fn places(&self, tet: usize) -> [DVec3; 4] {
        self.tets[tet].map(|n| self.nodes[n as usize])
    }

    /// Volume of a tetrahedron [m³].
    pub fn volume_of(&self, tet: usize) -> f64 {
        let [a, b, c, d] = self.places(tet);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        (0..self.tets.len()).map(|e| self.volume_of(e)).sum()
    }

    /// Area of the surface [m²].
    pub fn area(&self) -> f64 {
        let area = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|n| self.nodes[n as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        self.faces.iter().map(|(_, f)| area(f)).sum()
    }

    /// Lowest and highest corner of the box around it [m].
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let low = self.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        (low, self.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max))
    }

    /// Edge of the cube that six mean tetrahedra fill [m].
    pub fn length(&self) -> f64 {
        (6.0 * self.volume() / self.tets.len().max(1) as f64).cbrt()
    }

    /// Mass, centre and inertia about it [kg, m, kg m²] for a density of every tetrahedron.
    pub fn inertia(&self, density: impl Fn(usize) -> f64) -> (f64, DVec3, DMat3) {
        // ∫ x xᵀ over a tetrahedron is V/20 (Σ xᵢ xᵢᵀ + s sᵀ) with s = Σ xᵢ.
        let outer = |a: DVec3| DMat3::from_cols(a * a.x, a * a.y, a * a.z);
        let (mut mass, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for e in 0..self.tets.len() {
            let m = density(e) * self.volume_of(e);
            let x = self.places(e);
            let sum: DVec3 = x.iter().sum();
            mass += m;
            first += sum * (0.25 * m);
            second += (x.iter().fold(outer(sum), |s, a| s + outer(*a))) * (m / 20.0);
        }
        let center = first / mass;
        let about = second - outer(center) * mass;
        let trace = about.x_axis.x + about.y_axis.y + about.z_axis.z;
        (mass, center, DMat3::from_diagonal(DVec3::splat(trace)) - about)
    }
}
