//! The body on its grid: active cells, nodes, weights, surface patches, ghost penalty, the band around it.

mod build;
mod moments;

pub use build::{BodyError, LARGE, MAX_CELLS, SUBDIVISIONS, unit_hint};
pub(crate) use build::{Parts, build_parts, world_cell};

use crate::cutcells::distances::Distances;
use crate::cutcells::grid::Grid;
use crate::space::points::{Points, TetMesh};
use crate::space::stencil::{Stencil, Stencils};
use glam::DVec3;

/// A body cut out of a lattice; constant over a simulation, in world coordinates of the rest configuration.
#[derive(Clone, Debug)]
pub struct Body {
    /// The lattice that covers body and band.
    pub grid: Grid,
    /// Rest positions of the simulation nodes [m], shape `[N]`.
    pub nodes: Vec<DVec3>,
    /// Lumped volumes [m³], shape `[N]`: ∫ N_i over the body, after [`Body::mend_moments`] times a factor near 1; their sum is `volume`,
    /// their centre `center`.
    pub node_volume: Vec<f64>,
    /// Cells that hold some of the body.
    pub cells: Vec<Cell>,
    /// Surface of the body in small pieces, grouped by cell in increasing order.
    pub patches: Vec<Patch>,
    /// Mean place of every patch.
    pub surface: Stencils,
    /// Elastic points, of bodies that are not cut out of a lattice; such a body has no cells.
    pub points: Points,
    /// Ghost penalty lines: squared second differences of u on cut cells' faces.
    pub ghosts: Vec<GhostLine>,
    /// The body and the cells around it, where observed points are looked up.
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

    /// Number of elements: cells, or elastic points.
    pub fn elements(&self) -> usize {
        self.cells.len() + self.points.len()
    }

    /// Nodes of every element.
    pub fn element_nodes(&self) -> impl Iterator<Item = &[u32]> + '_ {
        self.cells.iter().map(|c| &c.nodes[..]).chain(self.points.stencils.iter().map(|s| s.nodes))
    }

    /// Rest position of the middle of every element [m].
    pub fn middles(&self) -> impl Iterator<Item = DVec3> + '_ {
        let cells = self.cells.iter().map(|c| self.grid.position(c.lattice) + 0.5 * self.grid.h);
        cells.chain(self.points.stencils.iter().map(|s| s.at(&self.nodes)))
    }

    /// A body of tetrahedra.
    pub fn of_tets(mesh: &TetMesh) -> Body {
        let (points, node_volume) = mesh.points();
        let volume: f64 = points.volume.iter().sum();
        let center = points.stencils.iter().zip(&points.volume).map(|(s, v)| s.at(&mesh.nodes) * *v).sum::<DVec3>() / volume;
        let (mut patches, mut surface) = (Vec::new(), Stencils::default());
        for (element, face) in mesh.faces() {
            let [a, b, c] = face.map(|n| mesh.nodes[n as usize]);
            let twice = (b - a).cross(c - a);
            surface.push(&face, &[1.0 / 3.0; 3]);
            patches.push(Patch {
                cell: element,
                area: 0.5 * twice.length(),
                normal: twice.normalize(),
                point: (a + b + c) / 3.0,
            });
        }
        let low = mesh.nodes.iter().copied().reduce(DVec3::min).unwrap_or(center);
        let high = mesh.nodes.iter().copied().reduce(DVec3::max).unwrap_or(center);
        // The edge of a cube of a mean tetrahedron's six: what lengths are measured in where cells have their edge.
        let length = (6.0 * volume / points.len() as f64).cbrt();
        Body {
            grid: Grid::covering(low, high, length, 1),
            nodes: mesh.nodes.clone(),
            node_volume,
            cells: Vec::new(),
            area: patches.iter().map(|p| p.area).sum(),
            patches,
            surface,
            points,
            ghosts: Vec::new(),
            band: Band::default(),
            volume,
            center,
            corners: (low, high),
        }
    }
}

/// A cell that holds some of the body.
#[derive(Clone, Debug)]
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

/// A piece of the surface inside one cell; forces and gaps are taken as means over it.
#[derive(Clone, Debug)]
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

/// One line of the ghost penalty: energy ½ γ μ h `weight` |u_a − 2 u_b + u_c|² (dimensionless weight).
#[derive(Clone, Debug, PartialEq)]
pub struct GhostLine {
    /// Simulation nodes a, b, c in a row along an axis.
    pub nodes: [u32; 3],
    /// Number of ghost faces that hold the line, divided by four.
    pub weight: f64,
}

/// The body and a band of cells around it. Extended nodes are numbered: first the N simulation nodes, then band nodes.
#[derive(Clone, Debug, Default)]
pub struct Band {
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
    /// Cells of the band, active cells included.
    pub cells: Vec<BandCell>,
}

/// A cell in which observed points are looked up.
#[derive(Clone, Debug)]
pub struct BandCell {
    /// Lattice coordinates of the lowest corner.
    pub lattice: [usize; 3],
    /// Extended node numbers of the eight corners.
    pub nodes: [u32; 8],
    /// Signed distance [m] at the lattice of [`crate::cutcells::distances`] in the cell, negative inside.
    pub sdf: Distances,
}
