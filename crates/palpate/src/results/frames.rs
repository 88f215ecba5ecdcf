//! What `result.json` of a fit says of frames that it saw and did not see.

use serde::{Deserialize, Serialize};

/// How far a fit is from frames that it saw and did not see.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// Those that it saw.
    pub train: FrameDistances,
    /// Those that it did not see.
    pub test: FrameDistances,
}

/// Root mean square distances from some frames [m].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameDistances {
    /// Number of frames.
    pub frames: usize,
    /// From the simulation with the values found.
    pub rms: Option<f64>,
    /// From the body at rest; `None` for readings without a place of their own.
    pub rest: Option<f64>,
    /// From a body that does not move: points stay in the middle of where the fit saw them.
    pub unmoved: Option<f64>,
}
