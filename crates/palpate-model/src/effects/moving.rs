//! Rigid things beside the body that move as a file says: obstacles and nozzles.

use crate::mechanics::distance_grid::DistanceGrid;
use crate::mechanics::motion::RigidMotion;
use crate::shape::{Shape, TriMesh};
use glam::DVec3;
use std::sync::Arc;

/// A rigid thing and its motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moving {
    /// From its own coordinates into the world; without samples it stands where these are.
    pub motion: RigidMotion,
    /// Its shape in its own coordinates, of an obstacle.
    pub shape: Option<Arc<Obstacle>>,
    /// Unit vector that it blows along, in its own coordinates, of a nozzle.
    pub axis: DVec3,
}

impl Moving {
    /// An obstacle, its distance sampled every `spacing` [m].
    pub fn obstacle(shape: &dyn Shape, spacing: f64, motion: RigidMotion) -> Moving {
        let solid = Obstacle { distance: DistanceGrid::new(shape, spacing), surface: shape.surface(spacing) };
        Moving { motion, shape: Some(Arc::new(solid)), axis: DVec3::ZERO }
    }

    /// A nozzle that blows along `axis` (any length).
    pub fn nozzle(axis: DVec3, motion: RigidMotion) -> Moving {
        Moving { motion, shape: None, axis: axis.normalize_or_zero() }
    }
}

/// The shape of an obstacle, in its own coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Signed distance.
    pub distance: DistanceGrid,
    /// Its surface, for pictures and for what hides between the patches of a body [m].
    pub surface: TriMesh,
}
