//! Builds a body from its shape: cuts every cell, numbers nodes, collects surface, ghost penalty and band.

use crate::cutcells::cut::{CellCut, Lattice, POINTS27, cut_cell};
use crate::cutcells::domain::{Cell, CutCells, GhostLine};
use crate::cutcells::extension;
use crate::cutcells::grid::{CORNERS, Grid, shape_functions};
use crate::shape::{Shape, unit_hint};
use crate::space::body::{Body, Patch};
use crate::space::stencil::Stencils;
use glam::DVec3;
use rayon::prelude::*;

/// Sub-cubes per axis that a cut cell is divided into unless told otherwise. With 4 a surface of radius r lies up to h²/(128 r) inside
/// the true one, a sixteenth of what cells without subdivision would leave.
pub const SUBDIVISIONS: usize = 4;

/// Most cells of a lattice.
pub const MAX_CELLS: f64 = 5e6;

/// Most cells of a body.
pub const MAX_BODY_CELLS: f64 = 1e6;

/// Memory that a cell of the band takes at most while a body is cut [B]: its distances, and what its nodes are continued from.
const BAND_MEMORY: f64 = 1.95e3;

/// The same of any cell of the lattice [B]: the distances at its samples, each with whether it is wanted.
const LATTICE_MEMORY: f64 = 7.5e2;

/// Places along the longest side at which a shape is asked how much of its bounding box it fills.
const ASKED: f64 = 24.0;

/// Cells with less of the body than this fraction are merged into a neighbour: below it the cut of a surface that grazes a lattice
/// plane leaves nothing but rounding to compute with. Volume and surface are kept, as continuations of the neighbour.
const SLIVER: f64 = 1e-6;

/// Why a body could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// The cell size is not a positive number.
    #[error("cell size is {h} m; allowed is any positive number")]
    BadCellSize {
        /// Edge of a cell [m].
        h: f64,
    },
    /// The shape has no extent.
    #[error("the object is empty or not finite: bounds {min} to {max} m")]
    Empty {
        /// Lowest corner [m].
        min: DVec3,
        /// Highest corner [m].
        max: DVec3,
    },
    /// Not one cell fits.
    #[error(
        "cell size {h} m is too large for an object of {:.4} × {:.4} × {:.4} m: no cell fits; use {:.4} m or less",
        size.x, size.y, size.z, size.max_element() / 4.0
    )]
    CellTooLarge {
        /// Edge of a cell [m].
        h: f64,
        /// Size of the object's bounding box [m].
        size: DVec3,
    },
    /// The body would have too many cells.
    #[error(
        "cell size {h} m gives about {cells:.1e} cells, which take {:.1} GB before anything is computed; at most {MAX_BODY_CELLS:.0e} are \
         allowed, use cells of {suggestion:.2e} m or more{}",
        cells * (BAND_MEMORY + LATTICE_MEMORY) * 1e-9, unit_hint(*longest)
    )]
    TooLarge {
        /// Edge of a cell [m].
        h: f64,
        /// Number of cells, as estimated.
        cells: f64,
        /// Longest side of the object's bounding box [m].
        longest: f64,
        /// A cell size that fits [m].
        suggestion: f64,
    },
    /// The lattice would be huge.
    #[error(
        "cell size {h} m gives a lattice of {cells:.2e} cells for an object of {:.4} × {:.4} × {:.4} m; at most {MAX_CELLS:.0e} are \
         allowed, use {suggestion:.2e} m or more{}",
        size.x, size.y, size.z, unit_hint(size.max_element())
    )]
    TooManyCells {
        /// Edge of a cell [m].
        h: f64,
        /// Number of cells of the lattice.
        cells: f64,
        /// Size of the object's bounding box [m].
        size: DVec3,
        /// A cell size that fits [m].
        suggestion: f64,
    },
}

/// A body together with what is known about its lattice only while building plans.
pub(crate) struct Parts {
    /// The body.
    pub body: Body,
    /// Cells merged into a neighbour: lattice coordinates (as in [`Cell::lattice`]) and number of the neighbour in [`CutCells::cells`].
    pub merged: Vec<([usize; 3], u32)>,
}

impl Body {
    /// Cuts `shape` out of a lattice of edge `h` [m]; observed points can be looked up within `band_width` [m] of its surface.
    /// Same input, same bits, whatever the number of threads.
    pub fn build(shape: &dyn Shape, h: f64, band_width: f64, subdivisions: usize) -> Result<Body, BodyError> {
        build_parts(shape, h, band_width, subdivisions).map(|p| p.body)
    }
}

/// What the lattice says about one cell.
enum Found {
    Nothing,
    Full,
    Cut(Box<CellCut>),
}

/// World lattice coordinates of a grid cell.
pub(crate) fn world_cell(grid: &Grid, c: [usize; 3]) -> [i64; 3] {
    std::array::from_fn(|a| i64::from(grid.offset[a]) + c[a] as i64)
}

pub(crate) fn build_parts(shape: &dyn Shape, h: f64, band_width: f64, subdivisions: usize) -> Result<Parts, BodyError> {
    let (grid, border) = lattice_for(shape, h, band_width)?;
    let size = shape.bounds().1 - shape.bounds().0;
    let too_large = BodyError::CellTooLarge { h, size };
    if size.max_element() < h {
        return Err(too_large);
    }
    // Octants are made of whole sub-cubes only if their number is even.
    let subdivisions = subdivisions.max(2).next_multiple_of(2);
    let distance = |p: DVec3| shape.signed_distance(p);
    let lattice = Lattice { distance: &distance, h, subdivisions };

    // Half a cell's diagonal, with a little slack for rounding: beyond it the surface cannot reach the cell.
    let reach = 0.5 * 3f64.sqrt() * h * 1.01;
    let cells = grid.size.map(|n| n - 1);
    let slabs: Vec<Vec<([usize; 3], Found)>> = (border..cells[2] - border)
        .into_par_iter()
        .map(|k| {
            let mut slab = Vec::new();
            for j in border..cells[1] - border {
                for i in border..cells[0] - border {
                    let c = [i, j, k];
                    let middle = grid.position(c) + 0.5 * h;
                    let d = shape.signed_distance(middle);
                    let found = if d > reach {
                        Found::Nothing
                    } else if d < -reach {
                        Found::Full
                    } else {
                        let world = world_cell(&grid, c);
                        let cut = cut_cell(&lattice, world, world);
                        if cut.fraction > 0.0 { Found::Cut(Box::new(cut)) } else { Found::Nothing }
                    };
                    if !matches!(found, Found::Nothing) {
                        slab.push((c, found));
                    }
                }
            }
            slab
        })
        .collect();
    let mut found: Vec<([usize; 3], CellCut)> = slabs
        .into_iter()
        .flatten()
        .map(|(c, f)| match f {
            Found::Cut(cut) => (c, *cut),
            _ => (c, CellCut::full()),
        })
        .collect();
    if found.is_empty() {
        return Err(too_large);
    }
    let slivers = merge_slivers(&grid, &lattice, &mut found);

    let mut number = vec![u32::MAX; grid.len()];
    for (c, _) in &found {
        for o in CORNERS {
            number[grid.index(corner(*c, o))] = 0;
        }
    }
    let mut nodes = Vec::new();
    for (index, n) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
        *n = nodes.len() as u32;
        nodes.push(grid.position(grid.coordinates(index)));
    }
    let (mut active, mut patches) = (Vec::with_capacity(found.len()), Vec::new());
    let mut surface = Stencils::default();
    let mut node_volume = vec![0.0; nodes.len()];
    let (mut fractions, mut moment) = (0.0, DVec3::ZERO);
    let basis = POINTS27.map(shape_functions);
    for (n, (lattice, cut)) in found.into_iter().enumerate() {
        let ids = CORNERS.map(|o| number[grid.index(corner(lattice, o))]);
        let low = grid.position(lattice);
        for q in 0..27 {
            for i in 0..8 {
                node_volume[ids[i] as usize] += cut.weights[q] * basis[q][i] * h.powi(3);
            }
            moment += (low + POINTS27[q] * h) * cut.weights[q];
        }
        fractions += cut.fraction;
        for p in &cut.pieces {
            surface.push(&ids, &p.weights);
            patches.push(Patch { cell: n as u32, area: p.area, normal: p.normal, point: p.point });
        }
        active.push(Cell { lattice, nodes: ids, fraction: cut.fraction, weights: cut.weights });
    }
    let ghosts = ghost_lines(&grid, &active);
    let center = moment / fractions;
    let corner = |f: fn(DVec3, DVec3) -> DVec3| patches.iter().map(|p: &Patch| p.point).reduce(f).unwrap_or(center);
    let corners = (corner(DVec3::min), corner(DVec3::max));
    let mut body = Body {
        area: patches.iter().map(|p| p.area).sum(),
        volume: fractions * h.powi(3),
        center,
        corners,
        length: h,
        nodes,
        node_volume,
        patches,
        surface,
        cut: Some(CutCells { grid, cells: active, ghosts }),
        points: Default::default(),
        band: Default::default(),
    };
    body.band = extension::band(&body, shape, band_width);
    Ok(Parts { body, merged: slivers })
}

fn corner(c: [usize; 3], o: [i32; 3]) -> [usize; 3] {
    std::array::from_fn(|a| c[a] + o[a] as usize)
}

/// The lattice around a shape, and how many cells at its rim cannot hold any of it.
pub(super) fn lattice_for(shape: &dyn Shape, h: f64, band_width: f64) -> Result<(Grid, usize), BodyError> {
    if !(h > 0.0 && h.is_finite()) {
        return Err(BodyError::BadCellSize { h });
    }
    let (min, max) = shape.bounds();
    let size = max - min;
    if !(min.is_finite() && max.is_finite() && size.min_element() >= 0.0 && size.max_element() > 0.0) {
        return Err(BodyError::Empty { min, max });
    }
    let border = (band_width.max(0.0) / h).ceil() + 2.0;
    let cells = |h: f64| ((size / h).ceil() + 2.0 * ((band_width.max(0.0) / h).ceil() + 2.0)).element_product();
    let count = cells(h);
    // Lattice coordinates are 32 bit: far from the origin even a small body could run out of them.
    let far = min.abs().max(max.abs()).max_element() / h + border > 1e9;
    if count > MAX_CELLS || far {
        let mut suggestion = h;
        while cells(suggestion) > MAX_CELLS && suggestion < 1e3 * size.max_element() {
            suggestion *= 1.1;
        }
        return Err(BodyError::TooManyCells { h, cells: count, size, suggestion });
    }
    if count > MAX_BODY_CELLS {
        let cells = filled(shape, min, size, 0.0) * (size / h).element_product();
        if cells > MAX_BODY_CELLS {
            let (longest, suggestion) = (size.max_element(), 1.02 * h * (cells / MAX_BODY_CELLS).cbrt());
            return Err(BodyError::TooLarge { h, cells, longest, suggestion });
        }
    }
    let border = border as i32;
    Ok((Grid::covering(min, max, h, border), border as usize - 1))
}

/// Memory that cutting a shape out of a lattice takes at its peak [B], an estimate; `None` where that is refused anyway.
pub fn memory(shape: &dyn Shape, h: f64, band_width: f64) -> Option<f64> {
    let (grid, _) = lattice_for(shape, h, band_width).ok()?;
    let lattice = grid.len() as f64;
    let (min, max) = shape.bounds();
    // The middle of a cell that reaches into the band, and a little more for where its surface bends.
    let reach = band_width.max(0.0) + 0.7 * h;
    let (low, size) = (min - reach, max - min + 2.0 * reach);
    let all = (size / h).element_product().min(lattice);
    // The share is asked for only where it matters.
    let band = if all < 1e4 { all } else { all * filled(shape, low, size, reach) };
    Some(band * BAND_MEMORY + lattice * LATTICE_MEMORY)
}

/// Share of a box that lies within `reach` [m] of a shape, by asking at a few places.
pub(crate) fn filled(shape: &dyn Shape, min: DVec3, size: DVec3, reach: f64) -> f64 {
    let n = (size / size.max_element() * ASKED).ceil().max(DVec3::ONE);
    let [nx, ny, nz] = n.to_array().map(|n| n as usize);
    let at = |k: usize| min + size * (DVec3::new((k % nx) as f64, (k / nx % ny) as f64, (k / nx / ny) as f64) + 0.5) / n;
    let all = nx * ny * nz;
    (0..all).into_par_iter().filter(|&k| shape.signed_distance(at(k)) < reach).count() as f64 / all as f64
}

/// Takes slivers out of `found` and adds their volume and surface to the neighbouring cell nearest to what they hold.
fn merge_slivers(grid: &Grid, lattice: &Lattice, found: &mut Vec<([usize; 3], CellCut)>) -> Vec<([usize; 3], u32)> {
    let index = |c: [usize; 3]| grid.index(c);
    // `found` is in lattice order, so neighbours are found by bisection.
    let place = |found: &[([usize; 3], CellCut)], c| found.binary_search_by_key(&index(c), |(c, _)| index(*c)).ok();
    let mut moves = Vec::new();
    for (n, (c, cut)) in found.iter().enumerate().filter(|(_, (_, cut))| cut.fraction < SLIVER) {
        let middle = cut.centroid();
        let mut best: Option<(f64, f64, usize)> = None;
        for o in 0..27 {
            let d = [o % 3, o / 3 % 3, o / 9];
            let Some(m) = place(found, [c[0] + d[0] - 1, c[1] + d[1] - 1, c[2] + d[2] - 1]) else { continue };
            if found[m].1.fraction < SLIVER {
                continue;
            }
            let low = DVec3::new(d[0] as f64, d[1] as f64, d[2] as f64) - 1.0;
            let gap = (middle - middle.clamp(low, low + 1.0)).length();
            if best.is_none_or(|(g, f, _)| gap < g || gap == g && found[m].1.fraction > f) {
                best = Some((gap, found[m].1.fraction, m));
            }
        }
        // A sliver without a neighbour is all there is of the body here, and stays.
        moves.extend(best.map(|(_, _, m)| (n, m)));
    }
    let mut gone = vec![false; found.len()];
    for &(n, m) in &moves {
        gone[n] = true;
        let (from, to) = (found[n].0, found[m].0);
        let more = cut_cell(lattice, world_cell(grid, from), world_cell(grid, to));
        let host = &mut found[m].1;
        host.fraction += more.fraction;
        for q in 0..27 {
            host.weights[q] += more.weights[q];
        }
        host.pieces.extend(more.pieces);
    }
    let hosts: Vec<_> = moves.iter().map(|&(n, m)| (found[n].0, found[m].0)).collect();
    let mut keep = gone.iter().map(|g| !g);
    found.retain(|_| keep.next().unwrap_or(true));
    hosts.into_iter().filter_map(|(c, host)| Some((c, place(found, host)? as u32))).collect()
}

/// Lines a-b-c across every face between two active cells of which one is cut, b on the face.
fn ghost_lines(grid: &Grid, cells: &[Cell]) -> Vec<GhostLine> {
    let mut at = vec![u32::MAX; grid.len()];
    for (n, c) in cells.iter().enumerate() {
        at[grid.index(c.lattice)] = n as u32;
    }
    let mut lines = Vec::new();
    for c in cells {
        for axis in 0..3 {
            let mut next = c.lattice;
            next[axis] += 1;
            let m = at[grid.index(next)];
            if m == u32::MAX || c.is_full() && cells[m as usize].is_full() {
                continue;
            }
            let bit = 1 << axis;
            for i in (0..8).filter(|i| i & bit == 0) {
                lines.push([c.nodes[i], c.nodes[i | bit], cells[m as usize].nodes[i | bit]]);
            }
        }
    }
    lines.sort_unstable();
    let mut merged: Vec<GhostLine> = Vec::new();
    for nodes in lines {
        match merged.last_mut() {
            Some(l) if l.nodes == nodes => l.weight += 0.25,
            _ => merged.push(GhostLine { nodes, weight: 0.25 }),
        }
    }
    merged
}

#[cfg(test)]
mod tests;
