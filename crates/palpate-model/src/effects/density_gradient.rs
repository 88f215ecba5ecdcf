//! Density that grows steadily along one direction: ρ(X) = ρ exp(s · (X − centre)), with the slope s a vector.
//!
//! The centre is that of the even body; the scene's density is the density there, so the total mass changes a little with s.

use super::stiffness_gradient::Gradient;
use super::{EffectParam, Family, Law, Site, Trial, component};

const DOC: &str = "growth of ln(density) per metre";

pub(super) const LAW: Law = Law {
    kind: "density-gradient",
    family: Family::Material,
    sentence: "one side of the body is heavier than the other, with a steady change between",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Density(&Gradient),
};

const PARAMS: [EffectParam; 3] =
    [component("slope", 0, "1/m", 5.0, DOC), component("slope", 1, "1/m", 5.0, DOC), component("slope", 2, "1/m", 5.0, DOC)];
