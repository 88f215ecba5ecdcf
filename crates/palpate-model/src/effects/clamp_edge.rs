//! A clamp whose edge lies elsewhere: the held region ends `shift` further along the body than its box says, or before it.
//!
//! The faces of the clamp's box that cut through the body move along their outward normals; faces beside the body stay. What the
//! grown box holds of surface and body is integrated exactly ([`crate::cutcells::clamp_edge`]), so the held shares of the cells at the edge, and
//! with them the motion, depend smoothly on the shift. Of tetrahedra a clamp holds whole faces, so its edge is one of the mesh: moving it would
//! move the mesh, and with it where markers are. Such bodies are refused by name.

use super::field::{FieldLaw, Spot};
use super::law::Number;
use super::{EffectParam, Family, Law, Site, Trial, Unstated, number};

pub(super) const LAW: Law = Law {
    kind: "clamp-edge",
    family: Family::Shape,
    sentence: "the clamp holds more or less of the body than stated",
    params: &PARAMS,
    trial: Trial::Score,
    site: Site::Edges(&Edge),
};

const PARAMS: [EffectParam; 1] = [number(
    "shift",
    "m",
    [-0.1, 0.1, 0.005],
    Unstated::Absent(0.0),
    "how much further along the body the clamp holds it; below 0 it holds less. Of bodies of cells: a mesh of tetrahedra has its edge where its nodes are",
)];

struct Edge;

impl FieldLaw<1> for Edge {
    fn values<D: Number>(&self, _: &Spot, p: &[D]) -> [D; 1] {
        [p[0]]
    }
}
