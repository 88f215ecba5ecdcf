//! A force of constant size and direction, spread evenly over the volume: wind on a light body, a fan, a misjudged weight.

use super::law::{Input, Number, Place, PointLaw, dot};
use super::{EffectParam, Family, Law, Site, Trial, component};

const DOC: &str = "force per volume";

pub(super) const LAW: Law = Law {
    kind: "uniform-force",
    family: Family::Load,
    sentence: "a constant force pushes the whole body",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Nodes(&UniformForce),
};

const PARAMS: [EffectParam; 3] = [
    component("force", 0, "N/m³", 1000.0, DOC),
    component("force", 1, "N/m³", 1000.0, DOC),
    component("force", 2, "N/m³", 1000.0, DOC),
];

struct UniformForce;

impl PointLaw for UniformForce {
    const IS_LOAD: bool = true;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        -dot(at.vector(0), at.x()) * place.measure
    }
}
