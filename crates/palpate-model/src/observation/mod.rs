//! What was measured, ready to be compared: frames of points and markers.

pub mod instant;
pub mod kernel;

use crate::effects::reading::Seen;
use glam::{DMat3, DVec3};

/// Everything observed in one recording, in world coordinates and SI units.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// Cameras, for visibility.
    pub cameras: Vec<Camera>,
    /// Frames ordered by time; times are on the recording's clock.
    pub frames: Vec<Frame>,
    /// Where tracked markers sit on the body.
    pub markers: Vec<MarkerSite>,
    /// Standard deviation of one depth point's distance [m]; divides its residual.
    pub depth_noise: f64,
    /// Standard deviation of one marker coordinate [m]; divides its residual.
    pub marker_noise: f64,
    /// Standard deviation of one coordinate of a directly observed node displacement [m].
    pub displacement_noise: f64,
    /// Size of errors that do not average out over depth points [m]; widens standard errors.
    pub depth_systematic: f64,
    /// The same for markers [m].
    pub marker_systematic: f64,
}

impl Observation {
    /// Number of scalar residuals over all frames (a point counts 1, a marker or node 3).
    pub fn residuals(&self) -> usize {
        self.frames.iter().map(Frame::residuals).sum()
    }

    /// Cameras, markers and noises alone: enough to simulate what sensors would read.
    pub fn without_frames(&self) -> Observation {
        Observation { cameras: self.cameras.clone(), frames: Vec::new(), markers: self.markers.clone(), ..*self }
    }
}

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
    /// Tracked markers.
    pub markers: Vec<ObservedMarker>,
    /// Directly observed displacement of every simulation node [m], shape `[N]`, or empty (tests, other simulators).
    pub displacements: Vec<DVec3>,
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
    /// Number of the camera in [`Observation::cameras`].
    pub camera: u32,
}

/// One marker at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedMarker {
    /// Number of the site in [`Observation::markers`].
    pub site: u32,
    /// World position of the marker's centre [m].
    pub position: DVec3,
}

/// Where a marker sits on the body at rest, as the files say it.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerRest {
    /// Label in the recording.
    pub name: String,
    /// The marker's centre in the rest configuration [m].
    pub position: DVec3,
    /// The surface point it is rigidly attached to [m]; `None` = the nearest one.
    pub surface: Option<DVec3>,
}

/// A marker that is carried rigidly by the body at its surface point:
/// `x = Σ position_weights·x_i + R·stalk`, R the rotation of `F = Σ x_i ⊗ gradient_weights`.
#[derive(Clone, Debug, Default)]
pub struct MarkerSite {
    /// Label in the recording.
    pub name: String,
    /// Simulation nodes around the attachment.
    pub nodes: Vec<u32>,
    /// Weights of the nodes for the attachment point; they sum to one.
    pub position_weights: Vec<f64>,
    /// Weights of the nodes for the local deformation gradient [1/m]; they sum to zero.
    pub gradient_weights: Vec<DVec3>,
    /// Marker centre minus attachment point at rest [m].
    pub stalk: DVec3,
}

impl MarkerSite {
    /// Attachment point and deformation gradient at node positions `x(i)` [m].
    pub fn carry(&self, x: impl Fn(usize) -> DVec3) -> (DVec3, DMat3) {
        let mut p = DVec3::ZERO;
        let mut f = DMat3::ZERO;
        for (k, &n) in self.nodes.iter().enumerate() {
            let xi = x(n as usize);
            p += self.position_weights[k] * xi;
            let g = self.gradient_weights[k];
            f += DMat3::from_cols(xi * g.x, xi * g.y, xi * g.z);
        }
        (p, f)
    }
}
