//! K = δM + G for volumes M and the Laplacian G of weighted links, with its sparse Cholesky factor.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par, Side};
use palpate_model::space::neighbours::Neighbours;
use std::sync::Arc;

/// K, to multiply with and to solve for.
#[derive(Debug)]
pub(super) struct Factor {
    around: Arc<Neighbours>,
    /// δ.
    pub shift: f64,
    /// Weight of every link.
    pub weights: Vec<f64>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Factor {
    /// K of these neighbours; δ and all weights are positive.
    ///
    /// # Errors
    /// K is not positive definite in double precision.
    pub fn new(around: &Arc<Neighbours>, shift: f64, weights: Vec<f64>) -> Result<Factor, String> {
        let n = around.volume.len();
        let mut diagonal: Vec<f64> = around.volume.iter().map(|v| shift * v).collect();
        for (l, w) in around.links.iter().zip(&weights) {
            diagonal[l.a as usize] += w;
            diagonal[l.b as usize] += w;
        }
        // The lower triangle, as b > a.
        let off = around.links.iter().zip(&weights).map(|(l, w)| Triplet::new(l.b as usize, l.a as usize, -w));
        let entries: Vec<_> = diagonal.iter().enumerate().map(|(i, d)| Triplet::new(i, i, *d)).chain(off).collect();
        let failed = |e: String| format!("the matrix of a prior cannot be factorised ({e})");
        let k = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).map_err(|e| failed(format!("{e:?}")))?;
        let params = CholeskySymbolicParams::default();
        let symbolic = factorize_symbolic_cholesky(k.symbolic(), Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|e| failed(format!("{e:?}")))?;
        let mut values = vec![0.0; symbolic.len_val()];
        // One thread: the same bits on any number of them.
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
        let (stack, regularization) = (MemStack::new(&mut memory), Default::default());
        symbolic
            .factorize_numeric_llt(&mut values, k.as_ref(), Side::Lower, regularization, Par::Seq, stack, Default::default())
            .map_err(|e| failed(format!("{e:?}")))?;
        Ok(Factor { around: around.clone(), shift, weights, symbolic, values })
    }

    /// K v `[N]`.
    pub fn times(&self, v: &[f64]) -> Vec<f64> {
        let mut out: Vec<f64> = self.around.volume.iter().zip(v).map(|(m, v)| self.shift * m * v).collect();
        for (l, w) in self.around.links.iter().zip(&self.weights) {
            let flow = w * (v[l.a as usize] - v[l.b as usize]);
            out[l.a as usize] += flow;
            out[l.b as usize] -= flow;
        }
        out
    }

    /// K⁻¹ b for several columns `[N]`.
    pub fn solve(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let n = self.around.volume.len();
        let mut rhs = Mat::from_fn(n, columns.len(), |i, j| columns[j][i]);
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns.len(), Par::Seq));
        let factor = LltRef::new(&self.symbolic, &self.values);
        factor.solve_in_place_with_conj(Conj::No, rhs.as_mut(), Par::Seq, MemStack::new(&mut memory));
        (0..columns.len()).map(|j| (0..n).map(|i| rhs[(i, j)]).collect()).collect()
    }
}
