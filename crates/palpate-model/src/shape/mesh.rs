//! Triangle meshes as shapes: distance by a bounding volume hierarchy, sign by generalized winding numbers, or, on clean meshes,
//! by the normal at the nearest point ([`super::pseudonormal`]).
//!
//! Jacobson, Kavan, Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013; hierarchical far
//! field after Barill, Dickson, Schmidt, Levin, Jacobson, "Fast winding numbers for soups and clouds", 2018 (its first term). Holes,
//! overlaps and touching parts, as scans have them, leave the sign defined everywhere.

use super::pseudonormal::{Feature, Pseudonormals};
use super::{Shape, TriMesh};
use glam::DVec3;
use std::f64::consts::PI;

/// Triangles per leaf.
const LEAF: usize = 4;

/// A cluster farther away than this many of its radii counts as one dipole; its error of order 1/9 of the cluster's own share stays
/// well away from the decision at ½ because clusters that near the point matter are opened.
const FAR: f64 = 3.0;

/// A triangle mesh with signed distance.
#[derive(Clone, Debug)]
pub struct MeshShape {
    mesh: TriMesh,
    corners: Vec<[DVec3; 3]>,
    numbers: Vec<u32>,
    tree: Vec<Node>,
    normals: Option<Pseudonormals>,
}

#[derive(Clone, Debug)]
struct Node {
    lo: DVec3,
    hi: DVec3,
    /// Range of triangles.
    range: (u32, u32),
    /// Number of the second child, the first follows directly; 0 for a leaf.
    second: u32,
    /// Sum of area vectors, their centre, and the greatest distance of a corner from it.
    dipole: DVec3,
    center: DVec3,
    radius: f64,
}

impl MeshShape {
    /// Prepares a mesh; an empty mesh has infinite distance everywhere.
    pub fn new(mesh: TriMesh) -> MeshShape {
        let mut shape = MeshShape::unsigned(mesh);
        shape.normals = Pseudonormals::of(&shape.mesh, &shape);
        shape
    }

    /// A mesh whose signs always come from winding numbers.
    pub(super) fn unsigned(mesh: TriMesh) -> MeshShape {
        let mut items: Vec<(u32, [DVec3; 3])> = (0..mesh.triangles.len()).map(|t| (t as u32, mesh.corners(t))).collect();
        let mut tree = Vec::new();
        if !items.is_empty() {
            build(&mut items, 0, &mut tree);
        }
        let (numbers, corners) = items.into_iter().unzip();
        MeshShape { mesh, corners, numbers, tree, normals: None }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// Nearest point of the mesh [m] and its triangle; `None` only for an empty mesh.
    pub fn closest(&self, p: DVec3) -> Option<(DVec3, usize)> {
        self.nearest(p).map(|(q, t, _)| (q, t))
    }

    fn nearest(&self, p: DVec3) -> Option<(DVec3, usize, Feature)> {
        let mut best = (f64::INFINITY, DVec3::ZERO, u32::MAX, Feature::Face);
        let mut stack = vec![(0.0, 0u32)];
        if self.tree.is_empty() {
            return None;
        }
        while let Some((bound, n)) = stack.pop() {
            if bound > best.0 {
                continue;
            }
            let node = &self.tree[n as usize];
            if node.second == 0 {
                for t in node.range.0..node.range.1 {
                    let (q, feature) = closest_on_triangle(p, self.corners[t as usize]);
                    let d = q.distance_squared(p);
                    let number = self.numbers[t as usize];
                    if d < best.0 || d == best.0 && number < best.2 {
                        best = (d, q, number, feature);
                    }
                }
            } else {
                let distance = |n: u32| {
                    let b = &self.tree[n as usize];
                    p.clamp(b.lo, b.hi).distance_squared(p)
                };
                let (a, b) = ((distance(n + 1), n + 1), (distance(node.second), node.second));
                // The nearer child is looked at first.
                let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
                stack.extend([far, near]);
            }
        }
        Some((best.1, best.2 as usize, best.3))
    }

    /// Visits the triangles whose bounding boxes' leaf touches the box `lo..hi`.
    pub(super) fn overlapping(&self, lo: DVec3, hi: DVec3, visit: &mut impl FnMut(usize)) {
        let mut stack = if self.tree.is_empty() { Vec::new() } else { vec![0u32] };
        while let Some(n) = stack.pop() {
            let node = &self.tree[n as usize];
            if node.lo.cmpgt(hi).any() || node.hi.cmplt(lo).any() {
                continue;
            }
            if node.second == 0 {
                (node.range.0..node.range.1).for_each(|t| visit(self.numbers[t as usize] as usize));
            } else {
                stack.extend([node.second, n + 1]);
            }
        }
    }

    /// Generalized winding number: 1 inside a closed mesh, 0 outside, between them near holes.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        let mut sum = 0.0;
        let mut stack = Vec::new();
        if !self.tree.is_empty() {
            stack.push(0u32);
        }
        while let Some(n) = stack.pop() {
            let node = &self.tree[n as usize];
            let d = node.center - p;
            let r = d.length();
            if r > FAR * node.radius {
                sum += node.dipole.dot(d) / (r * r * r);
            } else if node.second == 0 {
                sum += (node.range.0..node.range.1).map(|t| solid_angle(p, self.corners[t as usize])).sum::<f64>();
            } else {
                stack.extend([node.second, n + 1]);
            }
        }
        sum / (4.0 * PI)
    }
}

fn build(items: &mut [(u32, [DVec3; 3])], first: usize, tree: &mut Vec<Node>) {
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut dipole, mut center, mut area) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    let (mut clo, mut chi) = (lo, hi);
    for (_, c) in items.iter() {
        let vector = 0.5 * (c[1] - c[0]).cross(c[2] - c[0]);
        let middle = (c[0] + c[1] + c[2]) / 3.0;
        dipole += vector;
        center += middle * vector.length();
        area += vector.length();
        (clo, chi) = (clo.min(middle), chi.max(middle));
        for &p in c {
            (lo, hi) = (lo.min(p), hi.max(p));
        }
    }
    let center = if area > 0.0 { center / area } else { 0.5 * (lo + hi) };
    let radius = items.iter().flat_map(|(_, c)| c).map(|p| p.distance(center)).fold(0.0, f64::max);
    let here = tree.len();
    let range = (first as u32, (first + items.len()) as u32);
    tree.push(Node { lo, hi, range, second: 0, dipole, center, radius });
    if items.len() > LEAF {
        let axis = (chi - clo).max_position();
        let key = |c: &[DVec3; 3]| c[0][axis] + c[1][axis] + c[2][axis];
        // The triangle's number breaks ties, so that the tree is the same everywhere.
        items.sort_unstable_by(|a, b| key(&a.1).total_cmp(&key(&b.1)).then(a.0.cmp(&b.0)));
        let half = items.len() / 2;
        let (left, right) = items.split_at_mut(half);
        build(left, first, tree);
        tree[here].second = tree.len() as u32;
        build(right, first + half, tree);
    }
}

/// Signed solid angle of a triangle seen from `p` (van Oosterom and Strackee 1983); positive if its back is seen.
fn solid_angle(p: DVec3, t: [DVec3; 3]) -> f64 {
    let [a, b, c] = t.map(|v| v - p);
    let (x, y, z) = (a.length(), b.length(), c.length());
    let det = a.dot(b.cross(c));
    let div = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
    if det == 0.0 { 0.0 } else { 2.0 * det.atan2(div) }
}

/// Nearest point of a triangle and the feature it lies on (Ericson, Real-Time Collision Detection, 5.1.5: regions of corners, edges, face).
pub(super) fn closest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> (DVec3, Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Feature::Corner(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Feature::Corner(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Feature::Corner(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), Feature::Edge(1));
    }
    let sum = va + vb + vc;
    (a + ab * (vb / sum) + ac * (vc / sum), Feature::Face)
}

impl Shape for MeshShape {
    fn signed_distance(&self, p: DVec3) -> f64 {
        let Some((q, t, feature)) = self.nearest(p) else { return f64::INFINITY };
        let inside = match &self.normals {
            Some(n) => n.at(t, self.mesh.triangles[t], feature).dot(p - q) < 0.0,
            None => self.winding_number(p) > 0.5,
        };
        if inside { -q.distance(p) } else { q.distance(p) }
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        self.mesh.bounds()
    }

    fn surface(&self, edge: f64) -> TriMesh {
        self.mesh.refined(edge)
    }

    fn closest_point(&self, p: DVec3) -> DVec3 {
        self.closest(p).map_or(p, |(q, _)| q)
    }
}

#[cfg(test)]
#[path = "mesh_tests.rs"]
mod tests;
