//! The system matrix: symmetric block-compressed rows of 3 × 3 blocks.

use super::simd::wide;
use glam::{DMat3, DVec3};
use palpate_model::space::pattern::BlockRows;
use rayon::prelude::*;

/// Values of a [`BlockRows`]; row-major blocks: entry (r, c) of a block is the effect of component c on component r.
#[derive(Debug, Default)]
pub struct Matrix {
    /// One 3 × 3 block per place.
    pub values: Vec<DMat3>,
}

impl Matrix {
    /// Mean of the three diagonal numbers of the block at a place.
    pub fn mean_diagonal(&self, place: usize) -> f64 {
        let block = self.values[place];
        (block.x_axis.x + block.y_axis.y + block.z_axis.z) / 3.0
    }
}

/// Something that can be multiplied by a vector.
pub trait Operator {
    /// y = A x.
    fn multiply(&self, x: &[DVec3], y: &mut [DVec3]);
}

/// Blocks that one task copies in a row.
const BLOCKS: usize = 8192;
/// Rows of a matrix that one thread multiplies faster than two would meet.
const FEW: usize = 1024;
/// Rows that one task multiplies in a row: few enough that two threads finish together.
const ROWS: usize = 128;

/// A block with its columns padded to four numbers, one vector register each.
type Block<T> = [T; 12];

/// A copy of a matrix for many products, in padded blocks.
///
/// In `f32` it holds the matrix to 6e-8, good enough for directions that only need a few digits, in half the memory; sums are
/// made in f64 either way.
#[derive(Debug)]
pub struct Packed<'a, T> {
    rows: &'a BlockRows,
    blocks: Vec<Block<T>>,
}

impl<T> Packed<'_, T> {
    /// Memory of the copy of a matrix with these blocks [B].
    pub fn bytes(rows: &BlockRows) -> usize {
        size_of::<Block<T>>() * rows.columns.len()
    }
}

impl<'a, T: Copy + Default + Send + Sync> Packed<'a, T> {
    /// Copies a matrix, number by number.
    pub fn new(rows: &'a BlockRows, matrix: &Matrix, number: impl Fn(f64) -> T + Sync) -> Packed<'a, T> {
        let mut blocks = vec![Block::<T>::default(); matrix.values.len()];
        blocks.par_chunks_mut(BLOCKS).zip(matrix.values.par_chunks(BLOCKS)).for_each(|(blocks, values)| {
            for (block, value) in blocks.iter_mut().zip(values) {
                for (c, column) in [value.x_axis, value.y_axis, value.z_axis].into_iter().enumerate() {
                    for r in 0..3 {
                        block[4 * c + r] = number(column[r]);
                    }
                }
            }
        });
        Packed { rows, blocks }
    }
}

impl<T: Copy + Into<f64> + Send + Sync> Packed<'_, T> {
    #[inline(always)]
    fn row(&self, a: usize, x: &[DVec3]) -> DVec3 {
        let mut sums = [[0.0; 4]; 3];
        let range = self.rows.rows[a]..self.rows.rows[a + 1];
        for (block, &b) in self.blocks[range.clone()].iter().zip(&self.rows.columns[range]) {
            let x = x[b as usize].to_array();
            for c in 0..3 {
                for r in 0..4 {
                    let entry: f64 = block[4 * c + r].into();
                    sums[c][r] += entry * x[c];
                }
            }
        }
        DVec3::from_array([0, 1, 2].map(|r| sums[0][r] + sums[1][r] + sums[2][r]))
    }
}

impl<T: Copy + Into<f64> + Send + Sync> Operator for Packed<'_, T> {
    fn multiply(&self, x: &[DVec3], y: &mut [DVec3]) {
        let some = |(piece, y): (usize, &mut [DVec3])| {
            wide(
                #[inline(always)]
                || {
                    for (i, y) in y.iter_mut().enumerate() {
                        *y = self.row(ROWS * piece + i, x);
                    }
                },
            );
        };
        if y.len() <= FEW {
            y.chunks_mut(ROWS).enumerate().for_each(some);
        } else {
            y.par_chunks_mut(ROWS).enumerate().for_each(some);
        }
    }
}

impl Matrix {
    /// Inverses of the diagonal blocks `[N]`; the error is the number of the first block that is not positive definite.
    pub fn diagonal_inverses(&self, rows: &BlockRows) -> Result<Vec<DMat3>, usize> {
        rows.diagonal
            .iter()
            .enumerate()
            .map(|(a, &k)| {
                let d = self.values[k];
                let minor = d.x_axis.x * d.y_axis.y - d.x_axis.y * d.y_axis.x;
                let det = d.determinant();
                if d.x_axis.x > 0.0 && minor > 0.0 && det > 0.0 && det.is_finite() { Ok(d.inverse()) } else { Err(a) }
            })
            .collect()
    }
}
