//! Sign of the distance to a clean closed mesh from the normal at the nearest point: exact, and cheaper than winding numbers.
//!
//! Bærentzen and Aanæs, "Signed distance computation using the angle weighted pseudonormal", 2005: at a vertex the face normals weighted
//! by their angles, at an edge the sum of both, decide the side. That needs a surface that is closed, consistently oriented, and
//! neither touches nor pierces itself.

use super::TriMesh;
use super::edges::{EdgeUses, bucketed};
use glam::DVec3;
use rayon::prelude::*;

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
    /// The normals of a mesh that is clean, with its edges.
    pub(super) fn new(mesh: &TriMesh, uses: &EdgeUses) -> Pseudonormals {
        // Normal of every face and angles at its corners [rad].
        let (face, angles): (Vec<DVec3>, Vec<[f64; 3]>) = (0..mesh.triangles.len())
            .into_par_iter()
            .map(|t| {
                let p = mesh.corners(t);
                let angle = |i: usize| (p[(i + 1) % 3] - p[i]).angle_between(p[(i + 2) % 3] - p[i]);
                ((p[1] - p[0]).cross(p[2] - p[0]).normalize(), [0, 1, 2].map(angle))
            })
            .unzip();
        let mut corner = vec![DVec3::ZERO; mesh.vertices.len()];
        for (t, v) in mesh.triangles.iter().enumerate() {
            (0..3).for_each(|i| corner[v[i] as usize] += face[t] * angles[t][i]);
        }
        let mut edge = vec![[DVec3::ZERO; 3]; mesh.triangles.len()];
        for (_, uses) in uses.groups() {
            let sum: DVec3 = uses.iter().map(|u| face[u.triangle as usize]).sum();
            uses.iter().for_each(|u| edge[u.triangle as usize][usize::from(u.side)] = sum);
        }
        Pseudonormals { corner, edge, face }
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

/// True if the triangles around every vertex form one fan (two cones that touch in their tips form two).
pub(super) fn single_fans(mesh: &TriMesh) -> bool {
    // Around vertex v[i] the triangle leads from the next corner to the one after.
    let steps = mesh.triangles.iter().flat_map(|v| (0..3).map(|i| (v[i], [v[(i + 1) % 3], v[(i + 2) % 3]])));
    let (first, mut steps) = bucketed(mesh.vertices.len(), steps);
    first.windows(2).filter(|w| w[0] < w[1]).all(|w| {
        let own = &mut steps[w[0] as usize..w[1] as usize];
        own.sort_unstable();
        let (start, count) = (own[0][0], own.len());
        let mut at = start;
        for n in 1..=count {
            match own.binary_search_by_key(&at, |s| s[0]) {
                Ok(k) => at = own[k][1],
                Err(_) => return false,
            }
            if at == start {
                return n == count;
            }
        }
        false
    })
}
