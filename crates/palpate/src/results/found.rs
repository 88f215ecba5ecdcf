//! What a fit found beside numbers and fields: curves of stiffness, normals of planes.

use serde::{Deserialize, Serialize};

/// A curve of stiffness.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundCurve {
    /// Its path in the scene.
    pub path: String,
    /// Number of the scene.
    pub scene: usize,
    /// Stretches, or ratios of volumes, of the corners.
    pub corners: Vec<f64>,
    /// Factors there, over the stiffness at rest.
    pub factors: Vec<f64>,
    /// Their standard errors; `None` where there is none.
    pub errors: Vec<Option<f64>>,
    /// Smallest and largest that occurred in the motion: of corners far beyond it says nothing.
    pub range: [f64; 2],
}

/// The normal of a plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundNormal {
    /// Its path in the scene, `plane.0.normal`.
    pub path: String,
    /// Number of the scene.
    pub scene: usize,
    /// Unit vector out of the forbidden half-space, as `model.toml` states it.
    pub normal: [f64; 3],
    /// Standard error of its direction [rad], by noise alone; `None` where there is none.
    pub standard_error: Option<f64>,
}
