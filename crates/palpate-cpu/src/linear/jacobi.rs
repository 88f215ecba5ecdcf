//! Block-Jacobi: the inverse of each node's own 3 × 3 block.

use super::conjugate_gradient::Precondition;
use super::matrix::Matrix;
use super::vector::{Nodes, dot};
use glam::{DMat3, DVec3};
use palpate_model::space::pattern::BlockRows;

/// Inverted diagonal blocks; also the norm in which residuals are measured.
#[derive(Clone, Debug)]
pub struct BlockJacobi {
    inverse: Vec<DMat3>,
}

impl BlockJacobi {
    /// Inverts the diagonal; the error names a node whose block is not positive definite.
    pub fn new(rows: &BlockRows, matrix: &Matrix) -> Result<BlockJacobi, usize> {
        Ok(BlockJacobi { inverse: matrix.diagonal_inverses(rows)? })
    }

    /// `sqrt(rᵀ D⁻¹ r)`: every node counts by what its residual would move it.
    pub fn norm(&self, r: &[DVec3]) -> f64 {
        let scaled: Nodes = r.iter().zip(&self.inverse).map(|(r, d)| *d * *r).collect();
        dot(r, &scaled).max(0.0).sqrt()
    }
}

impl Precondition for &BlockJacobi {
    fn apply(&self, r: &[DVec3], z: &mut [DVec3]) {
        for ((z, r), d) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = *d * *r;
        }
    }
}
