//! Fibres: extra stiffness along one direction of the rest configuration, ψ = ½ c (f·ε f)² with the unit vector f.
//!
//! The linear limit of a fibre-reinforced solid (Spencer, *Deformations of Fibre-Reinforced Materials*, 1972), with the cell's mean
//! strain ε. It acts in compression too, the fibres are not damped, and a clamp does not know of them: its cells
//! give a small part of a cell more than they should.

use super::cell::{CellLaw, Strain};
use super::law::{Number, dot};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, direction, number};

pub(super) const LAW: Law = Law {
    kind: "transverse-anisotropy",
    family: Family::Material,
    sentence: "the material is stiffer along one direction than across it",
    params: &PARAMS,
    trial: Trial::Starts,
    site: Site::Cells(&Fibres),
};

const DOC: &str = "direction of the fibres";

const PARAMS: [EffectParam; 4] = [
    number("stiffness", "1", [0.0, 1e4, 1.0], Unstated::Absent(0.0), "extra stiffness along the fibres over Young's modulus"),
    direction("fibre", 0, DOC),
    direction("fibre", 1, DOC),
    direction("fibre", 2, DOC),
];

struct Fibres;

impl CellLaw for Fibres {
    const STRAINED: bool = true;

    fn energy<D: Number>(&self, s: &Strain<D>, p: &[D]) -> D {
        let [xx, yy, zz, yz, zx, xy] = s.mean;
        let f = [p[1], p[2], p[3]];
        let image = [xx * f[0] + xy * f[1] + zx * f[2], xy * f[0] + yy * f[1] + yz * f[2], zx * f[0] + yz * f[1] + zz * f[2]];
        let stretch = dot(f, image) / dot(f, f);
        p[0] * stretch * stretch * 0.5
    }
}
