//! Where tracked things sit on the body: markers, also on stalks, and tracked points of the body itself.

use super::channel::ReadingKind;
use glam::{DMat3, DVec3};

/// Where points that are tracked by themselves, without markers, lie on the body at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackRest {
    /// Rest places [m], in the world of the rest configuration.
    pub places: Vec<DVec3>,
    /// How far a place may lie from the rest surface [m]; `None` = two cells.
    pub tolerance: Option<f64>,
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
    /// [`ReadingKind::Marker`] or [`ReadingKind::Track`]: which channel its readings belong to.
    pub kind: ReadingKind,
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
