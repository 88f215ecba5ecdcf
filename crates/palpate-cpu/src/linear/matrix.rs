//! The system matrix: symmetric block-compressed rows of 3 × 3 blocks.

use glam::{DMat3, DVec3};
use palpate_model::pattern::BlockRows;
use rayon::prelude::*;

/// Values of a [`BlockRows`]; row-major blocks: entry (r, c) of a block is the effect of component c on component r.
#[derive(Debug, Default)]
pub struct Matrix {
    /// One 3 × 3 block per place.
    pub values: Vec<DMat3>,
}

impl Matrix {
    /// y = A x.
    pub fn multiply(&self, rows: &BlockRows, x: &[DVec3], y: &mut [DVec3]) {
        let row = |a: usize| -> DVec3 {
            let mut sum = DVec3::ZERO;
            let range = rows.rows[a]..rows.rows[a + 1];
            for (block, &b) in self.values[range.clone()].iter().zip(&rows.columns[range]) {
                sum += *block * x[b as usize];
            }
            sum
        };
        if y.len() < 1500 {
            y.iter_mut().enumerate().for_each(|(a, y)| *y = row(a));
        } else {
            y.par_iter_mut().with_min_len(512).enumerate().for_each(|(a, y)| *y = row(a));
        }
    }

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
