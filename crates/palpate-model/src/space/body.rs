//! The body: nodes with their shares of its volume, the surface, and one of two kinds of elastic domain, cut cells or elastic points.

use crate::cutcells::domain::{Band, Cell, CutCells, GhostLine};
use crate::space::points::Points;
use crate::space::stencil::{Stencil, Stencils};
use glam::DVec3;

/// A body; constant over a simulation, in world coordinates of the rest configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Typical size of an element [m], what lengths beside it are measured in: the edge of a lattice's cells, or the edge of the cube that
    /// six mean tetrahedra fill.
    pub length: f64,
    /// Rest positions of the simulation nodes [m], shape `[N]`.
    pub nodes: Vec<DVec3>,
    /// Lumped volumes [m³], shape `[N]`: of cells ∫ N_i over the body, after [`Body::mend_moments`] times a factor near 1; of tetrahedra positive
    /// shares ([`super::tets::lumped`]), by which laws of nodes weigh, while inertia and weight have the whole matrix. Their sum is `volume`, their
    /// centre `center`.
    pub node_volume: Vec<f64>,
    /// Surface of the body in small pieces, grouped by cell in increasing order.
    pub patches: Vec<Patch>,
    /// Mean place of every patch.
    pub surface: Stencils,
    /// The cells, of bodies that are cut out of a lattice.
    pub cut: Option<CutCells>,
    /// Elastic points, of bodies that are not.
    pub points: Points,
    /// Where observed points are looked up; empty where none are.
    pub band: Band,
    /// Volume [m³].
    pub volume: f64,
    /// Surface area [m²].
    pub area: f64,
    /// Centre of mass (uniform density) [m].
    pub center: DVec3,
    /// Lowest and highest corner of the box around the surface's patches [m]; the centre without any.
    pub corners: (DVec3, DVec3),
}

impl Body {
    /// Every patch of the surface with its mean place.
    pub fn pieces(&self) -> impl Iterator<Item = (&Patch, Stencil<'_>)> {
        self.patches.iter().zip(self.surface.iter())
    }

    /// The lattice and what is cut out of it, for rooms that only such bodies enter.
    ///
    /// # Panics
    /// On a body of elastic points.
    pub fn cut(&self) -> &CutCells {
        self.cut.as_ref().expect("a body of elastic points has no lattice")
    }

    /// Cells; none of a body of elastic points.
    pub fn cells(&self) -> &[Cell] {
        self.cut.as_ref().map_or(&[], |c| &c.cells)
    }

    /// Lines of the ghost penalty; none of a body of elastic points.
    pub fn ghosts(&self) -> &[GhostLine] {
        self.cut.as_ref().map_or(&[], |c| &c.ghosts)
    }

    /// Longest side of the body [m], at least one element.
    pub fn size(&self) -> f64 {
        (self.corners.1 - self.corners.0).max_element().max(self.length)
    }

    /// Number of elements: cells, or tetrahedra.
    pub fn elements(&self) -> usize {
        self.cells().len() + self.points.elements()
    }

    /// Nodes of every element.
    pub fn element_nodes(&self) -> impl Iterator<Item = &[u32]> + '_ {
        self.cells().iter().map(|c| &c.nodes[..]).chain(self.points.means().map(|s| s.nodes))
    }

    /// Rest position of the middle of every element [m].
    pub fn middles(&self) -> impl Iterator<Item = DVec3> + '_ {
        let cells = self.cut.iter().flat_map(|cut| cut.cells.iter().map(|c| cut.middle(c)));
        cells.chain(self.points.means().map(|s| s.at(&self.nodes)))
    }
}

/// A piece of the surface of one element; forces and gaps are taken as means over it.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Number of the cell or element that it belongs to.
    pub cell: u32,
    /// Area [m²].
    pub area: f64,
    /// Mean outward unit normal (area-weighted, normalised).
    pub normal: DVec3,
    /// Centroid at rest [m].
    pub point: DVec3,
}
