//! Rest shapes as signed distances: analytic bodies and triangle meshes.

use glam::DVec3;

/// A closed body given by its signed distance.
pub trait Shape: Send + Sync + std::fmt::Debug {
    /// Signed distance to the surface [m], negative inside.
    fn signed_distance(&self, p: DVec3) -> f64;
    /// Corners (min, max) of the axis-aligned bounding box [m].
    fn bounds(&self) -> (DVec3, DVec3);
    /// A triangle mesh of the surface, edges about `edge` long or shorter [m] where the shape is curved.
    fn surface(&self, edge: f64) -> TriMesh;
}

/// A triangle mesh; triangles counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertex positions [m].
    pub vertices: Vec<DVec3>,
    /// Vertex numbers of each triangle.
    pub triangles: Vec<[u32; 3]>,
}
