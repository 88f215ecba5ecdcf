//! The cells' tangents block by block, for the assembly of the matrix.

use super::ElasticCells;
use crate::terms::Curvature;
use crate::terms::assembly::Elements;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::corotation::M24;

/// Cells with what their tangents do with negative curvature.
pub(super) struct Tangents<'a, 'b> {
    pub(super) term: &'b ElasticCells<'a>,
    pub(super) curvature: Curvature,
}

impl Elements for Tangents<'_, '_> {
    type Scratch = M24;

    fn count(&self) -> usize {
        self.term.cells.body().cells().len()
    }

    #[inline(always)]
    fn nodes(&self, e: usize) -> &[u32] {
        &self.term.cells.body().cells()[e].nodes
    }

    #[inline(always)]
    fn places(&self, e: usize) -> &[u32] {
        &self.term.cells.c.places.cells[e]
    }

    fn scratch(&self) -> M24 {
        [0.0; 576]
    }

    #[inline(always)]
    fn blocks(&self, e: usize, h: &mut M24, mut put: impl FnMut(usize, usize, DMat3)) {
        self.term.upper_tangent(e, self.curvature, h);
        for i in 0..8 {
            put(i, i, block(h, i, i));
            for j in i + 1..8 {
                let block = block(h, i, j);
                put(i, j, block);
                put(j, i, block.transpose());
            }
        }
    }
}

/// Block (i, j) of a 24 × 24 row-major matrix.
#[inline(always)]
pub fn block(k: &M24, i: usize, j: usize) -> DMat3 {
    let at = |r: usize, c: usize| k[24 * (3 * i + r) + 3 * j + c];
    DMat3::from_cols(
        DVec3::new(at(0, 0), at(1, 0), at(2, 0)),
        DVec3::new(at(0, 1), at(1, 1), at(2, 1)),
        DVec3::new(at(0, 2), at(1, 2), at(2, 2)),
    )
}
