//! A contact plane of one member: where it stands and how stiff it is, from the plan and the parameters.

use crate::mechanics::contact;
use crate::plan::{Physics, Plan};
use glam::DVec3;

/// A contact plane of one member.
#[derive(Clone, Copy, Debug)]
pub struct PlaneNow {
    /// Unit normal, and its derivatives by θ and φ.
    pub normal: [DVec3; 3],
    /// Distance along the normal [m].
    pub height: f64,
    /// Penalty stiffness [Pa/m].
    pub stiffness: f64,
    /// True when the stiffness is proportional to Young's modulus.
    pub scales: bool,
}

/// The planes of a member.
pub fn planes(plan: &Plan, physics: &Physics) -> Vec<PlaneNow> {
    plan.planes
        .iter()
        .zip(&physics.planes)
        .map(|(site, [height, theta, phi])| PlaneNow {
            normal: site.normal(*theta, *phi),
            height: *height,
            stiffness: site.stiffness.unwrap_or(contact::DEFAULT_STIFFNESS * physics.youngs_modulus / plan.body.length),
            scales: site.stiffness.is_none(),
        })
        .collect()
}
