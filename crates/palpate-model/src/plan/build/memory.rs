//! How much memory making a plan takes, before anything is made.

use super::{band_cells, tets};
use crate::cutcells::build::{filled, memory};
use crate::scene::{BodySource, Resolution, Scene};
use crate::shape::Shape;
use crate::space::stuffing::fitted;
use crate::space::tets::Tetrahedron;

/// Tetrahedra in a cube of their longest edge, those that are warped to the surface included.
const PER_CUBE: f64 = 13.5;

/// Memory of a point of a cloud over N^(1/3) of all N [B]: of the sparse factor that makes their weights compatible, which grows so (George 1973).
const STAR: f64 = 8e2;

/// Memory that a tetrahedron takes at most while a body and the pattern of its matrix are made [B]: a linear one has one elastic point with four
/// nodes, a quadratic one five with ten.
fn of_one(kind: Tetrahedron) -> f64 {
    match kind {
        Tetrahedron::Linear => 4.2e2,
        Tetrahedron::Quadratic => 3.5e3,
    }
}

/// Memory that making the plan of a scene takes at its peak [B], an estimate before anything is made; `None` where the size of its elements is
/// left open, or will be refused.
pub fn plan_memory(scene: &Scene, shape: &dyn Shape) -> Option<f64> {
    let (min, max) = shape.bounds();
    let volume = || (max - min).element_product() * filled(shape, min, max - min, 0.0);
    let cut = |h: f64| memory(shape, h, band_cells(scene) * h);
    let band = |h: f64| if scene.observation.is_some() { cut(h) } else { Some(0.0) };
    match (&scene.object.source, scene.object.resolution) {
        (BodySource::Cloud(cloud), _) => {
            let n = cloud.points.len() as f64;
            Some(STAR * n.powf(4.0 / 3.0) + band((volume() / n).cbrt())?)
        }
        (BodySource::Tetrahedra { mesh, .. }, _) => {
            let n = mesh.tets.len() as f64;
            Some(n * of_one(scene.solver.tetrahedron) + band((6.0 * mesh.volume() / n).cbrt())?)
        }
        (_, Resolution::Edge(edge)) => {
            // What the volume is measured with is gone when the body is made.
            let measured = memory(shape, tets::reference(min, max, edge), 0.0)?;
            let edge = fitted(max - min, edge);
            let n = PER_CUBE * volume() / edge.powi(3);
            Some((n * of_one(scene.solver.tetrahedron) + band((6.0 / PER_CUBE).cbrt() * edge)?).max(measured))
        }
        (_, Resolution::CellSize(h)) => cut(h),
        (_, Resolution::Cells(n)) => cut((max - min).max_element() / f64::from(n)),
        (_, Resolution::Own | Resolution::Open | Resolution::OpenEdge) => None,
    }
}
