//! A material that stiffens when strained: ψ = c a², so that in uniaxial stress σ = E ε (1 + c ε²).
//!
//! The first correction of every even, analytic stress-strain curve, in terms of the energy density (as limiting-chain models such as
//! Gent's, *Rubber Chem. Technol.* 69, 1996, expand); valid while c ε² stays of the order of one.

use super::cell::{CellLaw, Strain};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "strain-stiffening",
    family: Family::Material,
    sentence: "the material gets stiffer the more it is stretched",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Cells(&Stiffening),
};

const PARAMS: [EffectParam; 1] = [number(
    "coefficient",
    "1",
    [0.0, 1e6, 10.0],
    Unstated::Absent(0.0),
    "c in stress = E·strain·(1 + c·strain²) of a stretched bar",
)];

struct Stiffening;

impl CellLaw for Stiffening {
    fn energy<D: Number>(&self, s: &Strain<D>, p: &[D]) -> D {
        p[0] * s.density * s.density
    }
}
