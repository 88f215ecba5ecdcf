//! A marker that sits elsewhere than the files state: its centre is R·offset from the stated one, R the rotation of the body where it is
//! attached. The offset adds to the marker's stalk and turns with the body.

use super::{EffectParam, Family, Law, Numbered, Site, Trial, Unstated, component, number};

pub(super) const LAW: Law = Law {
    kind: "marker-offset",
    family: Family::Measurement,
    sentence: "a marker sits elsewhere on the body than stated",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Marker,
};

const AWAY: &str = "true minus stated place of the marker at rest";

const PARAMS: [EffectParam; 4] = [
    number("marker", "1", [0.0, f64::INFINITY, 1.0], Unstated::Choice(Numbered::Marker), "number of the marker, counted from 0"),
    component("offset", 0, "m", 0.005, AWAY),
    component("offset", 1, "m", 0.005, AWAY),
    component("offset", 2, "m", 0.005, AWAY),
];
