//! A plane that the scene does not know: a wall, a table's edge, a tilted floor. Place and tilt are parameters.
//!
//! The contact law of `palpate_model::mechanics::contact`, as for the scene's own planes, with `stiffness` times their default
//! penalty. The body stays on the side that the normal points to; of that only the direction counts (two angles would leave a fit stuck
//! where the normal is their pole). The plane lies at `distance` from `point` against it, so that turning it leaves it near the body.
//! Without friction.

use super::field::along;
use super::law::{Input, Number, Place, PointLaw, along_way, sub};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, direction, number};
use crate::mechanics::contact;

pub(super) const LAW: Law = Law {
    kind: "second-plane",
    family: Family::Contact,
    sentence: "the body touches something flat that the scene does not know",
    params: &PARAMS,
    trial: Trial::Walls,
    site: Site::Surface(&SecondPlane),
};

const POINT: &str = "point that the distance is counted from";

const NORMAL: &str = "from the plane to the side where the body stays";

const PARAMS: [EffectParam; 8] = [
    number("stiffness", "1", [0.0, 1e3, 1.0], Unstated::Absent(0.0), "contact stiffness over the default 20 E/h"),
    number(
        "distance",
        "m",
        [-1e3, 1e3, 0.01],
        Unstated::Stated(0.05),
        "distance of the plane from the point, against its normal",
    ),
    direction("normal", 0, NORMAL),
    direction("normal", 1, NORMAL),
    direction("normal", 2, NORMAL),
    EffectParam { default: Unstated::Reference, ..component("point", 0, "m", 0.01, POINT) },
    EffectParam { default: Unstated::Reference, ..component("point", 1, "m", 0.01, POINT) },
    EffectParam { default: Unstated::Reference, ..component("point", 2, "m", 0.01, POINT) },
];

struct SecondPlane;

/// Old and new distance above the plane [m].
fn gaps<D: Number>(at: &Input<D>) -> [D; 2] {
    [at.old(), at.x()].map(|x| along(sub(x, at.vector(5)), at.vector(2)) + at.p(1))
}

impl PointLaw for SecondPlane {
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let energy = |gap| contact::energy_of(gap, at.p(0) * at.default_stiffness(), place.width);
        along_way(place, gaps(&at), energy) * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        let [old, new] = gaps(&Input::new(z));
        old.min(new) >= place.width
    }
}
