//! A rigid obstacle of any shape that moves as a file says: a ball that is pressed in, a finger, a gripper's jaw.
//!
//! The pressure law of planes (`palpate_model::mechanics::contact`) at the patches of the body's surface, with the obstacle's signed
//! distance as the gap. It acts along the obstacle's normal, without friction, and moves the body alone.

use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};

/// Kind of this law.
pub const KIND: &str = "obstacle";

/// Slot of the stiffness.
pub const STIFFNESS: usize = 0;
/// First slot of the offset.
pub const OFFSET: usize = 1;

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Contact,
    sentence: "a moving obstacle presses on the body",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Obstacle,
};

const AWAY: &str = "from where its motion says to where the obstacle is, in the world";

const PARAMS: [EffectParam; 4] = [
    number("stiffness", "Pa/m", [0.0, 1e15, 1e6], Unstated::Absent(0.0), "pressure over penetration; of a plane it is 20 E/h"),
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 0, "m", 1e-3, AWAY) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 1, "m", 1e-3, AWAY) },
    EffectParam { default: Unstated::Fixed(0.0), ..component("offset", 2, "m", 1e-3, AWAY) },
];
