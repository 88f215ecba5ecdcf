//! What the recorded body has and its scene does not know.

use super::outside::Outside;
use glam::DVec3;

/// A sphere in the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Its middle [m].
    pub center: DVec3,
    /// Its radius [m].
    pub radius: f64,
    /// What a number is multiplied by inside.
    pub factor: f64,
}

/// Everything at once; the default is nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// Masses [kg] on the face nearest to a place.
    pub masses: Vec<(DVec3, f64)>,
    /// Force per volume [N/m³].
    pub force: DVec3,
    /// Gravity beside the stated one [m/s²].
    pub gravity: DVec3,
    /// Drag over dynamic pressure and whole surface.
    pub drag: f64,
    /// Beyond a plane (direction, distance from the origin along it) the stiffness is this part of the scene's.
    pub soft: Option<(DVec3, f64, f64)>,
    /// A spot of another stiffness.
    pub inclusion: Option<Spot>,
    /// A spot of another density.
    pub dense: Option<Spot>,
    /// Curvature of the rest shape from x to z [1/m].
    pub bend: f64,
    /// Velocity at the start [m/s].
    pub velocity: DVec3,
    /// Angular velocity at the start [rad/s].
    pub spin: DVec3,
    /// Friction on the ground.
    pub friction: f64,
    /// Height of the ground beside the stated one, along its normal [m].
    pub height: f64,
    /// Poisson's ratio beside the stated one.
    pub poisson: f64,
    /// Damping beside the stated one: by mass [1/s], by stiffness [s].
    pub damping: [f64; 2],
    /// A spring from a place of the body to a fixed one: both [m], and its stiffness [N/m].
    pub tether: Option<(DVec3, DVec3, f64)>,
    /// Time that stamps are ahead by [s].
    pub clock: f64,
    /// Depth that readings are too large by [m].
    pub depth_bias: f64,
    /// Share of its depth that a reading is too large by.
    pub depth_scale: f64,
    /// 0: depth along the axis, 1: along the pixels' rays.
    pub along_ray: f64,
    /// Stated minus true place of the first camera [m], and the turn from its true to its stated pose [rad].
    pub camera: [DVec3; 2],
    /// True minus stated place of a marker [m].
    pub marker: Option<(usize, DVec3)>,
    /// Something that no law of the library is.
    pub outside: Option<Outside>,
}
