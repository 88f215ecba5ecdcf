//! Small dense matrices.

use faer::{Mat, Side};

/// Removes the negative eigenvalues of a symmetric 9 × 9 matrix.
#[cold]
pub fn without_negative_eigenvalues(m: &mut [[f64; 9]; 9]) {
    let a = Mat::from_fn(9, 9, |i, j| m[i][j]);
    // An eigenvalue problem that does not converge holds NaN; then the residual says so.
    let Ok(eigen) = a.self_adjoint_eigen(Side::Lower) else { return };
    for k in (0..9).filter(|k| eigen.S()[*k] < 0.0) {
        let v = eigen.U().col(k);
        for i in 0..9 {
            for j in 0..9 {
                m[i][j] -= eigen.S()[k] * v[i] * v[j];
            }
        }
    }
}
