//! Cameras, and what was seen at one time.

use crate::effects::reading::Seen;
use glam::DVec3;

/// A camera's place and direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Centre of projection in the world [m].
    pub center: DVec3,
    /// Unit vector along which depth counts.
    pub axis: DVec3,
}

impl Camera {
    /// A reading of this camera at a world point [m].
    pub fn sees(&self, point: DVec3) -> Seen<f64> {
        Seen { point: point.to_array(), center: self.center.to_array(), axis: self.axis.to_array() }
    }
}

/// What was seen at one time.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Points of depth images.
    pub points: Vec<ObservedPoint>,
    /// Markers and tracked points.
    pub markers: Vec<ObservedMarker>,
    /// Displacements of simulation nodes, by rising node.
    pub displacements: Vec<ObservedDisplacement>,
    /// Standard deviation of its markers and tracked points [m], where it is not that of their channel.
    pub noise: Option<f64>,
    /// Time [s] that velocities are multiplied by, of a frame that compares the way a point makes in it instead of its displacement.
    pub drift: Option<f64>,
}

impl Frame {
    /// Number of scalar residuals (a point counts 1, a marker or node 3).
    pub fn residuals(&self) -> usize {
        self.points.len() + 3 * (self.markers.len() + self.displacements.len())
    }
}

/// One pixel of a depth image as a world point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedPoint {
    /// World position [m].
    pub position: DVec3,
    /// Number of the camera in [`super::Observation::cameras`].
    pub camera: u32,
}

/// Displacement of one simulation node at one time, as another simulator or a tracker of the whole body gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedDisplacement {
    /// The node.
    pub node: u32,
    /// Its displacement [m].
    pub value: DVec3,
}

impl ObservedDisplacement {
    /// Displacements [m] of all nodes `[N]`.
    pub fn of_all(values: impl IntoIterator<Item = DVec3>) -> Vec<ObservedDisplacement> {
        (0..).zip(values).map(|(node, value)| ObservedDisplacement { node, value }).collect()
    }
}

/// One marker or tracked point at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedMarker {
    /// Number of the site in [`super::Observation::markers`].
    pub site: u32,
    /// World position [m]; of a marker, of its centre.
    pub position: DVec3,
}
