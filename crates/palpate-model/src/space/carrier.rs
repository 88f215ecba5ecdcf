//! Which nodes a place of the rest configuration follows, whatever its body is made of.

use crate::cutcells::extension::NodeLookup;
use crate::cutcells::places::{CellLookup, material_point};
use crate::space::body::Body;
use crate::space::stars::lookup::StarLookup;
use crate::space::stencil::{StencilBuf, Stencils};
use crate::space::tets::TetLookup;
use glam::DVec3;
use rayon::prelude::*;

/// Radius of the fit that continues a motion beyond the cells, in cells: the smallest that spans a cut cell's neighbourhood.
const RADIUS: f64 = 2.0;

/// Places that follow a body, with the motion's gradient there.
pub struct Followers {
    /// What every place follows, with gradients.
    pub stencils: Stencils,
    /// How far each lies outside the elements [m]; zero inside.
    pub away: Vec<f64>,
}

/// Finds the element that carries a place.
pub enum Carrier<'a> {
    /// A cell.
    Cells(CellLookup<'a>),
    /// A tetrahedron.
    Tets(Box<TetLookup<'a>>),
    /// Points of a cloud.
    Stars(Box<StarLookup<'a>>),
}

impl Body {
    /// Looks every element up once.
    pub fn carrier(&self) -> Carrier<'_> {
        match &self.cut {
            Some(cut) => Carrier::Cells(CellLookup::new(cut)),
            None if self.points.stars.is_some() => Carrier::Stars(Box::new(StarLookup::new(self))),
            None => Carrier::Tets(Box::new(TetLookup::new(self))),
        }
    }

    /// Places at rest [m] that are to follow the body. In an element they follow that; beyond the cells the affine motion that fits the nodes around them best
    /// (least squares), which is smooth across the cells' outline where a single cell's field is not.
    pub fn followers(&self, places: &[DVec3]) -> Followers {
        let carrier = self.carrier();
        let lookup = self.cut.as_ref().map(|_| NodeLookup::new(self));
        let find = |p: &DVec3| {
            let (own, away) = carrier.carry(*p);
            match &lookup {
                Some(nodes) if away > 0.0 => (material_point(self, nodes, *p, RADIUS * self.length), away),
                _ => (own, away),
            }
        };
        let mut all = Followers { stencils: Stencils::default(), away: Vec::new() };
        for (s, away) in places.par_iter().map(find).collect::<Vec<_>>() {
            all.stencils.push_with_gradient(&s.nodes, &s.value, &s.gradient);
            all.away.push(away);
        }
        all
    }
}

impl Carrier<'_> {
    /// The field of the element that holds a place, or of the nearest, continued to it; and how far outside the place is [m], zero inside.
    pub fn carry(&self, place: DVec3) -> (StencilBuf, f64) {
        match self {
            Carrier::Cells(cells) => cells.carry(place),
            Carrier::Tets(tets) => tets.carry(place),
            Carrier::Stars(stars) => stars.carry(place),
        }
    }
}
