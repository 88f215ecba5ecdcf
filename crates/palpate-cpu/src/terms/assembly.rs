//! Adds the elements' tangents into the system matrix, every element computed once, in an order that does not depend on threads.
//!
//! Rows are cut into parts that are filled side by side. An element belongs to the part of its first node; blocks in rows of other
//! parts are set aside and added in a second pass.

use crate::linear::matrix::Matrix;
use crate::linear::simd::wide;
use glam::DMat3;
use palpate_model::space::pattern::Pattern;
use rayon::prelude::*;

/// Elements of one kind, cells or elastic points.
pub(super) trait Elements: Sync {
    /// What computing a tangent overwrites.
    type Scratch: Sized;
    /// Number of elements.
    fn count(&self) -> usize;
    /// Nodes of an element `[n]`.
    fn nodes(&self, e: usize) -> &[u32];
    /// Places of its blocks in the matrix `[n · n]`, row by row.
    fn places(&self, e: usize) -> &[u32];
    /// Room for a tangent.
    fn scratch(&self) -> Self::Scratch;
    /// Calls `put` with every block (i, j) of the tangent.
    fn blocks(&self, e: usize, scratch: &mut Self::Scratch, put: impl FnMut(usize, usize, DMat3));
}

/// Blocks of one part's elements in rows of every other part `[part]`: place in the matrix, and block.
type Spill = Vec<Vec<(u32, DMat3)>>;

/// Overwrites the matrix with the sum of the elements' tangents.
pub(super) fn assemble(elements: &impl Elements, pattern: &Pattern, matrix: &mut Matrix) {
    matrix.values.resize(pattern.blocks.columns.len(), DMat3::ZERO);
    let spills: Vec<Spill> = slices(pattern, matrix)
        .into_par_iter()
        .map(|(part, values)| {
            wide(
                #[inline(always)]
                || fill(elements, pattern, part, values),
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

/// Overwrites the rows of one part with its own elements' blocks, and returns those in other rows.
#[inline(always)]
fn fill(elements: &impl Elements, pattern: &Pattern, part: usize, values: &mut [DMat3]) -> Spill {
    let rows = pattern.parts[part].clone();
    let base = pattern.blocks.rows[rows.start];
    let mut spill: Spill = vec![Vec::new(); pattern.parts.len()];
    let mut scratch = elements.scratch();
    // Of every node of an element, the other part that its row belongs to.
    let mut others = Vec::new();
    values.fill(DMat3::ZERO);
    for e in 0..elements.count() {
        let nodes = elements.nodes(e);
        if !rows.contains(&(nodes[0] as usize)) {
            continue;
        }
        others.clear();
        others.extend(nodes.iter().map(|n| *n as usize).map(|n| (!rows.contains(&n)).then(|| pattern.part_of(n))));
        let (places, n) = (elements.places(e), nodes.len());
        elements.blocks(
            e,
            &mut scratch,
            #[inline(always)]
            |i, j, block| match others[i] {
                None => values[places[n * i + j] as usize - base] += block,
                Some(other) => spill[other].push((places[n * i + j], block)),
            },
        );
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
