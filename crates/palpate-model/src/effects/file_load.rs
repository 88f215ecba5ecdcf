//! Forces on points of the body that a file holds for every time: weights that were hung on it, a hand with a sensor, another simulation.
//!
//! The force on a point is its series times a factor, linear in time between samples. Weighted θ and 1 − θ in time like the cells.

use super::law::{Asks, Input, Number, Place, PointLaw, dot};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

/// Kind of this law.
pub const KIND: &str = "file-load";

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Load,
    sentence: "known forces pull at points of the body",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Driven(&FileLoad),
};

const PARAMS: [EffectParam; 1] =
    [number("factor", "1", [-1e6, 1e6, 1.0], Unstated::Absent(0.0), "force over that of the file; 1 where the scene says none")];

struct FileLoad;

impl PointLaw for FileLoad {
    const ASKS: Asks = Asks::Series;
    const IS_LOAD: bool = true;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (followed, theta) = (&place.followed, place.theta());
        let (new, old) = (followed.now(at.time()), followed.old(at.time()));
        let work = dot(new, at.x()) * theta + dot(old, at.x()) * (1.0 - theta);
        -at.p(0) * work * place.measure
    }
}
