//! A body of two parts: ln E jumps by `ratio` across a plane, at distance `position` from the centre of mass along `direction`.
//!
//! The jump is spread over about one cell (a tanh), which the grid could not resolve better anyway. The scene's modulus is that of the
//! part behind the plane; the part ahead has E exp(ratio). Of `direction` only the direction counts.

use super::field::{FieldLaw, Spot, along, step};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, direction, number};

pub(super) const LAW: Law = Law {
    kind: "two-part-stiffness",
    family: Family::Material,
    sentence: "the body consists of a soft and a stiff part",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Modulus(&TwoPart),
};

const DOC: &str = "from the part with the scene's stiffness to the other";

const PARAMS: [EffectParam; 5] = [
    number("ratio", "1", [-7.0, 7.0, 0.5], Unstated::Absent(0.0), "ln of the other part's stiffness over the scene's"),
    number(
        "position",
        "m",
        [-1e3, 1e3, 0.02],
        Unstated::Stated(0.0),
        "distance of the dividing plane from the centre of mass along `direction`; the change spreads over a cell",
    ),
    direction("direction", 0, DOC),
    direction("direction", 1, DOC),
    direction("direction", 2, DOC),
];

struct TwoPart;

impl FieldLaw<1> for TwoPart {
    fn values<D: Number>(&self, spot: &Spot, p: &[D]) -> [D; 1] {
        let ahead = along(spot.from_center(), [p[2], p[3], p[4]]) - p[1];
        [(p[0] * step(ahead, spot.cell)).exp()]
    }
}
