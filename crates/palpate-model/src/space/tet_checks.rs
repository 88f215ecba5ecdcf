//! What keeps a mesh of tetrahedra from being a body, and what only deserves a word: each with counts and what to do.

use crate::shape::components::components;
use crate::space::points::TetMesh;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Dihedral angle [°] below which elements deserve a word: their stiffness grows as its cotangent, to eleven times that of a right angle's.
const SHARP: f64 = 5.0;
/// Six volumes over the cube of the longest edge, below which a tetrahedron is flat: its gradients would keep half of their digits.
const FLAT: f64 = 1e-9;
/// Distance over the longest side within which nodes lie at one place: files carry seven digits or more.
const SAME: f64 = 1e-7;

/// A mesh that is a body, and what looked suspicious about it, in sentences.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedTets {
    /// The mesh.
    pub mesh: TetMesh,
    /// One line each.
    pub warnings: Vec<String>,
}

/// A number of things, with what is said of one and of many.
fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

impl TetMesh {
    /// Turns tetrahedra that count their nodes the other way round, drops nodes that none has, and checks the rest.
    ///
    /// # Errors
    /// No tetrahedra, nodes that do not exist, flat or overlapping ones, or several parts that do not touch; with counts.
    pub fn checked(self) -> Result<TetMesh, String> {
        self.with_warnings().map(|c| c.mesh)
    }

    /// As [`TetMesh::checked`], with what deserves a word: turned tetrahedra, dropped nodes, nodes at one place and sharp angles.
    ///
    /// # Errors
    /// As [`TetMesh::checked`].
    pub fn with_warnings(mut self) -> Result<CheckedTets, String> {
        let mut warnings = Vec::new();
        if self.tets.is_empty() {
            return Err("holds no tetrahedra".into());
        }
        if let Some(n) = self.tets.iter().flatten().find(|n| **n as usize >= self.nodes.len()) {
            return Err(format!("names node {n}, but there are {}", self.nodes.len()));
        }
        let all = self.tets.len();
        let turned: Vec<bool> = self.tets.iter().map(|t| self.six_volumes(*t) < 0.0).collect();
        self.tets.iter_mut().zip(&turned).filter(|t| *t.1).for_each(|(t, _)| t.swap(2, 3));
        let turned = turned.iter().filter(|t| **t).count();
        if turned > 0 {
            warnings.push(format!("{turned} of {all} tetrahedra count their nodes the other way round; they were turned"));
        }
        let flat = self.tets.iter().filter(|t| self.six_volumes(**t) <= FLAT * self.longest_edge(t).powi(3)).count();
        if flat > 0 {
            let (are, them) = if flat == 1 { ("is", "it") } else { ("are", "them") };
            return Err(format!(
                "{flat} of {all} tetrahedra {are} flat; remesh the body, or let the mesher optimise {them} away"
            ));
        }
        let before = self.nodes.len();
        let mesh = self.without_orphans();
        let orphans = before - mesh.nodes.len();
        if orphans > 0 {
            warnings.push(format!("{} to no tetrahedron; dropped", count(orphans, "node belongs", "nodes belong")));
        }
        mesh.refuse_overlaps()?;
        let twice = mesh.nodes_at_one_place();
        let parts = mesh.parts();
        if parts > 1 {
            let remedy = match twice {
                0 => "a body is one part".to_string(),
                n => format!(
                    "{} where another one does: merge them (in Gmsh: Coherence Mesh) and the parts may be one",
                    count(n, "node lies", "nodes lie")
                ),
            };
            return Err(format!("holds {parts} parts that do not touch; {remedy}"));
        }
        if twice > 0 {
            warnings.push(format!(
                "{} where another one does, and the body is slit there; where no slit is meant, merge them (in Gmsh: Coherence Mesh)",
                count(twice, "node lies", "nodes lie")
            ));
        }
        let angles: Vec<f64> = mesh.tets.iter().map(|t| mesh.dihedral_angles(t).0).collect();
        let sharp = angles.iter().filter(|a| **a < SHARP).count();
        if sharp > 0 {
            let worst = angles.iter().copied().fold(f64::INFINITY, f64::min);
            warnings.push(format!(
                "{sharp} of {all} tetrahedra have dihedral angles below {SHARP}°, the worst {worst:.2}°: they are too stiff and solves take \
                 long; remesh or optimise the mesh"
            ));
        }
        Ok(CheckedTets { mesh, warnings })
    }

    /// Smallest and largest dihedral angle of all tetrahedra [°]; 180 and 0 without any.
    pub fn worst_dihedral_angles(&self) -> (f64, f64) {
        let one = |t: &[u32; 4]| self.dihedral_angles(t);
        self.tets.iter().map(one).fold((180.0, 0.0), |(a, b): (f64, f64), (c, d)| (a.min(c), b.max(d)))
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        self.tets.iter().map(|t| self.six_volumes(*t)).sum::<f64>() / 6.0
    }

    /// Smallest and largest of the six dihedral angles [°].
    fn dihedral_angles(&self, t: &[u32; 4]) -> (f64, f64) {
        let x = t.map(|n| self.nodes[n as usize]);
        // Outward normal of the face opposite to each corner.
        let normal = |[a, b, c]: [usize; 3]| (x[b] - x[a]).cross(x[c] - x[a]).normalize_or_zero();
        let n = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]].map(normal);
        let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
        // Half-angle form: exact also near 0° and 180°.
        let angle = |(i, j): (usize, usize)| 2.0 * (n[i] + n[j]).length().atan2((n[i] - n[j]).length()).to_degrees();
        pairs.map(angle).fold((180.0, 0.0), |(a, b): (f64, f64), x| (a.min(x), b.max(x)))
    }

    fn longest_edge(&self, t: &[u32; 4]) -> f64 {
        let pairs = (0..4).flat_map(|i| (0..i).map(move |j| (i, j)));
        pairs.map(|(i, j)| (self.nodes[t[i] as usize] - self.nodes[t[j] as usize]).length()).fold(0.0, f64::max)
    }

    /// Faces of three and more tetrahedra, or of two on the same side.
    fn refuse_overlaps(&self) -> Result<(), String> {
        let mut seen: Vec<([u32; 3], bool)> = Vec::with_capacity(4 * self.tets.len());
        for t in &self.tets {
            for f in TetMesh::FACES.map(|f| f.map(|i| t[i])) {
                let mut key = f;
                key.sort_unstable();
                let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]].iter().any(|p| p.map(|i| f[i]) == key);
                seen.push((key, even));
            }
        }
        seen.sort_unstable();
        let twice = seen.windows(2).filter(|w| w[0] == w[1]).count();
        match twice {
            0 => Ok(()),
            n => Err(format!(
                "{} to several tetrahedra on one side: they overlap; remesh the body",
                count(n, "face belongs", "faces belong")
            )),
        }
    }

    /// Number of nodes that lie where one before them does.
    fn nodes_at_one_place(&self) -> usize {
        let lo = self.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let hi = self.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let one = SAME * (hi - lo).max_element();
        let places: BTreeSet<[i64; 3]> =
            self.nodes.iter().map(|x| ((*x - lo) / one).round().to_array().map(|c| c as i64)).collect();
        self.nodes.len() - places.len()
    }

    /// Number of parts that share no node.
    fn parts(&self) -> usize {
        components(&self.tets, self.nodes.len()).1
    }

    /// The same without nodes that no tetrahedron has; groups lose them too.
    pub(crate) fn without_orphans(self) -> TetMesh {
        let mut number = vec![u32::MAX; self.nodes.len()];
        self.tets.iter().flatten().for_each(|n| number[*n as usize] = 0);
        let mut nodes = Vec::new();
        for (n, x) in number.iter_mut().zip(&self.nodes).filter(|(n, _)| **n == 0) {
            *n = nodes.len() as u32;
            nodes.push(*x);
        }
        let kept = |n: &u32| number.get(*n as usize).copied().filter(|n| *n != u32::MAX);
        let groups: BTreeMap<String, Vec<u32>> =
            self.groups.iter().map(|(name, of)| (name.clone(), of.iter().filter_map(kept).collect())).collect();
        TetMesh { nodes, tets: self.tets.iter().map(|t| t.map(|n| number[n as usize])).collect(), groups }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::points::tests::block;

    #[test]
    fn meshes_that_are_no_body_are_refused_with_counts() {
        let mut flat = block();
        flat.nodes[1] = flat.nodes[0];
        let e = flat.checked().unwrap_err();
        assert_eq!(e, "2 of 12 tetrahedra are flat; remesh the body, or let the mesher optimise them away");
        let mut apart = block();
        let n = apart.nodes.len() as u32;
        apart.nodes.extend([DVec3::X, DVec3::X + DVec3::Y, DVec3::X + DVec3::Z, 2.0 * DVec3::X]);
        apart.tets.push([n, n + 1, n + 2, n + 3]);
        assert_eq!(apart.checked().unwrap_err(), "holds 2 parts that do not touch; a body is one part");
        let mut beyond = block();
        beyond.tets[0][0] = 99;
        assert_eq!(beyond.checked().unwrap_err(), "names node 99, but there are 13");
        assert_eq!(TetMesh::default().checked().unwrap_err(), "holds no tetrahedra");
        let mut twice = block();
        twice.tets.push(twice.tets[0]);
        let e = twice.checked().unwrap_err();
        assert_eq!(e, "4 faces belong to several tetrahedra on one side: they overlap; remesh the body");
    }

    /// Every tetrahedron of a block on its own four nodes, but the first n of them together.
    fn torn(together: usize) -> TetMesh {
        let whole = block();
        let mut mesh = TetMesh { nodes: whole.nodes.clone(), ..TetMesh::default() };
        for (e, t) in whole.tets.iter().enumerate() {
            mesh.tets.push(if e < together {
                *t
            } else {
                t.map(|n| {
                    mesh.nodes.push(whole.nodes[n as usize]);
                    mesh.nodes.len() as u32 - 1
                })
            });
        }
        mesh
    }

    #[test]
    fn nodes_at_one_place_are_named_where_they_tear_a_body() {
        let e = torn(11).checked().unwrap_err();
        assert_eq!(
            e,
            "holds 2 parts that do not touch; 4 nodes lie where another one does: merge them (in Gmsh: Coherence Mesh) and the parts may be \
             one"
        );
        // A slit: one node of the last tetrahedron is its own.
        let mut slit = block().checked().unwrap();
        let last = slit.tets.len() - 1;
        slit.nodes.push(slit.nodes[slit.tets[last][0] as usize]);
        slit.tets[last][0] = slit.nodes.len() as u32 - 1;
        let said = slit.with_warnings().unwrap().warnings;
        assert!(
            said.len() == 1 && said[0].starts_with("1 node lies where another one does, and the body is slit there"),
            "{said:?}"
        );
    }

    #[test]
    fn what_only_deserves_a_word_is_counted() {
        let mut mesh = block().checked().unwrap();
        mesh.nodes.push(DVec3::splat(9.0));
        mesh.tets[2].swap(0, 1);
        mesh.groups.insert("end".into(), vec![0, 3, 12]);
        let CheckedTets { mesh, warnings } = mesh.with_warnings().unwrap();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert_eq!(warnings[0], "1 of 12 tetrahedra count their nodes the other way round; they were turned");
        assert_eq!(warnings[1], "1 node belongs to no tetrahedron; dropped");
        // The node that was dropped has left its group, too.
        assert_eq!(mesh.groups["end"], [0, 3]);
        assert!((mesh.volume() - 0.002).abs() < 1e-17);
        // Kuhn's six tetrahedra of a cube have angles of 45°, 60° and 90°.
        let (least, most) = mesh.worst_dihedral_angles();
        assert!((least - 45.0).abs() < 1e-9 && (most - 90.0).abs() < 1e-9, "{least}° to {most}°");
        let mut low = mesh;
        low.nodes.iter_mut().for_each(|x| x.z *= 0.05);
        let said = low.with_warnings().unwrap().warnings;
        let worst = "12 of 12 tetrahedra have dihedral angles below 5°, the worst 2.86°: they are too stiff";
        assert!(said.len() == 1 && said[0].starts_with(worst), "{said:?}");
    }
}
