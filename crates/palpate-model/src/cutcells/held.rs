//! What a clamp leaves free of a cell, and which nodes it pins.
//!
//! What a clamp holds is not part of the elastic body: that ends at the clamp's faces, where Nitsche's terms hold it. A cell that such a face
//! cuts has one set of trilinear functions for both sides. Were its held side kept still over its volume, the cell could not bend at all, and
//! the clamp would act from the next face of the lattice on: an error of first order. So only nodes that no free part of the body needs are
//! pinned.

use crate::cutcells::cut::POINTS27;
use crate::cutcells::domain::Cell;
use crate::cutcells::grid::shape_gradients;
use crate::plan::ClampCell;
use crate::space::body::Body;
use glam::DVec3;
use std::collections::BTreeMap;

/// Free share of a cell from which on its nodes are not pinned at all; below it they are the more the less of the cell is free, so that
/// nothing jumps when an edge passes a face of the lattice, and no node is left with almost no stiffness.
const LOOSE: f64 = 0.02;

/// The part of a cell that deforms: inside the body, and held by no clamp.
#[derive(Clone, Copy, Debug)]
pub struct FreePart {
    /// Gauss weights.
    pub weights: [f64; 27],
    /// Fraction of the cell.
    pub fraction: f64,
}

impl FreePart {
    /// All that a cell has of the body.
    pub fn of(cell: &Cell) -> FreePart {
        FreePart { weights: cell.weights, fraction: cell.fraction }
    }

    /// Leaves out a held part.
    pub fn take(&mut self, held: &[f64; 27]) {
        self.weights.iter_mut().zip(held).for_each(|(w, h)| *w -= h);
        self.fraction -= held.iter().sum::<f64>();
        // A millionth of a cell is rounding.
        if self.fraction < 1e-6 {
            *self = FreePart { weights: [0.0; 27], fraction: 0.0 };
        }
    }

    /// Mean of ∇N_i [1/m], which the weights integrate exactly; 0 where nothing is free.
    pub fn mean_gradient(&self, h: f64) -> [DVec3; 8] {
        let mut mean = [DVec3::ZERO; 8];
        if self.fraction == 0.0 {
            return mean;
        }
        for q in 0..27 {
            let g = shape_gradients(POINTS27[q]);
            for i in 0..8 {
                mean[i] += g[i] * (self.weights[q] / (self.fraction * h));
            }
        }
        mean
    }
}

/// Pin of every node of the cells that one clamp holds, 0 (not held) to 1, by the largest free share of the cells around it.
#[derive(Debug)]
pub struct Pins(BTreeMap<u32, f64>);

impl Pins {
    /// The pins of a clamp that holds `cells`.
    pub fn new<'a>(body: &Body, cells: impl Iterator<Item = &'a ClampCell> + Clone) -> Pins {
        let free: BTreeMap<u32, f64> =
            cells.clone().map(|c| (c.cell, c.free(body).fraction / body.cells()[c.cell as usize].fraction)).collect();
        let mut pins: BTreeMap<u32, f64> = cells.flat_map(|c| body.cells()[c.cell as usize].nodes).map(|n| (n, 1.0)).collect();
        for (e, cell) in body.cells().iter().enumerate() {
            let free = free.get(&(e as u32)).unwrap_or(&1.0);
            for n in cell.nodes {
                if let Some(pin) = pins.get_mut(&n) {
                    *pin = pin.min((1.0 - free / LOOSE).max(0.0));
                }
            }
        }
        Pins(pins)
    }

    /// The pins of the nodes of one of the clamp's cells.
    pub fn of(&self, body: &Body, cell: u32) -> [f64; 8] {
        body.cells()[cell as usize].nodes.map(|n| self.0[&n])
    }
}
