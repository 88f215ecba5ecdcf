//! A heavy or light spot: ln ρ differs by `ratio` in a ball around `center`, fading smoothly: exp(−(r/R)⁴).

use super::inclusion::Inclusion;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number, place};

pub(super) const LAW: Law = Law {
    kind: "density-inclusion",
    family: Family::Material,
    sentence: "a spot inside the body is lighter or heavier than the rest",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Density(&Inclusion),
};

const PARAMS: [EffectParam; 5] = [
    number("ratio", "1", [-7.0, 7.0, 0.7], Unstated::Absent(0.0), "ln of the spot's density over the scene's"),
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
