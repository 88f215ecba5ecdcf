//! Small dense matrices.

use faer::{Mat, Side};

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
