//! A hard or soft spot: ln E differs by `ratio` in a ball around `center`, fading smoothly: exp(−(r/R)⁴).

use super::field::{FieldLaw, Spot, blob};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number, place};

pub(super) const LAW: Law = Law {
    kind: "inclusion",
    family: Family::Material,
    sentence: "a spot inside the body is softer or stiffer than the rest",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Modulus(&Inclusion),
};

const PARAMS: [EffectParam; 5] = [
    number("ratio", "1", [-7.0, 7.0, 0.7], Unstated::Absent(0.0), "ln of the spot's stiffness over the scene's"),
    place("center", 0, "middle of the spot"),
    place("center", 1, "middle of the spot"),
    place("center", 2, "middle of the spot"),
    number(
        "radius",
        "m",
        [1e-4, 1e2, 0.02],
        Unstated::Stated(0.02),
        "radius of the spot, where the difference has fallen to 1/e",
    ),
];

pub(super) struct Inclusion;

impl FieldLaw<1> for Inclusion {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 1] {
        [(p[0] * blob(spot.from_place(&p[1..4]), p[4])).exp()]
    }
}
