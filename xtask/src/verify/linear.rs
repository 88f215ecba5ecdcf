//! Sparse systems of a body's statics, for studies that solve them themselves.

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use glam::{DMat3, DVec3};

/// A factor of K + diag(springs) for blocks of K (row node, column node) and a spring on every node [N/m].
///
/// # Errors
/// The matrix is not positive definite.
pub fn factorise(blocks: &[(usize, usize, DMat3)], springs: &[f64]) -> Result<Llt<usize, f64>, String> {
    let n = springs.len();
    let mut entries = Vec::with_capacity(6 * blocks.len());
    for (i, j, b) in blocks {
        for (r, c) in (0..9).map(|k| (k / 3, k % 3)).filter(|(r, c)| 3 * i + r >= 3 * j + c) {
            entries.push(Triplet::new(3 * i + r, 3 * j + c, b.col(c)[r]));
        }
    }
    entries.extend((0..3 * n).map(|k| Triplet::new(k, k, springs[k / 3])));
    let matrix = SparseColMat::try_new_from_triplets(3 * n, 3 * n, &entries).map_err(|e| format!("{e:?}"))?;
    matrix.sp_cholesky(Side::Lower).map_err(|e| format!("the stiffness is not positive definite: {e:?}"))
}

/// The solution for a load on every node.
pub fn solve(factor: &Llt<usize, f64>, load: &[DVec3]) -> Vec<DVec3> {
    let mut x = Mat::from_fn(3 * load.len(), 1, |i, _| load[i / 3][i % 3]);
    factor.solve_in_place(&mut x);
    (0..load.len()).map(|i| DVec3::new(x[(3 * i, 0)], x[(3 * i + 1, 0)], x[(3 * i + 2, 0)])).collect()
}
