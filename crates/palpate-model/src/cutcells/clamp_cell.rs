//! What a clamp holds of one cell, and which cells it holds something of.

use crate::cutcells::build::{Parts, SUBDIVISIONS, world_cell};
use crate::cutcells::cut::{ClipBox, HeldMoments, Lattice, held_moments};
use crate::cutcells::held::{FreePart, Pins};
use crate::shape::Shape;
use crate::space::body::Body;
use glam::DVec3;
use std::collections::BTreeMap;

/// One cell of a held region.
#[derive(Clone, Debug, PartialEq)]
pub struct ClampCell {
    /// Number of the cell in [`Body::cells`].
    pub cell: u32,
    /// ∫_Γ N_i n dS over the faces of the region inside the body [m²]; n points into the region.
    pub surface_normal: [DVec3; 8],
    /// ∫_Γ N_i N_j dS over them [m²].
    pub surface_mass: [[f64; 8]; 8],
    /// ∫ N_i N_j dV over the held part of the cell [m³].
    pub volume_mass: [[f64; 8]; 8],
    /// How much each node is pinned, 0 to 1 ([`crate::cutcells::held`]): the volume is held as far as both nodes are.
    pub pins: [f64; 8],
    /// Gauss weights of the held part of the cell; they sum to the fraction of the cell that is held.
    pub held: [f64; 27],
    /// Mean of ∇N_i over the free part of the body in the cell [1/m]; traction is taken from the mean strain.
    pub mean_gradient: [DVec3; 8],
}

impl ClampCell {
    /// The held part of a cell among a clamp's, which stand in increasing order.
    pub fn find(held: &[ClampCell], cell: u32) -> Option<&ClampCell> {
        held.binary_search_by_key(&cell, |c| c.cell).ok().map(|i| &held[i])
    }

    /// A held part of a cell; all of its nodes are pinned.
    pub(crate) fn new(body: &Body, cell: u32, m: &HeldMoments) -> ClampCell {
        let mut c = ClampCell {
            cell,
            surface_normal: m.surface_normal,
            surface_mass: m.surface_mass,
            volume_mass: m.volume_mass,
            pins: [1.0; 8],
            held: m.weights(),
            mean_gradient: [DVec3::ZERO; 8],
        };
        c.mean_gradient = c.free(body).mean_gradient(body.cut().grid.h);
        c
    }

    /// The part of the body in the cell that is not held.
    pub fn free(&self, body: &Body) -> FreePart {
        let mut free = FreePart::of(&body.cells()[self.cell as usize]);
        free.take(&self.held);
        free
    }
}

/// What a clamp's box holds of a body, in increasing order of the cells; nothing where it holds no part.
pub(crate) fn held_cells(region: &ClipBox, parts: &Parts, shape: &dyn Shape) -> Vec<ClampCell> {
    let body = &parts.body;
    let (grid, h) = (&body.cut().grid, body.cut().grid.h);
    let distance = |p: DVec3| shape.signed_distance(p);
    let lattice = Lattice { distance: &distance, h, subdivisions: SUBDIVISIONS };
    let misses = |c: [usize; 3]| region.misses(grid.position(c) + 0.5 * h, 0.5 * 3f64.sqrt() * h * 1.01);

    // Few cells of a body are held, as a rule.
    let mut held: BTreeMap<u32, HeldMoments> = BTreeMap::new();
    for (n, cell) in body.cells().iter().enumerate().filter(|(_, c)| !misses(c.lattice)) {
        let world = world_cell(grid, cell.lattice);
        // A full cell may still have surface on its faces; only cells away from the surface take the short way.
        let deep = shape.signed_distance(grid.position(cell.lattice) + 0.5 * h) < -0.5 * 3f64.sqrt() * h * 1.01;
        held_moments(&lattice, world, world, deep, region, held.entry(n as u32).or_default());
    }
    for &(from, to) in parts.merged.iter().filter(|(c, _)| !misses(*c)) {
        let (cell, basis) = (world_cell(grid, from), world_cell(grid, body.cells()[to as usize].lattice));
        held_moments(&lattice, cell, basis, false, region, held.entry(to).or_default());
    }
    let mut cells: Vec<ClampCell> = held
        .into_iter()
        // Rounding of a box that only touches a cell's face holds nothing.
        .filter(|(_, m)| m.area() > 1e-9 * h * h || m.volume() > 1e-9 * h.powi(3))
        .map(|(n, m)| ClampCell::new(body, n, &m))
        .collect();
    let pins = Pins::new(body, cells.iter());
    cells.iter_mut().for_each(|c| c.pins = pins.of(body, c.cell));
    cells
}
