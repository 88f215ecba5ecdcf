//! A recording whose clock runs ahead: a frame stamped t shows the body at t − Δ. Unlike `time.start` it moves neither clamps
//! nor anything else that happens by the clock of the simulation; where nothing does, the two cannot be told apart.

use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "time-offset",
    family: Family::Measurement,
    sentence: "the recording's clock is off",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Clock,
};

const PARAMS: [EffectParam; 1] = [number(
    "offset",
    "s",
    [f64::NEG_INFINITY, f64::INFINITY, 0.01],
    Unstated::Absent(0.0),
    "time that the stamps of frames are ahead by",
)];
