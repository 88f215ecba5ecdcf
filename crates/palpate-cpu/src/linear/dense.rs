//! Small dense matrices.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par, Side};
use std::hint::black_box;

/// Rows and columns of a product that is packed.
const PACKED: usize = 256;

/// Takes the memory that this thread keeps for good from its first large product of matrices on.
pub fn settle() {
    let a = Mat::<f64>::identity(PACKED, PACKED);
    let mut product = Mat::<f64>::zeros(PACKED, PACKED);
    matmul(product.as_mut(), Accum::Replace, a.as_ref(), a.as_ref(), 1.0, Par::Seq);
    black_box(product);
}

/// Removes the negative eigenvalues of a small symmetric matrix.
#[cold]
pub fn without_negative_eigenvalues<const N: usize>(m: &mut [[f64; N]; N]) {
    let a = Mat::from_fn(N, N, |i, j| m[i][j]);
    // An eigenvalue problem that does not converge holds NaN; then the residual says so.
    let Ok(eigen) = a.self_adjoint_eigen(Side::Lower) else { return };
    for k in (0..N).filter(|k| eigen.S()[*k] < 0.0) {
        let v = eigen.U().col(k);
        for i in 0..N {
            for j in 0..N {
                m[i][j] -= eigen.S()[k] * v[i] * v[j];
            }
        }
    }
}
