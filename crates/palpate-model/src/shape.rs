//! Rest shapes as signed distances: analytic bodies and triangle meshes.

mod analytic;
pub mod cloud;
pub(crate) mod components;
mod contacts;
mod edges;
mod joining;
mod marching;
mod mesh;
mod pseudonormal;
mod repair;
mod trimesh;

pub use analytic::Placed;
pub use mesh::MeshShape;
pub use repair::{MeshReport, Repaired, diagnose, repair};
pub use trimesh::TriMesh;

use crate::scene::{BodySource, Object};
use glam::DVec3;
use std::sync::Arc;

/// Longest side from which on an object may be one in another unit [m]: soft bodies in front of cameras are smaller.
pub const LARGE: f64 = 3.0;

/// What is added to an error about too many cells where the object's longest side [m] says that its unit is to blame, not its cells.
pub fn unit_hint(longest: f64) -> &'static str {
    if longest < LARGE {
        ""
    } else {
        "; is the object in millimetres or centimetres? convert it to metres (scale by 0.001 or 0.01)"
    }
}

/// A closed body given by its signed distance.
pub trait Shape: Send + Sync + std::fmt::Debug {
    /// Signed distance to the surface [m], negative inside.
    fn signed_distance(&self, p: DVec3) -> f64;
    /// Corners (min, max) of the axis-aligned bounding box [m].
    fn bounds(&self) -> (DVec3, DVec3);
    /// A triangle mesh of the surface, edges about `edge` long or shorter [m].
    fn surface(&self, edge: f64) -> TriMesh;

    /// A nearest point of the surface [m]; where several are equally near, one of them.
    /// The default follows the distance's gradient and is meant for sampled distances; exact shapes have closed forms.
    fn closest_point(&self, p: DVec3) -> DVec3 {
        let (lo, hi) = self.bounds();
        let size = (hi - lo).length();
        // Small against any cell, large against rounding.
        let step = 1e-6 * size;
        let mut x = p;
        for round in 0..20 {
            let d = self.signed_distance(x);
            if d.abs() <= 1e-8 * size {
                break;
            }
            let slope = |e: DVec3| self.signed_distance(x + e * step) - self.signed_distance(x - e * step);
            let g = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)) / (2.0 * step);
            if g.length() > 0.5 {
                x -= g.normalize() * d;
            } else {
                // Several surface points are equally near here: step aside towards one of them.
                x += DVec3::new(0.37, 0.61, 0.7) * (1e-4 * size * f64::from(round + 1));
            }
        }
        x
    }
}

/// The rest shape of a scene's object, placed by its pose.
pub fn shape_of(object: &Object) -> Arc<dyn Shape> {
    match &object.source {
        BodySource::Mesh { mesh, .. } => Arc::new(MeshShape::new(mesh.transformed(&object.pose))),
        BodySource::Tetrahedra { surface, .. } => Arc::new(MeshShape::new(surface.transformed(&object.pose))),
        BodySource::Cloud(cloud) => shape_of(&Object { source: cloud.hull.clone(), ..object.clone() }),
        BodySource::Analytic(body) => Arc::new(Placed::new(body.clone(), object.pose)),
    }
}
