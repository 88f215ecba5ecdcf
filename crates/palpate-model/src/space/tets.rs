//! Bodies of tetrahedra: nodes, elastic points, surface and masses of a mesh, with linear elements (`tet4`) or quadratic ones (`tet10`), and which
//! element carries a place.
//!
//! A quadratic element has a node in the middle of every edge and straight sides. Its stiffness is integrated selectively ([`Share`]): at four
//! points of a quarter of the volume each, and at one that takes the element's mean.

use crate::shape::MeshShape;
use crate::space::body::{Body, Patch};
use crate::space::points::{Points, TetMesh};
use crate::space::stencil::{Stencil, StencilBuf, Stencils};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Which tetrahedra a body is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tetrahedron {
    /// Linear: stiff in bending, and stiffer the closer Poisson's ratio is to one half.
    Linear,
    /// Quadratic, with the mean dilatation of an element alone bearing the bulk modulus.
    #[default]
    Quadratic,
}

/// Ends of the edges that hold nodes 4 to 9, as VTK counts them (`VTK_QUADRATIC_TETRA`; Gmsh swaps the last two).
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

/// Barycentric coordinates of the four points of the rule of second degree, (5 + 3√5)/20 and (5 − √5)/20 (Hammer, Marlowe & Stroud 1956).
const POINT: [f64; 2] = [0.585_410_196_624_968_5, 0.138_196_601_125_010_5];

/// Shape functions of a quadratic tetrahedron at a place of these barycentric coordinates, corners first.
pub fn quadratic(l: [f64; 4]) -> [f64; 10] {
    std::array::from_fn(|k| match k {
        0..4 => l[k] * (2.0 * l[k] - 1.0),
        _ => 4.0 * l[EDGES[k - 4][0]] * l[EDGES[k - 4][1]],
    })
}

/// Their gradients [1/m], for the gradients of the barycentric coordinates.
fn quadratic_slopes(l: [f64; 4], g: [DVec3; 4]) -> [DVec3; 10] {
    std::array::from_fn(|k| match k {
        0..4 => (4.0 * l[k] - 1.0) * g[k],
        _ => {
            let [a, b] = EDGES[k - 4];
            4.0 * (l[a] * g[b] + l[b] * g[a])
        }
    })
}

/// Gradients of the barycentric coordinates of a tetrahedron [1/m].
fn barycentric_slopes(x: [DVec3; 4]) -> [DVec3; 4] {
    let edges = DMat3::from_cols(x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let inverse = edges.inverse().transpose();
    let others = [inverse.x_axis, inverse.y_axis, inverse.z_axis];
    [-(others[0] + others[1] + others[2]), others[0], others[1], others[2]]
}

/// The mesh with a node in the middle of every edge, and ten nodes to a tetrahedron: the new ones follow the corners, in the order of their ends.
fn with_edges(mesh: &TetMesh) -> (Vec<DVec3>, Vec<[u32; 10]>) {
    let key = |t: &[u32; 4], [a, b]: [usize; 2]| (t[a].min(t[b]), t[a].max(t[b]));
    let mut number: BTreeMap<(u32, u32), u32> = mesh.tets.iter().flat_map(|t| EDGES.map(|e| (key(t, e), 0))).collect();
    let mut nodes = mesh.nodes.clone();
    for ((a, b), n) in &mut number {
        *n = nodes.len() as u32;
        nodes.push(0.5 * (mesh.nodes[*a as usize] + mesh.nodes[*b as usize]));
    }
    let all = |t: &[u32; 4]| {
        std::array::from_fn(|k| match k {
            0..4 => t[k],
            _ => number[&key(t, EDGES[k - 4])],
        })
    };
    (nodes, mesh.tets.iter().map(all).collect())
}

/// Nodes, elastic points and surface of a body in the making.
struct Parts {
    nodes: Vec<DVec3>,
    points: Points,
    patches: Vec<Patch>,
    surface: Stencils,
}

impl Parts {
    /// A flat piece of the surface with its mean place.
    fn push_patch(&mut self, cell: u32, corners: [DVec3; 3], nodes: &[u32], weights: &[f64]) {
        let [a, b, c] = corners;
        let twice = (b - a).cross(c - a);
        self.surface.push(nodes, weights);
        self.patches.push(Patch { cell, area: 0.5 * twice.length(), normal: twice.normalize(), point: (a + b + c) / 3.0 });
    }
}

fn linear_parts(mesh: &TetMesh) -> Parts {
    let points = Points::with_capacity(1, mesh.tets.len(), 4);
    let mut parts = Parts { nodes: mesh.nodes.clone(), points, patches: Vec::new(), surface: Stencils::default() };
    for t in &mesh.tets {
        let gradient = barycentric_slopes(t.map(|n| mesh.nodes[n as usize]));
        parts.points.stencils.push_with_gradient(t, &[0.25; 4], &gradient);
        parts.points.volume.push(mesh.six_volumes(*t) / 6.0);
    }
    for (element, face) in mesh.faces() {
        parts.push_patch(element, face.map(|n| mesh.nodes[n as usize]), &face, &[1.0 / 3.0; 3]);
    }
    parts
}

fn quadratic_parts(mesh: &TetMesh) -> Parts {
    let (nodes, tets) = with_edges(mesh);
    let points = Points::with_capacity(5, tets.len(), 10);
    let mut parts = Parts { nodes, points, patches: Vec::new(), surface: Stencils::default() };
    for t in &tets {
        let corners = [t[0], t[1], t[2], t[3]];
        let slopes = barycentric_slopes(corners.map(|n| mesh.nodes[n as usize]));
        let volume = mesh.six_volumes(corners) / 6.0;
        for k in 0..4 {
            let l = std::array::from_fn(|i| POINT[usize::from(i != k)]);
            parts.points.stencils.push_with_gradient(t, &quadratic(l), &quadratic_slopes(l, slopes));
            parts.points.volume.push(0.25 * volume);
        }
        // Means over the element: of the functions −1/20 and 1/5, of their gradients those at the centre.
        let means: [f64; 10] = std::array::from_fn(|k| if k < 4 { -0.05 } else { 0.2 });
        parts.points.stencils.push_with_gradient(t, &means, &quadratic_slopes([0.25; 4], slopes));
        parts.points.volume.push(volume);
    }
    for (element, face) in mesh.faces() {
        let t = tets[element as usize];
        let corner = face.map(|n| t.iter().position(|m| *m == n).expect("a face's nodes are its element's"));
        // The node between corners i and j of the face.
        let between = |i: usize, j: usize| {
            let [a, b] = [corner[i], corner[j]];
            let edge = EDGES.iter().position(|e| *e == [a, b] || *e == [b, a]).expect("corners share an edge");
            t[4 + edge]
        };
        let six = [face[0], face[1], face[2], between(0, 1), between(1, 2), between(2, 0)];
        let x = six.map(|n| parts.nodes[n as usize]);
        // Four triangles between corners and middles of the sides, with the means of the six functions over each.
        for (quarter, weights) in QUARTERS {
            parts.push_patch(element, quarter.map(|i| x[i]), &six, &weights.map(|w| f64::from(w) / 12.0));
        }
    }
    parts
}

/// Corners of the quarters of a face among its six nodes (corners, then middles of the sides 01, 12, 20), and twelve times the mean of each
/// node's function over them.
const QUARTERS: [([usize; 3], [i8; 6]); 4] = [
    ([0, 3, 5], [3, -1, -1, 5, 1, 5]),
    ([3, 1, 4], [-1, 3, -1, 5, 5, 1]),
    ([5, 4, 2], [-1, -1, 3, 1, 5, 5]),
    ([3, 4, 5], [-1, -1, -1, 5, 5, 5]),
];

impl Body {
    /// A body of a mesh's tetrahedra.
    pub fn of_tets(mesh: &TetMesh, kind: Tetrahedron) -> Body {
        let Parts { nodes, points, patches, surface } = match kind {
            Tetrahedron::Linear => linear_parts(mesh),
            Tetrahedron::Quadratic => quadratic_parts(mesh),
        };
        let volumes = || (0..points.elements()).map(|e| points.element_volume(e));
        let volume: f64 = volumes().sum();
        let center = points.means().zip(volumes()).map(|(s, v)| s.at(&nodes) * v).sum::<DVec3>() / volume;
        let mut node_volume = vec![0.0; nodes.len()];
        for (s, v) in points.means().zip(volumes()) {
            s.nodes.iter().zip(lumped(s.nodes.len())).for_each(|(n, part)| node_volume[*n as usize] += part * v);
        }
        let low = nodes.iter().copied().reduce(DVec3::min).unwrap_or(center);
        let high = nodes.iter().copied().reduce(DVec3::max).unwrap_or(center);
        Body {
            length: (6.0 * volume / points.elements() as f64).cbrt(),
            nodes,
            node_volume,
            area: patches.iter().map(|p| p.area).sum(),
            patches,
            surface,
            cut: None,
            points,
            band: Default::default(),
            volume,
            center,
            corners: (low, high),
        }
    }
}

/// Shares of an element's volume that its nodes have where one number a node is wanted, all positive: the diagonal of the mass matrix, scaled to
/// the whole (Hinton, Rock & Zienkiewicz 1976). ∫ N itself is negative at the corners of a quadratic element.
pub fn lumped(nodes: usize) -> &'static [f64] {
    const CORNER: f64 = 1.0 / 36.0;
    const EDGE: f64 = 4.0 / 27.0;
    const QUADRATIC: [f64; 10] = [CORNER, CORNER, CORNER, CORNER, EDGE, EDGE, EDGE, EDGE, EDGE, EDGE];
    match nodes {
        1 => &[1.0],
        4 => &[0.25; 4],
        _ => &QUADRATIC,
    }
}

/// Mean over an element of a number per node, with these shares.
pub fn lumped_mean(element: &Stencil, of_nodes: &[f64]) -> f64 {
    element.nodes.iter().zip(lumped(element.nodes.len())).map(|(n, w)| w * of_nodes[*n as usize]).sum()
}

/// ∫ N_i N_j over a tetrahedron of so many nodes, over its volume: exact, and positive definite. A single node has all.
pub fn mass(nodes: usize, i: usize, j: usize) -> f64 {
    match nodes {
        1 => return 1.0,
        4 => return if i == j { 0.1 } else { 0.05 },
        _ => {}
    }
    let ends = |k: usize| if k < 4 { [k, k] } else { EDGES[k - 4] };
    let [[a, b], [c, d]] = [ends(i), ends(j)];
    let shared = usize::from(a == c || a == d) + usize::from(a != b && (b == c || b == d));
    let number = match (i < 4, j < 4) {
        (true, true) => [1, 6][shared],
        (false, false) => [8, 16, 32][shared],
        _ => [-6, -4][shared],
    };
    f64::from(number) / 420.0
}

/// Finds the element that carries a place, on a body of tetrahedra.
pub struct TetLookup<'a> {
    body: &'a Body,
    /// Corner of the lowest bucket, and edge of a bucket [m].
    low: DVec3,
    edge: f64,
    /// Buckets along each axis.
    size: [usize; 3],
    /// Elements whose boxes meet a bucket, increasing, by bucket.
    buckets: Vec<Vec<u32>>,
    /// The surface's triangles between corners, each with its element.
    surface: MeshShape,
    elements: Vec<u32>,
}

impl<'a> TetLookup<'a> {
    /// Sorts the elements into buckets.
    pub fn new(body: &'a Body) -> TetLookup<'a> {
        let (low, high) = body.corners;
        let edge = 1.5 * body.length;
        let size = ((high - low) / edge).to_array().map(|n| n.floor() as usize + 1);
        let mut all = TetLookup {
            body,
            low,
            edge,
            size,
            buckets: vec![Vec::new(); size[0] * size[1] * size[2]],
            surface: MeshShape::new(Default::default()),
            elements: Vec::new(),
        };
        let mut mesh = TetMesh { nodes: body.nodes.clone(), ..TetMesh::default() };
        for e in 0..body.points.elements() {
            let t = all.corners(e as u32);
            mesh.tets.push(t);
            let x = t.map(|n| body.nodes[n as usize]);
            let [from, to] =
                [x.into_iter().reduce(DVec3::min), x.into_iter().reduce(DVec3::max)].map(|x| all.bucket(x.unwrap_or(low)));
            for k in from[2]..=to[2] {
                for j in from[1]..=to[1] {
                    (from[0]..=to[0]).for_each(|i| all.buckets[i + size[0] * (j + size[1] * k)].push(e as u32));
                }
            }
        }
        all.elements = mesh.faces().into_iter().map(|f| f.0).collect();
        all.surface = MeshShape::new(mesh.surface());
        all
    }

    fn corners(&self, e: u32) -> [u32; 4] {
        let nodes = self.body.points.mean(e as usize).nodes;
        [nodes[0], nodes[1], nodes[2], nodes[3]]
    }

    /// Bucket of a place, or the nearest.
    fn bucket(&self, x: DVec3) -> [usize; 3] {
        let at = (x - self.low) / self.edge;
        std::array::from_fn(|a| (at[a].max(0.0) as usize).min(self.size[a] - 1))
    }

    /// Barycentric coordinates of a place in an element, and their gradients.
    fn coordinates(&self, e: u32, place: DVec3) -> ([f64; 4], [DVec3; 4]) {
        let x = self.corners(e).map(|n| self.body.nodes[n as usize]);
        let slopes = barycentric_slopes(x);
        let mut l: [f64; 4] = std::array::from_fn(|k| slopes[k].dot(place - x[0]));
        l[0] += 1.0;
        (l, slopes)
    }

    /// Weights and gradients of an element's nodes at a place within it.
    fn stencil(&self, e: u32, (l, slopes): ([f64; 4], [DVec3; 4])) -> StencilBuf {
        let nodes = self.body.points.mean(e as usize).nodes;
        if nodes.len() == 4 {
            return StencilBuf { nodes: nodes.to_vec(), value: l.to_vec(), gradient: slopes.to_vec() };
        }
        StencilBuf { nodes: nodes.to_vec(), value: quadratic(l).to_vec(), gradient: quadratic_slopes(l, slopes).to_vec() }
    }

    /// The element that holds a place.
    fn holding(&self, place: DVec3) -> Option<StencilBuf> {
        // Rounding: a place on a face belongs to one of both sides.
        const SLACK: f64 = 1e-9;
        let [i, j, k] = self.bucket(place);
        let least = |l: &[f64; 4]| l.iter().copied().fold(f64::INFINITY, f64::min);
        let found = self.buckets[i + self.size[0] * (j + self.size[1] * k)].iter().map(|e| (*e, self.coordinates(*e, place)));
        found.into_iter().find(|(_, c)| least(&c.0) >= -SLACK).map(|(e, c)| self.stencil(e, c))
    }

    /// The field of the element that holds a place; outside, that of the nearest place of the surface, continued by its gradient there. And how
    /// far outside it is [m], zero inside.
    pub fn carry(&self, place: DVec3) -> (StencilBuf, f64) {
        if let Some(inside) = self.holding(place) {
            return (inside, 0.0);
        }
        let Some((nearest, triangle)) = self.surface.closest(place) else { return Default::default() };
        let e = self.elements[triangle];
        let mut s = self.stencil(e, self.coordinates(e, nearest));
        let away = place - nearest;
        s.value.iter_mut().zip(&s.gradient).for_each(|(w, g)| *w += g.dot(away));
        (s, away.length())
    }
}

#[cfg(test)]
#[path = "tets_tests.rs"]
mod tests;
