//! `[[handle]]`, `[[keyframe]]` and `[synthesize]`: motions that are made, not measured.

use glam::DVec3;

/// Who pulls at the body, and where it shall be led.
#[derive(Clone, Debug, PartialEq)]
pub struct Synthesis {
    /// Places where it is held, in the order of the file.
    pub handles: Vec<Handle>,
    /// Where points of it shall be.
    pub keyframes: Vec<Keyframe>,
    /// Knots of the course of each free handle's force.
    pub knots: usize,
    /// Size that a force may have without being paid for more than a miss of one σ [N].
    pub force: Option<f64>,
    /// The motion ends as it begins.
    pub closed: bool,
    /// What closing may miss by [m]; `None` = the smallest σ of the keyframes.
    pub gap: Option<f64>,
    /// Most iterations.
    pub iterations: usize,
}

impl Default for Synthesis {
    fn default() -> Synthesis {
        Synthesis { handles: Vec::new(), keyframes: Vec::new(), knots: 8, force: None, closed: false, gap: None, iterations: 50 }
    }
}

/// A place of the body that a motion is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Handle {
    /// Where it holds the body at rest [m].
    pub point: DVec3,
    /// Size of the region that it holds [m].
    pub radius: f64,
    /// Number of the effect that makes it follow its path; `None` = its force is free.
    pub follows: Option<usize>,
}

/// Points of the body and where they shall be at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframe {
    /// When [s].
    pub time: f64,
    /// Places at rest [m].
    pub points: Vec<DVec3>,
    /// Where they shall be [m], one for each.
    pub positions: Vec<DVec3>,
    /// A miss of a coordinate that counts as one [m].
    pub sigma: f64,
}
