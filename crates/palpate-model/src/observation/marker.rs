//! Where tracked things sit on the body: markers, also on stalks, and tracked points of the body itself.

use super::channel::ReadingKind;
use crate::space::stencil::StencilBuf;
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
/// `x = Σ w x_i + R·stalk`, R the rotation of `F = Σ x_i ⊗ g_i`.
#[derive(Clone, Debug, Default)]
pub struct MarkerSite {
    /// Label in the recording.
    pub name: String,
    /// [`ReadingKind::Marker`] or [`ReadingKind::Track`]: which channel its readings belong to.
    pub kind: ReadingKind,
    /// The attachment point, and the deformation gradient around it.
    pub stencil: StencilBuf,
    /// Marker centre minus attachment point at rest [m].
    pub stalk: DVec3,
}

impl MarkerSite {
    /// Attachment point and deformation gradient at node positions `x(i)` [m], or their changes at the nodes' changes.
    pub fn carry(&self, x: impl Fn(usize) -> DVec3) -> (DVec3, DMat3) {
        let s = &self.stencil;
        let (mut p, mut f) = (DVec3::ZERO, DMat3::ZERO);
        for ((n, w), g) in s.nodes.iter().zip(&s.value).zip(&s.gradient) {
            let xi = x(*n as usize);
            p += *w * xi;
            f += DMat3::from_cols(xi * g.x, xi * g.y, xi * g.z);
        }
        (p, f)
    }
}
