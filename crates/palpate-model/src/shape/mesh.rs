//! Triangle meshes as shapes: distance by a bounding volume hierarchy, sign by generalized winding numbers, or, on clean meshes,
//! by the normal at the nearest point ([`super::pseudonormal`]).
//!
//! Jacobson, Kavan, Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013; hierarchical far
//! field after Barill, Dickson, Schmidt, Levin, Jacobson, "Fast winding numbers for soups and clouds", 2018 (its first term). Holes,
//! overlaps and touching parts, as scans have them, leave the sign defined everywhere.

use super::clusters::{Cluster, clusters};
use super::edges::EdgeUses;
use super::pseudonormal::{Feature, Pseudonormals};
use super::repair::{MeshReport, examine_in};
use super::turned::{Turned, turned};
use super::{Shape, TriMesh};
use glam::{DAffine3, DVec3};
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Triangles per leaf.
const LEAF: usize = 4;

/// Nodes with more triangles than this are worth a thread of their own.
pub(super) const ALONE: u32 = 4096;

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
    /// Boxes of small nodes along the surface, about `origin`; empty of a mesh that is only asked for winding numbers.
    turned: Vec<Turned>,
    origin: DVec3,
    /// What every node is from afar: made when a winding number is first asked for.
    far: OnceLock<Vec<Cluster>>,
    normals: Option<Pseudonormals>,
}

/// A node of the tree, in a flat array: 64 bytes, one line of the cache.
#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    lo: DVec3,
    hi: DVec3,
    /// Range of triangles.
    pub range: (u32, u32),
    /// Number of the second child, the first follows directly; 0 for a leaf.
    pub second: u32,
}

impl MeshShape {
    /// Prepares a mesh; an empty mesh has infinite distance everywhere.
    pub fn new(mesh: TriMesh) -> MeshShape {
        MeshShape::examined(mesh).0
    }

    /// The same with what is wrong with the mesh: both need the same tree and the same edges.
    pub fn examined(mesh: TriMesh) -> (MeshShape, MeshReport) {
        let mut shape = MeshShape::unsigned(mesh);
        let (report, normals) = examine_in(&shape.mesh, &shape);
        shape.normals = normals;
        shape.turned = turned(&shape.corners, &shape.tree, shape.origin);
        (shape, report)
    }

    /// The shape elsewhere; what was found clean stays so.
    pub fn placed(&self, pose: &DAffine3) -> MeshShape {
        let mut shape = MeshShape::unsigned(self.mesh.transformed(pose));
        shape.normals = self.normals.is_some().then(|| Pseudonormals::new(&shape.mesh, &EdgeUses::of(&shape.mesh)));
        shape.turned = turned(&shape.corners, &shape.tree, shape.origin);
        shape
    }

    /// A mesh whose signs always come from winding numbers.
    pub(super) fn unsigned(mesh: TriMesh) -> MeshShape {
        let corners = |t: u32| mesh.corners(t as usize);
        let mut items: Vec<(DVec3, u32)> = (0..mesh.triangles.len() as u32)
            .map(|t| {
                let [a, b, c] = corners(t);
                (a + b + c, t)
            })
            .collect();
        arrange(&mut items);
        let numbers: Vec<u32> = items.into_iter().map(|(_, t)| t).collect();
        let corners: Vec<[DVec3; 3]> = numbers.iter().map(|t| corners(*t)).collect();
        let count = if numbers.is_empty() { 0 } else { node_counts(numbers.len()).0 };
        let mut tree = vec![Node::default(); count];
        if count > 0 {
            fill(&corners, 0, 0, &mut tree);
        }
        let origin = tree.first().map_or(DVec3::ZERO, |n: &Node| 0.5 * (n.lo + n.hi));
        MeshShape { mesh, corners, numbers, tree, turned: Vec::new(), origin, far: OnceLock::new(), normals: None }
    }

    /// The mesh.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The mesh alone.
    pub fn into_mesh(self) -> TriMesh {
        self.mesh
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
        let from = p - self.origin;
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
                    if let Some(b) = self.turned.get(n as usize).filter(|b| b.is_there()) {
                        return b.gap(from);
                    }
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

    /// A triangle by its place in the tree, neighbours next to each other: corners [m] and numbers of the vertices.
    pub(super) fn triangle(&self, place: usize) -> ([DVec3; 3], [u32; 3]) {
        (self.corners[place], self.mesh.triangles[self.numbers[place] as usize])
    }

    /// Sum of what `look` says of every pair of triangles, by their places in the tree, whose bounding boxes come within `margin` [m] of each
    /// other; each pair once.
    pub(super) fn count_close(&self, margin: f64, look: &(impl Fn(usize, usize) -> usize + Sync)) -> usize {
        if self.tree.is_empty() { 0 } else { self.within(0, margin, look) }
    }

    /// Pairs in one node.
    fn within(&self, n: u32, margin: f64, look: &(impl Fn(usize, usize) -> usize + Sync)) -> usize {
        let node = &self.tree[n as usize];
        if node.second == 0 {
            let own = node.range.0..node.range.1;
            return own
                .clone()
                .flat_map(|s| (s + 1..own.end).map(move |t| (s, t)))
                .map(|(s, t)| self.pair(s, t, margin, look))
                .sum();
        }
        let (first, second) = (n + 1, node.second);
        let parts = || {
            let inner = both(node, || self.within(first, margin, look), || self.within(second, margin, look));
            inner.0 + inner.1
        };
        parts() + self.between(first, second, margin, look)
    }

    /// Pairs of one in each node.
    fn between(&self, m: u32, n: u32, margin: f64, look: &(impl Fn(usize, usize) -> usize + Sync)) -> usize {
        let (a, b) = (&self.tree[m as usize], &self.tree[n as usize]);
        if (a.lo - margin).cmpgt(b.hi).any() || (b.lo - margin).cmpgt(a.hi).any() {
            return 0;
        }
        let size = |x: &Node| x.range.1 - x.range.0;
        match (a.second, b.second) {
            (0, 0) => {
                let all = (a.range.0..a.range.1).flat_map(|s| (b.range.0..b.range.1).map(move |t| (s, t)));
                all.map(|(s, t)| self.pair(s, t, margin, look)).sum()
            }
            // The larger is opened.
            (0, second) => self.between(m, n + 1, margin, look) + self.between(m, second, margin, look),
            (second, other) if other == 0 || size(a) >= size(b) => {
                let (x, y) = both(a, || self.between(m + 1, n, margin, look), || self.between(second, n, margin, look));
                x + y
            }
            (_, second) => {
                let (x, y) = both(b, || self.between(m, n + 1, margin, look), || self.between(m, second, margin, look));
                x + y
            }
        }
    }

    /// Two triangles, by their places in the tree.
    fn pair(&self, s: u32, t: u32, margin: f64, look: &impl Fn(usize, usize) -> usize) -> usize {
        let ([a, b, c], [d, e, f]) = (self.corners[s as usize], self.corners[t as usize]);
        let apart =
            (a.min(b).min(c) - margin).cmpgt(d.max(e).max(f)).any() || (d.min(e).min(f) - margin).cmpgt(a.max(b).max(c)).any();
        if apart { 0 } else { look(s as usize, t as usize) }
    }

    /// Generalized winding number: 1 inside a closed mesh, 0 outside, between them near holes.
    pub fn winding_number(&self, p: DVec3) -> f64 {
        // Threads of a pool would wait for each other in here: it is made by one.
        let far = self.far.get_or_init(|| clusters(&self.corners, &self.tree));
        let mut sum = 0.0;
        let mut stack = Vec::new();
        if !self.tree.is_empty() {
            stack.push(0u32);
        }
        while let Some(n) = stack.pop() {
            let (node, cluster) = (&self.tree[n as usize], &far[n as usize]);
            let d = cluster.center - p;
            let r = d.length();
            if r > FAR * cluster.radius {
                sum += cluster.dipole.dot(d) / (r * r * r);
            } else if node.second == 0 {
                sum += (node.range.0..node.range.1).map(|t| solid_angle(p, self.corners[t as usize])).sum::<f64>();
            } else {
                stack.extend([node.second, n + 1]);
            }
        }
        sum / (4.0 * PI)
    }
}

/// Does two things at once where a node is large.
fn both<A: Send, B: Send>(node: &Node, one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B + Send) -> (A, B) {
    if node.range.1 - node.range.0 > ALONE { rayon::join(one, other) } else { (one(), other()) }
}

/// Nodes of the tree over n triangles, and over n + 1.
fn node_counts(n: usize) -> (usize, usize) {
    if n < LEAF {
        return (1, 1);
    }
    let (a, b) = node_counts(n / 2);
    let (own, next) = if n.is_multiple_of(2) { (1 + 2 * a, 1 + a + b) } else { (1 + a + b, 1 + 2 * b) };
    (if n <= LEAF { 1 } else { own }, next)
}

/// Orders triangles, given as three times their middles and their numbers, so that each node of the tree has a range of them.
fn arrange(items: &mut [(DVec3, u32)]) {
    if items.len() <= LEAF {
        return;
    }
    let middles = items.iter().map(|(sum, _)| *sum / 3.0);
    let (lo, hi) = middles.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let axis = (hi - lo).max_position();
    let half = items.len() / 2;
    // The triangle's number breaks ties, so that the tree is the same everywhere.
    items.select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let large = items.len() as u32 > ALONE;
    let (left, right) = items.split_at_mut(half);
    if large {
        rayon::join(|| arrange(left), || arrange(right));
    } else {
        arrange(left);
        arrange(right);
    }
}

/// Fills in the nodes over a range of triangles, which begins at `first` of all; `number` is the place of the node among all.
fn fill(corners: &[[DVec3; 3]], first: usize, number: usize, tree: &mut [Node]) {
    let (here, below) = tree.split_first_mut().expect("every range has a node");
    here.range = (first as u32, (first + corners.len()) as u32);
    if corners.len() <= LEAF {
        let ends = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        (here.lo, here.hi) = corners.iter().flatten().fold(ends, |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        return;
    }
    let half = corners.len() / 2;
    let of_first = node_counts(half).0;
    here.second = (number + 1 + of_first) as u32;
    let (left, right) = below.split_at_mut(of_first);
    both(
        here,
        || fill(&corners[..half], first, number + 1, left),
        || fill(&corners[half..], first + half, number + 1 + of_first, right),
    );
    let (one, other) = (&below[0], &below[of_first]);
    (here.lo, here.hi) = (one.lo.min(other.lo), one.hi.max(other.hi));
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
