//! Where places of the rest configuration lie in the cells, and which nodes they follow.

use crate::cutcells::domain::{Cell, CutCells};
use crate::cutcells::extension::{NodeLookup, active_cell, affine_weights};
use crate::cutcells::grid::{shape_functions, shape_gradients};
use crate::space::body::Body;
use crate::space::stencil::StencilBuf;
use glam::DVec3;

impl Cell {
    /// Trilinear interpolation at local coordinates `xi`; the gradient [1/m] is that of cells of edge `h` [m].
    fn stencil(&self, xi: DVec3, h: f64) -> StencilBuf {
        StencilBuf {
            nodes: self.nodes.to_vec(),
            value: shape_functions(xi).to_vec(),
            gradient: shape_gradients(xi).map(|g| g / h).to_vec(),
        }
    }
}

/// A point of the body itself: interpolated in its cell, or continued to from the nodes within about `radius` [m].
pub fn material_point(body: &Body, lookup: &NodeLookup, place: DVec3, radius: f64) -> StencilBuf {
    match active_cell(body, place) {
        Some((cell, xi)) => body.cells()[cell].stencil(xi, body.cut().grid.h),
        None => affine_weights(body, lookup, place, radius),
    }
}

/// A place that belongs to a cell, which may lie beside it: its field continued there.
pub fn in_cell(body: &Body, cell: u32, place: DVec3) -> StencilBuf {
    let (cell, grid) = (&body.cells()[cell as usize], &body.cut().grid);
    cell.stencil((place - grid.position(cell.lattice)) / grid.h, grid.h)
}

/// What lies on the body or beside it: interpolated in its cell, or at the nearest place of the nearest cell; and how far away that is [m].
pub fn beside(body: &Body, point: DVec3) -> (StencilBuf, f64) {
    let (grid, h) = (&body.cut().grid, body.cut().grid.h);
    if let Some((cell, xi)) = active_cell(body, point) {
        return (body.cells()[cell].stencil(xi, h), 0.0);
    }
    let local = |c: &Cell| (point - grid.position(c.lattice)) / h;
    let inside = |c: &Cell| local(c).clamp(DVec3::ZERO, DVec3::ONE);
    let gap = |c: &Cell| (local(c) - inside(c)).length();
    let nearest = body.cells().iter().min_by(|a, b| gap(a).total_cmp(&gap(b))).expect("a body has at least one cell");
    (nearest.stencil(inside(nearest), h), gap(nearest) * h)
}

/// Finds the cell nearest to a place.
pub struct CellLookup<'a> {
    cut: &'a CutCells,
    /// Numbers of the cells by lattice cell.
    number: Vec<u32>,
}

impl<'a> CellLookup<'a> {
    /// Looks every cell up once.
    pub fn new(cut: &'a CutCells) -> CellLookup<'a> {
        let mut number = vec![u32::MAX; cut.grid.len()];
        for (n, cell) in cut.cells.iter().enumerate() {
            number[cut.grid.index(cell.lattice)] = n as u32;
        }
        CellLookup { cut, number }
    }

    /// The trilinear field of the nearest cell, continued to a place outside (exact for affine motion); and how far outside that is [m].
    pub fn carry(&self, place: DVec3) -> (StencilBuf, f64) {
        let (number, distance) = self.nearest(place);
        let (cell, grid) = (&self.cut.cells[number], &self.cut.grid);
        (cell.stencil((place - grid.position(cell.lattice)) / grid.h, grid.h), distance)
    }

    /// Number of the cell nearest to a point, and its distance [m]; the lowest number among equals.
    fn nearest(&self, p: DVec3) -> (usize, f64) {
        let CutCells { grid, cells, .. } = self.cut;
        let distance = |number: usize| {
            let low = grid.position(cells[number].lattice);
            (p - p.clamp(low, low + DVec3::splat(grid.h))).length()
        };
        if let Some((ijk, _)) = grid.locate(p) {
            let own = self.number[grid.index(ijk)];
            if own != u32::MAX {
                return (own as usize, 0.0);
            }
            // Rings of cells around the point's own, until no farther ring can hold a nearer one.
            let reach = *grid.size.iter().max().expect("a grid has three sides");
            let mut best: Option<(usize, f64)> = None;
            for ring in 1..=reach {
                if best.is_some_and(|(_, d)| d <= (ring as f64 - 1.0) * grid.h) {
                    break;
                }
                let range = |a: usize| ijk[a].saturating_sub(ring)..=(ijk[a] + ring).min(grid.size[a] - 1);
                for k in range(2) {
                    for j in range(1) {
                        for i in range(0) {
                            let on_ring = [i, j, k].iter().zip(ijk).any(|(c, o)| c.abs_diff(o) == ring);
                            let number = self.number[grid.index([i, j, k])];
                            if !on_ring || number == u32::MAX {
                                continue;
                            }
                            let d = distance(number as usize);
                            if best.is_none_or(|(n, e)| d < e || (d == e && (number as usize) < n)) {
                                best = Some((number as usize, d));
                            }
                        }
                    }
                }
            }
            if let Some(best) = best {
                return best;
            }
        }
        // Outside the lattice altogether: look at every cell.
        (0..cells.len()).map(|n| (n, distance(n))).min_by(|a, b| a.1.total_cmp(&b.1)).expect("a body has at least one cell")
    }
}
