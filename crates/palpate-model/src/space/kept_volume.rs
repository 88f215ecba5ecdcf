//! A mesh that approximates a shape, and the shape's volume: chords and rounded edges take some, and moving the surface gives it back.

use crate::space::points::TetMesh;
use glam::DVec3;

/// What was done to a mesh so that it has its shape's volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptVolume {
    /// Volume before, over that of the shape, minus one.
    pub error: f64,
    /// How far its surface was moved outwards [m]; 0 where that would have spoilt tetrahedra.
    pub moved: f64,
}

impl TetMesh {
    /// Moves all nodes of the surface along its normal by one distance, so that the mesh has a volume [m³].
    pub fn keep_volume(&mut self, volume: f64) -> KeptVolume {
        let error = self.volume() / volume - 1.0;
        let mut normals = vec![DVec3::ZERO; self.nodes.len()];
        let faces = self.faces();
        let area = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|n| self.nodes[n as usize]);
            0.5 * (b - a).cross(c - a)
        };
        let areas: Vec<DVec3> = faces.iter().map(|(_, f)| area(f)).collect();
        faces.iter().zip(&areas).for_each(|((_, f), area)| f.iter().for_each(|n| normals[*n as usize] += *area));
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        let slope: f64 =
            faces.iter().zip(&areas).map(|((_, f), a)| f.iter().map(|n| normals[*n as usize].dot(*a)).sum::<f64>() / 3.0).sum();
        let at =
            |by: f64| TetMesh { nodes: self.nodes.iter().zip(&normals).map(|(x, n)| *x + by * *n).collect(), ..self.clone() };
        // The volume is a cubic of the distance, and nearly linear: secants gain digits faster than one by one.
        let (mut last, mut moved) = ((0.0, self.volume()), (volume - self.volume()) / slope);
        for _ in 0..12 {
            let now = at(moved).volume();
            if (now / volume - 1.0).abs() < 1e-13 || moved == last.0 {
                break;
            }
            let slope = (now - last.1) / (moved - last.0);
            last = (moved, now);
            moved += (volume - now) / slope;
        }
        let other = at(moved);
        let sound = other.worst_dihedral_angles().0 > 0.5 * self.worst_dihedral_angles().0;
        if !(sound && (other.volume() / volume - 1.0).abs() < 1e-6 && other.tets.iter().all(|t| other.six_volumes(*t) > 0.0)) {
            return KeptVolume { error, moved: 0.0 };
        }
        *self = other;
        KeptVolume { error, moved }
    }
}
