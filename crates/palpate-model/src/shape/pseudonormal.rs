//! Sign of the distance to a clean closed mesh from the normal at the nearest point: exact, and cheaper than winding numbers.
//!
//! Bærentzen and Aanæs, "Signed distance computation using the angle weighted pseudonormal", 2005: at a vertex the face normals weighted
//! by their angles, at an edge the sum of both, decide the side. That needs a surface that is closed, consistently oriented, and
//! neither touches nor pierces itself.

use super::TriMesh;
use super::mesh::MeshShape;
use super::repair::diagnose;
use glam::DVec3;

/// Feature of a triangle nearest to a point: corner i, edge from corner i, or the inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Corner.
    Corner(usize),
    /// Edge from this corner to the next.
    Edge(usize),
    /// Inside.
    Face,
}

/// Normals (any length) of all features of a clean mesh.
#[derive(Clone, Debug)]
pub struct Pseudonormals {
    corner: Vec<DVec3>,
    edge: Vec<[DVec3; 3]>,
    face: Vec<DVec3>,
}

impl Pseudonormals {
    /// The normals, or `None` if the mesh is not clean. `tree` holds the same mesh.
    pub fn of(mesh: &TriMesh, tree: &MeshShape) -> Option<Pseudonormals> {
        let report = diagnose(mesh);
        let clean = report.is_closed()
            && report.signed_volume > 0.0
            && (report.inconsistent_edges, report.intersecting_pairs, report.degenerate_triangles, report.components)
                == (0, 0, 0, 1);
        if !clean || touches_itself(mesh, tree, 1e-6 * report.size) || !single_fans(mesh) {
            return None;
        }
        let face: Vec<DVec3> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                (b - a).cross(c - a).normalize()
            })
            .collect();
        let mut corner = vec![DVec3::ZERO; mesh.vertices.len()];
        let mut sides = std::collections::BTreeMap::<[u32; 2], DVec3>::new();
        for (t, v) in mesh.triangles.iter().enumerate() {
            let p = mesh.corners(t);
            for i in 0..3 {
                let (a, b) = (p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]);
                corner[v[i] as usize] += face[t] * a.angle_between(b);
                let (m, n) = (v[i], v[(i + 1) % 3]);
                *sides.entry([m.min(n), m.max(n)]).or_default() += face[t];
            }
        }
        let side = |m: u32, n: u32| sides[&[m.min(n), m.max(n)]];
        let edge = mesh.triangles.iter().map(|&[a, b, c]| [side(a, b), side(b, c), side(c, a)]).collect();
        Some(Pseudonormals { corner, edge, face })
    }

    /// Normal at a feature of triangle `t` with vertices `v`.
    pub fn at(&self, t: usize, v: [u32; 3], feature: Feature) -> DVec3 {
        match feature {
            Feature::Corner(i) => self.corner[v[i] as usize],
            Feature::Edge(i) => self.edge[t][i],
            Feature::Face => self.face[t],
        }
    }
}

/// True if a vertex lies within `tolerance` [m] of a triangle that it is no corner of.
fn touches_itself(mesh: &TriMesh, tree: &MeshShape, tolerance: f64) -> bool {
    (0..mesh.vertices.len()).any(|v| {
        let p = mesh.vertices[v];
        let mut touches = false;
        tree.overlapping(p - tolerance, p + tolerance, &mut |t| {
            touches |= !mesh.triangles[t].contains(&(v as u32))
                && super::mesh::closest_on_triangle(p, mesh.corners(t)).0.distance(p) <= tolerance;
        });
        touches
    })
}

/// True if the triangles around every vertex form one fan (two cones that touch in their tips form two).
fn single_fans(mesh: &TriMesh) -> bool {
    let mut next = std::collections::BTreeMap::<(u32, u32), u32>::new();
    let mut around = vec![(0usize, 0u32); mesh.vertices.len()];
    for v in &mesh.triangles {
        for i in 0..3 {
            next.insert((v[i], v[(i + 1) % 3]), v[(i + 2) % 3]);
            let a = &mut around[v[i] as usize];
            *a = (a.0 + 1, v[(i + 1) % 3]);
        }
    }
    around.iter().enumerate().filter(|(_, a)| a.0 > 0).all(|(v, &(count, first))| {
        let mut at = first;
        for n in 1..=count {
            match next.get(&(v as u32, at)) {
                Some(&to) => at = to,
                None => return false,
            }
            if at == first {
                return n == count;
            }
        }
        false
    })
}
