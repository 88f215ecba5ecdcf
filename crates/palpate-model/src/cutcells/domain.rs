//! The cells of a body that is cut out of a lattice, and what it has of that lattice; and the band, which any body may have.

use crate::cutcells::distances::Distances;
use crate::cutcells::grid::Grid;
use glam::DVec3;

/// A body's cells on their lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct CutCells {
    /// The lattice that covers body and band.
    pub grid: Grid,
    /// Cells that hold some of the body, in the order of the lattice.
    pub cells: Vec<Cell>,
    /// Ghost penalty lines: squared second differences of u on cut cells' faces.
    pub ghosts: Vec<GhostLine>,
}

impl CutCells {
    /// Rest position of the middle of a cell [m].
    pub fn middle(&self, cell: &Cell) -> DVec3 {
        self.grid.position(cell.lattice) + 0.5 * self.grid.h
    }
}

/// A cell that holds some of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Lattice coordinates of the lowest corner, counted from the grid's node (0, 0, 0).
    pub lattice: [usize; 3],
    /// The eight simulation nodes, order of [`crate::cutcells::grid::CORNERS`].
    pub nodes: [u32; 8],
    /// Volume of the body inside, divided by h³; 1 for a full cell, a trace more if a neighbour's sliver was merged into it.
    pub fraction: f64,
    /// Weights of the 3 × 3 × 3 Gauss points [`crate::cutcells::cut::POINTS27`] (x fastest), divided by h³, fitted so that every
    /// polynomial of degree ≤ 2 in each variable is integrated exactly over the part of the cell inside the
    /// body; they sum to `fraction` and may be negative.
    pub weights: [f64; 27],
}

impl Cell {
    /// True when the body fills exactly the whole cell (one that also carries a merged neighbour's sliver is not full).
    pub fn is_full(&self) -> bool {
        (self.fraction - 1.0).abs() <= 1e-9
    }
}

/// One line of the ghost penalty: energy ½ γ μ h `weight` |u_a − 2 u_b + u_c|² (dimensionless weight).
#[derive(Clone, Debug, PartialEq)]
pub struct GhostLine {
    /// Simulation nodes a, b, c in a row along an axis.
    pub nodes: [u32; 3],
    /// Number of ghost faces that hold the line, divided by four.
    pub weight: f64,
}

/// The body and a band of cells around it, where observed points are looked up. Extended nodes are numbered: first the N simulation nodes, then
/// band nodes. On a body of tetrahedra no corner of a cell is a simulation node.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Band {
    /// The lattice that covers body and band.
    pub grid: Grid,
    /// Half width of the band [m]: every point closer to the surface than this lies in a band cell.
    pub width: f64,
    /// Rest positions of the band nodes only [m], shape `[M]` (extended number = N + row).
    pub nodes: Vec<DVec3>,
    /// Start of each band node's row in `columns` / `values`, shape `[M + 1]`.
    pub rows: Vec<u32>,
    /// Simulation nodes that a band node's displacement is extended from.
    pub columns: Vec<u32>,
    /// Extension weights; every row sums to one and reproduces affine fields exactly.
    pub values: Vec<f64>,
    /// Cells of the band, those that hold the body included.
    pub cells: Vec<BandCell>,
}

/// A cell in which observed points are looked up.
#[derive(Clone, Debug, PartialEq)]
pub struct BandCell {
    /// Lattice coordinates of the lowest corner.
    pub lattice: [usize; 3],
    /// Extended node numbers of the eight corners.
    pub nodes: [u32; 8],
    /// Signed distance [m] at the lattice of [`crate::cutcells::distances`] in the cell, negative inside.
    pub sdf: Distances,
}
