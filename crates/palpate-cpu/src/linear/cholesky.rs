//! Direct solver: faer's sparse Cholesky factorisation over a pattern that is analysed once.

use super::matrix::Matrix;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Mat, Side, linalg::solvers::Solve};
use glam::DVec3;
use palpate_model::pattern::BlockRows;

/// Fill-reducing order and structure of the factor, shared by all members and steps.
#[derive(Debug)]
pub struct Analysis {
    structure: SymbolicSparseColMat<usize>,
    symbolic: SymbolicLlt<usize>,
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
        let symbolic = SymbolicLlt::try_new(structure.as_ref(), Side::Lower).map_err(|e| format!("{e:?}"))?;
        Ok(Analysis { structure, symbolic, entries })
    }

    /// Factorises; the error names the first pivot that is not positive.
    pub fn factor(&self, matrix: &Matrix) -> Result<Factor, String> {
        let values = self
            .entries
            .iter()
            .map(|&(k, place)| matrix.values[k as usize].col((place / 3) as usize)[(place % 3) as usize])
            .collect();
        let a = SparseColMat::new(self.structure.clone(), values);
        let llt = Llt::try_new_with_symbolic(self.symbolic.clone(), a.as_ref(), Side::Lower).map_err(|e| format!("{e:?}"))?;
        Ok(Factor { llt })
    }
}

/// A factorised matrix.
#[derive(Debug)]
pub struct Factor {
    llt: Llt<usize, f64>,
}

impl Factor {
    /// Solves A x = b for several right-hand sides in place.
    pub fn solve(&self, columns: &mut [&mut [DVec3]]) {
        if columns.is_empty() {
            return;
        }
        let n = columns[0].len();
        let mut rhs = Mat::from_fn(3 * n, columns.len(), |i, j| columns[j][i / 3][i % 3]);
        self.llt.solve_in_place(rhs.as_mut());
        for (j, column) in columns.iter_mut().enumerate() {
            for (i, v) in column.iter_mut().enumerate() {
                *v = DVec3::new(rhs[(3 * i, j)], rhs[(3 * i + 1, j)], rhs[(3 * i + 2, j)]);
            }
        }
    }
}
