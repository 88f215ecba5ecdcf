//! Adds the cells' tangents into the system matrix, every cell computed once, in an order that does not depend on threads.
//!
//! Rows are cut into parts that are filled side by side. A cell belongs to the part of its first node; blocks in rows of other
//! parts are set aside and added in a second pass.

use super::ElasticCells;
use crate::linear::matrix::Matrix;
use crate::linear::simd::wide;
use crate::terms::Curvature;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::corotation::M24;
use palpate_model::space::pattern::Pattern;
use rayon::prelude::*;

/// Blocks of one part's cells in rows of every other part `[part]`: place in the matrix, and block.
type Spill = Vec<Vec<(u32, DMat3)>>;

/// Overwrites the matrix with the sum of the cells' tangents.
pub(super) fn assemble(term: &ElasticCells, curvature: Curvature, matrix: &mut Matrix) {
    let pattern = term.cells.c.pattern;
    matrix.values.resize(pattern.blocks.columns.len(), DMat3::ZERO);
    let spills: Vec<Spill> = slices(pattern, matrix)
        .into_par_iter()
        .map(|(part, values)| {
            wide(
                #[inline(always)]
                || fill(term, curvature, part, values),
            )
        })
        .collect();
    slices(pattern, matrix).into_par_iter().for_each(|(part, values)| {
        let base = pattern.blocks.rows[pattern.parts[part].start];
        for (place, block) in spills.iter().flat_map(|s| &s[part]) {
            values[*place as usize - base] += *block;
        }
    });
}

/// Overwrites the rows of one part with its own cells' blocks, and returns those in other rows.
#[inline(always)]
fn fill(term: &ElasticCells, curvature: Curvature, part: usize, values: &mut [DMat3]) -> Spill {
    let c = &term.cells.c;
    let pattern = c.pattern;
    let rows = pattern.parts[part].clone();
    let base = pattern.blocks.rows[rows.start];
    let mut spill: Spill = vec![Vec::new(); pattern.parts.len()];
    let mut h = [0.0; 576];
    values.fill(DMat3::ZERO);
    for (e, cell) in c.plan.body.cells().iter().enumerate() {
        if !rows.contains(&(cell.nodes[0] as usize)) {
            continue;
        }
        term.upper_tangent(e, curvature, &mut h);
        // Rows of other parts: which part.
        let others = cell.nodes.map(|n| n as usize).map(|n| (!rows.contains(&n)).then(|| pattern.part_of(n)));
        let places = &c.places.cells[e];
        let mut put = |i: usize, j: usize, block: DMat3| match others[i] {
            None => values[places[8 * i + j] as usize - base] += block,
            Some(other) => spill[other].push((places[8 * i + j], block)),
        };
        for i in 0..8 {
            put(i, i, block(&h, i, i));
            for j in i + 1..8 {
                let block = block(&h, i, j);
                put(i, j, block);
                put(j, i, block.transpose());
            }
        }
    }
    spill
}

/// The matrix cut into parts, each with its number.
fn slices<'a>(pattern: &Pattern, matrix: &'a mut Matrix) -> Vec<(usize, &'a mut [DMat3])> {
    let mut rest = matrix.values.as_mut_slice();
    let cut = |(number, part): (usize, &std::ops::Range<usize>)| {
        let (a, b) = std::mem::take(&mut rest).split_at_mut(pattern.blocks.rows[part.end] - pattern.blocks.rows[part.start]);
        rest = b;
        (number, a)
    };
    pattern.parts.iter().enumerate().map(cut).collect()
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
