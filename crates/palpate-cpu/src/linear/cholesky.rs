//! Direct solver: faer's sparse Cholesky factorisation over a pattern that is analysed once.

use super::matrix::Matrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::factorize_symbolic_cholesky;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::traits::ComplexField;
use faer::{Conj, Mat, Par, Side};
use glam::DVec3;
use palpate_model::space::pattern::BlockRows;
use std::sync::Arc;

/// Fill-reducing order and structure of the factor, shared by all members and steps.
#[derive(Debug)]
pub struct Analysis {
    structure: SymbolicSparseColMat<usize>,
    symbolic: Arc<SymbolicCholesky<usize>>,
    // For every entry of the lower triangle: block and place inside it (3·column + row).
    entries: Vec<(u32, u8)>,
}

impl Analysis {
    /// Orders the unknowns and finds the factor's pattern.
    pub fn new(rows: &BlockRows) -> Result<Analysis, String> {
        let n = rows.len();
        let mut starts = vec![0];
        let lower = (9 * rows.columns.len() + 3 * n) / 2;
        let mut indices = Vec::with_capacity(lower);
        let mut entries = Vec::with_capacity(lower);
        for a in 0..n {
            // The pattern is symmetric: column a of the lower triangle is row a from the diagonal on. Block (b, a) is the
            // transpose of block (a, b), so entry (row r, column c) of it is entry (c, r) of the stored block.
            for c in 0..3 {
                for k in rows.rows[a]..rows.rows[a + 1] {
                    let b = rows.columns[k] as usize;
                    for r in 0..3 {
                        if 3 * b + r >= 3 * a + c {
                            indices.push(3 * b + r);
                            entries.push((k as u32, (3 * r + c) as u8));
                        }
                    }
                }
                starts.push(indices.len());
            }
        }
        let structure = SymbolicSparseColMat::new_checked(3 * n, 3 * n, starts, None, indices);
        // Three unknowns a node make dense blocks: supernodes factorise them 3.5 times as fast already at 500 unknowns, where
        // faer would still choose single columns (0.28 against 0.99 ms).
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(structure.as_ref(), Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|e| format!("{e:?}"))?;
        Ok(Analysis { structure, symbolic: Arc::new(symbolic), entries })
    }

    /// Entries of the factor.
    pub fn entries(&self) -> usize {
        self.symbolic.len_val()
    }

    /// Memory of the structure [B].
    pub fn bytes(&self) -> usize {
        self.entries.len() * (size_of::<usize>() + size_of::<(u32, u8)>())
    }

    /// Memory of a factor [B].
    pub fn factor_bytes(&self) -> usize {
        self.entries() * size_of::<f64>()
    }

    /// Memory that a factorisation takes beside its factor [B]: the matrix in the order of its columns, and what is at work.
    pub fn work_bytes(&self) -> usize {
        let scratch = self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        self.entries.len() * (size_of::<usize>() + size_of::<f64>()) + scratch.unaligned_bytes_required()
    }

    /// Factorises; the error names the first pivot that is not positive.
    pub fn factor(&self, matrix: &Matrix) -> Result<Factor, String> {
        let values = self
            .entries
            .iter()
            .map(|&(k, place)| matrix.values[k as usize].col((place / 3) as usize)[(place % 3) as usize])
            .collect();
        let a = SparseColMat::new(self.structure.clone(), values);
        let symbolic = self.symbolic.clone();
        let mut values = vec![0.0; symbolic.len_val()];
        // One thread: what is batched above keeps all of them busy, and the same bits come out on any number of them.
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
        let (stack, regularization) = (MemStack::new(&mut memory), Default::default());
        symbolic
            .factorize_numeric_llt(&mut values, a.as_ref(), Side::Lower, regularization, Par::Seq, stack, Default::default())
            .map_err(|e| format!("{e:?}"))?;
        Ok(Factor { symbolic, values })
    }
}

/// A factorised matrix.
#[derive(Clone, Debug)]
pub struct Factor {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<f64>,
}

impl Factor {
    /// L⁻ᵀ z for A = L Lᵀ up to the order of the unknowns: of a standard normal z a draw with the covariance A⁻¹.
    pub fn solve_half(&self, z: &[DVec3]) -> Vec<DVec3> {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() else {
            unreachable!("the analysis asks for supernodes");
        };
        let n = z.len();
        let mut rhs = Mat::from_fn(3 * n, 1, |i, _| z[i / 3][i % 3]);
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let factor = SupernodalLltRef::<'_, usize, f64>::new(symbolic, &self.values);
        factor.l_transpose_solve_with_conj(Conj::No, rhs.as_mut(), Par::Seq, MemStack::new(&mut memory));
        let mut out = vec![DVec3::ZERO; n];
        match self.symbolic.perm() {
            // Unknown k of the factor is unknown `forward[k]` of the matrix.
            Some(order) => {
                let (forward, _) = order.arrays();
                forward.iter().enumerate().for_each(|(k, i)| out[i / 3][i % 3] = rhs[(k, 0)]);
            }
            None => (0..3 * n).for_each(|i| out[i / 3][i % 3] = rhs[(i, 0)]),
        }
        out
    }

    /// The factor in single precision.
    pub fn rough(&self) -> RoughFactor {
        RoughFactor { symbolic: self.symbolic.clone(), values: self.values.iter().map(|v| *v as f32).collect() }
    }

    /// Solves A x = b for several right-hand sides in place.
    pub fn solve(&self, columns: &mut [&mut [DVec3]]) {
        solve_in_place(&self.symbolic, &self.values, columns, |v| v, |v| v);
    }
}

/// A factor to 6e-8, for preconditioners: half of the memory that each solve reads, twice as many numbers in a register.
#[derive(Clone, Debug)]
pub struct RoughFactor {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<f32>,
}

impl RoughFactor {
    /// Memory of its numbers [B].
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// Solves A x = b for several right-hand sides in place.
    pub fn solve(&self, columns: &mut [&mut [DVec3]]) {
        solve_in_place(&self.symbolic, &self.values, columns, |v| v as f32, f64::from);
    }
}

/// Solves for several right-hand sides in the factor's own numbers.
fn solve_in_place<T: ComplexField>(
    symbolic: &SymbolicCholesky<usize>,
    values: &[T],
    columns: &mut [&mut [DVec3]],
    number: impl Fn(f64) -> T,
    back: impl Fn(T) -> f64,
) {
    if columns.is_empty() {
        return;
    }
    let n = columns[0].len();
    let mut rhs = Mat::from_fn(3 * n, columns.len(), |i, j| number(columns[j][i / 3][i % 3]));
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<T>(columns.len(), Par::Seq));
    LltRef::new(symbolic, values).solve_in_place_with_conj(Conj::No, rhs.as_mut(), Par::Seq, MemStack::new(&mut memory));
    for (j, column) in columns.iter_mut().enumerate() {
        for (i, v) in column.iter_mut().enumerate() {
            *v = DVec3::from_array([0, 1, 2].map(|c| back(rhs[(3 * i + c, j)].clone())));
        }
    }
}
