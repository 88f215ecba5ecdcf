//! Cameras, and what was seen at one time.

use super::channel::Sensor;
use crate::effects::reading::Seen;
use glam::DVec3;

/// From where points of the surface were seen.
#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// A depth camera.
    Pinhole {
        /// Centre of projection in the world [m].
        center: DVec3,
        /// Unit vector along which depth counts.
        axis: DVec3,
    },
    /// A scanner that looks from one place into all directions: distances count along its rays.
    Scanner {
        /// Where the rays come from [m].
        center: DVec3,
    },
    /// Nobody knows: points have no line of sight, and may lie on any side of the body.
    Unknown,
}

impl Camera {
    /// Where lines of sight come from [m].
    pub fn center(&self) -> Option<DVec3> {
        match self {
            Camera::Pinhole { center, .. } | Camera::Scanner { center } => Some(*center),
            Camera::Unknown => None,
        }
    }

    /// Unit vector along the line of sight to a point [m]; zero where there is none.
    pub fn line(&self, point: DVec3) -> DVec3 {
        self.center().map_or(DVec3::ZERO, |c| (point - c).normalize_or_zero())
    }

    /// A reading at a world point [m]; without a line of sight its ray and its axis are zero.
    pub fn sees(&self, point: DVec3) -> Seen<f64> {
        let axis = match self {
            Camera::Pinhole { axis, .. } => *axis,
            Camera::Scanner { .. } | Camera::Unknown => self.line(point),
        };
        Seen { point: point.to_array(), center: self.center().unwrap_or(point).to_array(), axis: axis.to_array() }
    }

    /// What takes its readings, where it has this number in [`super::Observation::cameras`].
    pub fn sensor(&self, number: u32) -> Sensor {
        match self {
            Camera::Pinhole { .. } => Sensor::Camera(number),
            Camera::Scanner { .. } | Camera::Unknown => Sensor::Cloud(number),
        }
    }
}

/// What was seen at one time.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Points of depth images and point clouds.
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

/// One pixel of a depth image, or one point of a cloud, as a world point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedPoint {
    /// World position [m].
    pub position: DVec3,
    /// Number of what saw it in [`super::Observation::cameras`].
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
