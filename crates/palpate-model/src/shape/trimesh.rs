//! Triangle meshes: measures, placement and refinement.

use glam::{DAffine3, DVec3};

/// A triangle mesh; triangles counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions [m].
    pub vertices: Vec<DVec3>,
    /// Vertex numbers of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Corners of triangle `t` [m].
    pub fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// Corners (min, max) of the axis-aligned bounding box [m]; infinite and inverted for an empty mesh.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let used = self.triangles.iter().flatten().map(|&v| self.vertices[v as usize]);
        used.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)))
    }

    /// Length of the bounding box's diagonal [m]; 0 for an empty mesh.
    pub fn size(&self) -> f64 {
        let (lo, hi) = self.bounds();
        if lo.x <= hi.x { (hi - lo).length() } else { 0.0 }
    }

    /// Signed volume enclosed [m³] (divergence theorem about the first vertex); negative if the mesh is inside out.
    pub fn volume(&self) -> f64 {
        let o = self.vertices.first().copied().unwrap_or_default();
        let six: f64 = (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - o);
                a.dot(b.cross(c))
            })
            .sum();
        six / 6.0
    }

    /// Surface area [m²].
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| triangle_area(self.corners(t))).sum()
    }

    /// Centroid of the enclosed volume [m]; of the surface where no volume is enclosed.
    pub fn centroid(&self) -> DVec3 {
        let o = self.vertices.first().copied().unwrap_or_default();
        let (mut six, mut moment, mut area, mut surface) = (0.0, DVec3::ZERO, 0.0, DVec3::ZERO);
        for t in 0..self.triangles.len() {
            let [a, b, c] = self.corners(t).map(|p| p - o);
            let d = a.dot(b.cross(c));
            six += d;
            moment += (a + b + c) * (d / 4.0);
            let s = triangle_area([a, b, c]);
            area += s;
            surface += (a + b + c) * (s / 3.0);
        }
        if six.abs() > 1e-12 * self.size().powi(3) {
            o + moment / six
        } else if area > 0.0 {
            o + surface / area
        } else {
            o
        }
    }

    /// The mesh placed by a transform; a mirroring transform also turns the triangles round.
    pub fn transformed(&self, pose: &DAffine3) -> TriMesh {
        let mirror = pose.matrix3.determinant() < 0.0;
        TriMesh {
            vertices: self.vertices.iter().map(|&p| pose.transform_point3(p)).collect(),
            triangles: self.triangles.iter().map(|&[a, b, c]| if mirror { [a, c, b] } else { [a, b, c] }).collect(),
        }
    }

    /// Every undirected edge once, as (smaller, larger) vertex number, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> =
            self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// The same surface with every edge at most `edge` [m] long: longer edges are halved, neighbours stay joined.
    pub fn refined(&self, edge: f64) -> TriMesh {
        self.refined_by(|a, b| a.distance(b) > edge, |a, b| 0.5 * (a + b))
    }

    /// Splits edges chosen by `long` at the point `middle` until none is left; the choice depends on the edge alone, so that both
    /// neighbours of an edge agree and a watertight mesh stays watertight.
    pub(super) fn refined_by(&self, long: impl Fn(DVec3, DVec3) -> bool, middle: impl Fn(DVec3, DVec3) -> DVec3) -> TriMesh {
        let mut mesh = self.clone();
        // Every pass halves the long edges; 24 passes shrink them 10⁷-fold.
        for _ in 0..24 {
            // Of a fine mesh few are long, and only these need be sorted.
            let sides = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).map(|[a, b]| [a.min(b), a.max(b)]);
            let mut split: Vec<[u32; 2]> =
                sides.filter(|&[a, b]| long(mesh.vertices[a as usize], mesh.vertices[b as usize])).collect();
            split.sort_unstable();
            split.dedup();
            if split.is_empty() {
                break;
            }
            let first = mesh.vertices.len() as u32;
            for &[a, b] in &split {
                mesh.vertices.push(middle(mesh.vertices[a as usize], mesh.vertices[b as usize]));
            }
            let mid = |a: u32, b: u32| split.binary_search(&[a.min(b), a.max(b)]).ok().map(|i| first + i as u32);
            let mut triangles = Vec::with_capacity(2 * mesh.triangles.len());
            for &t in &mesh.triangles {
                split_triangle(t, [mid(t[0], t[1]), mid(t[1], t[2]), mid(t[2], t[0])], &mut triangles);
            }
            mesh.triangles = triangles;
        }
        mesh
    }
}

/// Splits a triangle at the given middles of its edges (01, 12, 20).
fn split_triangle(t: [u32; 3], mid: [Option<u32>; 3], out: &mut Vec<[u32; 3]>) {
    // Turn the triangle until the pattern of split edges is one of four.
    for r in 0..3 {
        let v = |i: usize| t[(r + i) % 3];
        let m = |i: usize| mid[(r + i) % 3];
        match (m(0), m(1), m(2)) {
            (None, None, None) => return out.push(t),
            (Some(a), None, None) => return out.extend([[v(0), a, v(2)], [a, v(1), v(2)]]),
            (Some(a), Some(b), None) => return out.extend([[a, v(1), b], [v(0), a, b], [v(0), b, v(2)]]),
            (Some(a), Some(b), Some(c)) => return out.extend([[v(0), a, c], [a, v(1), b], [c, b, v(2)], [a, b, c]]),
            _ => {}
        }
    }
}

/// Area of a triangle [m²].
pub(super) fn triangle_area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}
