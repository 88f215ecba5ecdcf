//! Every scalar residual of a simulation by itself, with its sensitivities: what statistics on a fit need beyond sums.

use crate::evaluate::Evaluation;
use glam::DVec3;

/// Where a scalar residual comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Source {
    /// A point of a depth image.
    Point {
        /// Its number in the frame.
        point: u32,
        /// Its camera.
        camera: u32,
    },
    /// One coordinate of a marker.
    Marker {
        /// The marker's site in the observation.
        site: u32,
        /// Coordinate, 0 to 2.
        axis: u8,
    },
    /// One coordinate of a directly observed node.
    Node {
        /// The node.
        node: u32,
        /// Coordinate, 0 to 2.
        axis: u8,
    },
}

/// One scalar residual r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualRow {
    /// Number of the frame in the plan's observation.
    pub frame: usize,
    /// What was measured.
    pub source: Source,
    /// Signed distance or coordinate, simulated minus measured for the latter [m]; `None` for a point that met nothing.
    pub value: Option<f64>,
    /// Stated standard deviation of the measurement [m], which divides the residual in the cost.
    pub noise: f64,
    /// Robust weight ρ′(r)/r, 0 to 1; 0 for a point that met nothing.
    pub weight: f64,
    /// Place of the measurement on the rest shape [m]; the measured place itself where it met nothing.
    pub rest: DVec3,
    /// Change of the residual per metre that the point moves away from its camera along the line of sight (1 for coordinates): noise
    /// along the line of sight reaches the residual multiplied by it.
    pub along_sight: f64,
    /// ∂r by the measured place in the world; zero for a point that met nothing.
    pub by_place: DVec3,
}

/// Residuals of one or several frames with their sensitivities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rows {
    /// The residuals `[R]`, frame by frame: points in the frame's order, then markers, then nodes.
    pub residuals: Vec<ResidualRow>,
    /// ∂r/∂θ of every residual along the tangent directions `[R, Q]`; zero where a point met nothing.
    pub sensitivity: Vec<f64>,
}

/// A simulation's residuals and their first derivatives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linearised {
    /// Cost and sums.
    pub evaluation: Evaluation,
    /// Places in θ that the columns belong to `[Q]`.
    pub directions: Vec<usize>,
    /// All rows, ordered by frame.
    pub rows: Rows,
}
