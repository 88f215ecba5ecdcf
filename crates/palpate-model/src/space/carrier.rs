//! Which nodes a place of the rest configuration follows, whatever its body is made of.

use crate::cutcells::places::CellLookup;
use crate::space::body::Body;
use crate::space::stars::lookup::StarLookup;
use crate::space::stencil::StencilBuf;
use crate::space::tets::TetLookup;
use glam::DVec3;

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
