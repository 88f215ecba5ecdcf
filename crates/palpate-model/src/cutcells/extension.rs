//! Continues displacement fields beyond the simulation nodes: weighted least-squares fits of affine fields.
//!
//! A band node's displacement is the value there of the affine field that fits the nodes around the nearest part of the body best.
//! Rigid motion (and any affine motion) is therefore continued exactly, and the adjoint is the transposed weights.

use crate::cutcells::distances::{SAMPLES, STEPS, place};
use crate::cutcells::domain::{Band, BandCell};
use crate::cutcells::grid::{CORNERS, Grid, shape_functions};
use crate::shape::Shape;
use crate::space::body::Body;
use crate::space::stencil::StencilBuf;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// First radius of the kernel, in cells: enough nodes for a fit of twelve numbers, few enough to stay local.
const RADIUS: f64 = 2.5;

/// Least mean square spread of the kernel's nodes along any direction, in h²; one cell alone has 0.25.
const SPREAD: f64 = 0.08;

/// Finds simulation nodes by lattice place.
pub struct NodeLookup {
    number: Vec<u32>,
}

impl NodeLookup {
    /// The lookup of a body.
    pub fn new(body: &Body) -> NodeLookup {
        let mut number = vec![u32::MAX; body.cut().grid.len()];
        for c in body.cells() {
            for (i, o) in CORNERS.iter().enumerate() {
                number[body.cut().grid.index(std::array::from_fn(|a| c.lattice[a] + o[a] as usize))] = c.nodes[i];
            }
        }
        NodeLookup { number }
    }

    /// Simulation node at a lattice place.
    pub fn node(&self, grid: &Grid, ijk: [usize; 3]) -> Option<u32> {
        Some(self.number[grid.index(ijk)]).filter(|&n| n != u32::MAX)
    }
}

/// The nodes that a fit may use.
pub(crate) trait Nearby: Sync {
    /// Distance of neighbouring nodes [m].
    fn spacing(&self) -> f64;
    /// A radius that holds all nodes from anywhere near the body [m].
    fn reach(&self) -> f64;
    /// Hands nodes to `visit` with the volume that each stands for over that of a cube of the spacing: all within the radius and maybe others.
    fn visit(&self, center: DVec3, radius: f64, visit: &mut dyn FnMut(u32, f64));
}

/// Nodes of a lattice.
struct OnLattice<'a> {
    body: &'a Body,
    lookup: &'a NodeLookup,
}

impl Nearby for OnLattice<'_> {
    fn spacing(&self) -> f64 {
        self.body.cut().grid.h
    }

    fn reach(&self) -> f64 {
        (self.body.cut().grid.size.iter().max().copied().unwrap_or(1)) as f64 * 2.0 * self.spacing()
    }

    fn visit(&self, center: DVec3, radius: f64, visit: &mut dyn FnMut(u32, f64)) {
        let grid = &self.body.cut().grid;
        let h = grid.h;
        let bound = |s: f64, a: usize| ((s / h).round() as i64 - i64::from(grid.offset[a])).clamp(0, grid.size[a] as i64 - 1);
        let lo: [usize; 3] = std::array::from_fn(|a| bound(center[a] - radius, a) as usize);
        let hi: [usize; 3] = std::array::from_fn(|a| bound(center[a] + radius, a) as usize);
        for k in lo[2]..=hi[2] {
            for j in lo[1]..=hi[1] {
                for i in lo[0]..=hi[0] {
                    let Some(n) = self.lookup.node(grid, [i, j, k]) else { continue };
                    visit(n, self.body.node_volume[n as usize] / h.powi(3));
                }
            }
        }
    }
}

/// A weighted least-squares fit of affine fields: value and gradient anywhere are linear in the nodes' values.
pub(crate) struct AffineFit {
    pub(crate) nodes: Vec<u32>,
    offsets: Vec<DVec3>,
    kernel: Vec<f64>,
    total: f64,
    mean: DVec3,
    inverse: DMat3,
}

impl AffineFit {
    /// Fits around `center` [m] with a kernel of the given radius [m], grown until the nodes span all directions.
    pub(crate) fn new(body: &Body, near: &dyn Nearby, center: DVec3, radius: f64) -> AffineFit {
        let h = near.spacing();
        let reach = near.reach() + radius;
        let mut r = radius.max(h);
        while r < reach {
            if let Some(fit) = AffineFit::within(body, near, center, r, true) {
                return fit;
            }
            r *= 1.4;
        }
        // Reached only if nearly all volume sits on one plane of nodes. Without volume as weight the nodes of any cell span space.
        AffineFit::within(body, near, center, 4.0 * reach, false).expect("a body has at least one cell, and its nodes span space")
    }

    fn within(body: &Body, near: &dyn Nearby, center: DVec3, radius: f64, by_volume: bool) -> Option<AffineFit> {
        let h = near.spacing();
        let (mut nodes, mut offsets, mut kernel) = (Vec::new(), Vec::new(), Vec::new());
        near.visit(center, radius, &mut |n, part| {
            let d = body.nodes[n as usize] - center;
            let q = 1.0 - d.length_squared() / (radius * radius);
            let volume = if by_volume { part } else { 1.0 };
            // Negative or vanishing volumes (rounding of moment fitting) carry no information about the body.
            if q > 0.0 && volume > 1e-9 {
                nodes.push(n);
                offsets.push(d);
                kernel.push(q * q * volume);
            }
        });
        let total: f64 = kernel.iter().sum();
        if nodes.len() < 4 {
            return None;
        }
        let mean = offsets.iter().zip(&kernel).map(|(d, k)| *d * *k).sum::<DVec3>() / total;
        let mut moment = DMat3::ZERO;
        for (d, k) in offsets.iter().zip(&kernel) {
            let d = *d - mean;
            moment += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * *k;
        }
        // Sylvester's criterion for: every eigenvalue of the mean moment exceeds the least spread.
        let s = moment * (1.0 / total) - DMat3::from_diagonal(DVec3::splat(SPREAD * h * h));
        let minor = s.x_axis.x * s.y_axis.y - s.x_axis.y * s.y_axis.x;
        if !(s.x_axis.x > 0.0 && minor > 0.0 && s.determinant() > 0.0) {
            return None;
        }
        Some(AffineFit { nodes, offsets, kernel, total, mean: mean + center, inverse: moment.inverse() }.relative(center))
    }

    /// Makes offsets relative to the mean.
    fn relative(mut self, center: DVec3) -> AffineFit {
        let shift = self.mean - center;
        for d in &mut self.offsets {
            *d -= shift;
        }
        self
    }

    /// Weights of the nodes for the value at `p`; they sum to one.
    pub(crate) fn value(&self, p: DVec3) -> Vec<f64> {
        let a = self.inverse * (p - self.mean);
        self.offsets.iter().zip(&self.kernel).map(|(d, k)| k * (1.0 / self.total + a.dot(*d))).collect()
    }

    /// Weights of the nodes for the gradient [1/m]; they sum to zero.
    pub(crate) fn gradient(&self) -> Vec<DVec3> {
        self.offsets.iter().zip(&self.kernel).map(|(d, k)| self.inverse * *d * *k).collect()
    }
}

/// Stencil that carries a point of the rest configuration [m] and its surroundings: its position by trilinear interpolation if it lies in an active cell, else
/// by the affine fit; the gradient always by the affine fit of radius about `radius` [m] around the point.
pub fn affine_weights(body: &Body, lookup: &NodeLookup, point: DVec3, radius: f64) -> StencilBuf {
    let fit = AffineFit::new(body, &OnLattice { body, lookup }, point, radius);
    let mut nodes = fit.nodes.clone();
    let mut gradient_weights = fit.gradient();
    let mut position_weights = vec![0.0; nodes.len()];
    match active_cell(body, point) {
        Some((cell, xi)) => {
            for (n, w) in body.cells()[cell].nodes.iter().zip(shape_functions(xi)) {
                match nodes.iter().position(|m| m == n) {
                    Some(k) => position_weights[k] += w,
                    None => {
                        nodes.push(*n);
                        position_weights.push(w);
                        gradient_weights.push(DVec3::ZERO);
                    }
                }
            }
        }
        None => position_weights = fit.value(point),
    }
    StencilBuf { nodes, value: position_weights, gradient: gradient_weights }
}

/// The active cell that holds a point of the rest configuration [m], with local coordinates; on a shared face either of the two.
pub fn active_cell(body: &Body, point: DVec3) -> Option<(usize, DVec3)> {
    let (c, xi) = body.cut().grid.locate(point)?;
    let find = |c: [usize; 3]| {
        body.cells().binary_search_by_key(&body.cut().grid.index(c), |cell| body.cut().grid.index(cell.lattice)).ok()
    };
    if let Some(n) = find(c) {
        return Some((n, xi));
    }
    // A point on a face (up to rounding) may have been located in the empty cell behind it.
    for code in 1..27 {
        let mut near = c;
        let mut inside = xi;
        let mut touches = true;
        for (a, step) in [code % 3, code / 3 % 3, code / 9].into_iter().enumerate() {
            if step == 1 && xi[a] < 1e-6 && c[a] > 0 {
                near[a] -= 1;
                inside[a] = 1.0;
            } else if step == 2 && xi[a] > 1.0 - 1e-6 {
                near[a] += 1;
                inside[a] = 0.0;
            } else if step != 0 {
                touches = false;
            }
        }
        if touches && let Some(n) = find(near) {
            return Some((n, inside));
        }
    }
    None
}

/// The band of width `width` [m] around a body of cells: its cells, their signed distances, and the extension to its nodes.
pub fn band(body: &Body, shape: &dyn Shape, width: f64) -> Band {
    let grid = &body.cut().grid;
    let lookup = NodeLookup::new(body);
    let mut active = vec![false; grid.len()];
    for c in body.cells() {
        active[grid.index(c.lattice)] = true;
    }
    let near = OnLattice { body, lookup: &lookup };
    let row = |p: DVec3| {
        let fit = AffineFit::new(body, &near, shape.closest_point(p), RADIUS * grid.h);
        let weights = fit.value(p);
        (fit.nodes, weights)
    };
    band_of(body, shape, width, grid.clone(), &active, lookup.number.clone(), row)
}

/// A band on a lattice: `active` cells and those within the width, with the lattice's corners that are simulation nodes in `number` (the others
/// `u32::MAX`), and of any other corner a `row` of nodes and weights.
pub(super) fn band_of(
    body: &Body,
    shape: &dyn Shape,
    width: f64,
    grid: Grid,
    active: &[bool],
    mut number: Vec<u32>,
    row: impl Fn(DVec3) -> (Vec<u32>, Vec<f64>) + Sync + Send,
) -> Band {
    let h = grid.h;
    let width = width.max(0.0);
    // No point of a cell is farther than this from its middle, or (over the steps) from the nearest of its samples.
    let reach = 0.5 * 3f64.sqrt() * h;
    let cells = grid.size.map(|n| n - 1);
    let slabs: Vec<Vec<[usize; 3]>> = (0..cells[2])
        .into_par_iter()
        .map(|k| {
            let mut slab = Vec::new();
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let c = [i, j, k];
                    if active[grid.index(c)] || shape.signed_distance(grid.position(c) + 0.5 * h) <= width + reach {
                        slab.push(c);
                    }
                }
            }
            slab
        })
        .collect();
    let candidates: Vec<[usize; 3]> = slabs.into_iter().flatten().collect();

    // Distances at the samples, every point once.
    let fine =
        Grid { offset: grid.offset.map(|o| STEPS as i32 * o), size: grid.size.map(|n| STEPS * (n - 1) + 1), h: h / STEPS as f64 };
    let mut wanted = vec![false; fine.len()];
    let points = |c: [usize; 3]| {
        let fine = &fine;
        (0..SAMPLES.pow(3)).map(move |q| fine.index(std::array::from_fn(|a| STEPS * c[a] + place(q)[a])))
    };
    for &c in &candidates {
        points(c).for_each(|i| wanted[i] = true);
    }
    let distance: Vec<f64> = wanted
        .into_par_iter()
        .enumerate()
        .map(|(i, w)| if w { shape.signed_distance(fine.position(fine.coordinates(i))) } else { f64::INFINITY })
        .collect();

    let kept: Vec<[usize; 3]> = candidates
        .into_iter()
        .filter(|&c| active[grid.index(c)] || points(c).any(|i| distance[i] <= width + reach / STEPS as f64))
        .collect();
    for &c in &kept {
        for o in CORNERS {
            let n = &mut number[grid.index(std::array::from_fn(|a| c[a] + o[a] as usize))];
            if *n == u32::MAX {
                *n = u32::MAX - 1;
            }
        }
    }
    let mut nodes = Vec::new();
    for (index, n) in number.iter_mut().enumerate().filter(|(_, n)| **n == u32::MAX - 1) {
        *n = (body.nodes.len() + nodes.len()) as u32;
        nodes.push(grid.position(grid.coordinates(index)));
    }
    let fits: Vec<(Vec<u32>, Vec<f64>)> = nodes.par_iter().map(|&p| row(p)).collect();
    let mut band = Band { width, nodes, rows: vec![0], ..Band::default() };
    for (columns, values) in fits {
        band.columns.extend(columns);
        band.values.extend(values);
        band.rows.push(band.columns.len() as u32);
    }
    band.cells = kept
        .into_iter()
        .map(|c| {
            let mut sdf = [0.0; SAMPLES.pow(3)];
            for (s, i) in sdf.iter_mut().zip(points(c)) {
                *s = distance[i];
            }
            BandCell {
                lattice: c,
                nodes: CORNERS.map(|o| number[grid.index(std::array::from_fn(|a| c[a] + o[a] as usize))]),
                sdf,
            }
        })
        .collect();
    band.grid = grid;
    band
}

#[cfg(test)]
#[path = "extension_tests.rs"]
mod tests;
