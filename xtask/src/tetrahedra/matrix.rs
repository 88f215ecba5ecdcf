//! Sparse symmetric matrices of the free nodes and their Cholesky factors (by faer; the order of unknowns is found once).

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::factorize_symbolic_cholesky;
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Mat, Par, Side};
use glam::{DMat3, DVec3};
use std::collections::BTreeSet;

/// Where entries stand, and in which order unknowns are eliminated.
pub struct Pattern {
    /// Place of a node among the free ones.
    free: Vec<Option<usize>>,
    count: usize,
    /// Free neighbours of every free node that do not come before it, itself first.
    neighbours: Vec<Vec<usize>>,
    /// Starts of the columns of the lower triangle.
    starts: Vec<usize>,
    structure: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
}

impl Pattern {
    /// The pattern of elements with these nodes, of which some are held.
    ///
    /// # Errors
    /// The pattern cannot be factorised.
    pub fn new(elements: &[[usize; 10]], held: &[bool]) -> Result<Pattern, String> {
        let mut count = 0;
        let free: Vec<Option<usize>> = held
            .iter()
            .map(|h| {
                count += usize::from(!h);
                (!h).then(|| count - 1)
            })
            .collect();
        let mut sets: Vec<BTreeSet<usize>> = (0..count).map(|a| BTreeSet::from([a])).collect();
        for e in elements {
            let own: Vec<usize> = e.iter().filter_map(|n| free[*n]).collect();
            own.iter().for_each(|a| sets[*a].extend(own.iter().filter(|b| *b > a)));
        }
        let neighbours: Vec<Vec<usize>> = sets.into_iter().map(|s| s.into_iter().collect()).collect();
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for (a, list) in neighbours.iter().enumerate() {
            for c in 0..3 {
                rows.extend(list.iter().flat_map(|b| (0..3).map(move |r| 3 * b + r)).filter(|row| *row >= 3 * a + c));
                starts.push(rows.len());
            }
        }
        let structure = SymbolicSparseColMat::new_checked(3 * count, 3 * count, starts.clone(), None, rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(structure.as_ref(), Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|e| format!("{e:?}"))?;
        Ok(Pattern { free, count, neighbours, starts, structure, symbolic })
    }

    /// A matrix of zeros.
    pub fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.starts.last().copied().unwrap_or(0)]
    }

    /// Adds the block of row node `i` and column node `j`; of a pair of nodes only one of both blocks is added.
    pub fn add(&self, values: &mut [f64], i: usize, j: usize, block: DMat3) {
        let (Some(i), Some(j)) = (self.free[i], self.free[j]) else { return };
        let (row, column, block) = if i >= j { (i, j, block) } else { (j, i, block.transpose()) };
        let Ok(rank) = self.neighbours[column].binary_search(&row) else { return };
        for c in 0..3 {
            for r in if rank == 0 { c } else { 0 }..3 {
                values[self.starts[3 * column + c] + 3 * rank + r - c] += block.col(c)[r];
            }
        }
    }

    /// Cholesky's factor of A; `None` where it is not positive definite.
    pub fn factor(&self, values: Vec<f64>) -> Option<Vec<f64>> {
        let a = SparseColMat::new(self.structure.clone(), values);
        let mut factor = vec![0.0; self.symbolic.len_val()];
        let mut memory = MemBuffer::new(self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
        let stack = MemStack::new(&mut memory);
        self.symbolic
            .factorize_numeric_llt(&mut factor, a.as_ref(), Side::Lower, Default::default(), Par::Seq, stack, Default::default())
            .ok()?;
        Some(factor)
    }

    /// Solves A x = b at the free nodes by A's factor; held ones get zero.
    pub fn solve(&self, factor: &[f64], b: &[DVec3]) -> Vec<DVec3> {
        let mut x = Mat::zeros(3 * self.count, 1);
        for (n, b) in self.free.iter().zip(b).filter_map(|(n, b)| Some((n.as_ref()?, b))) {
            (0..3).for_each(|d| x[(3 * n + d, 0)] = b[d]);
        }
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        LltRef::new(&self.symbolic, factor).solve_in_place_with_conj(Conj::No, x.as_mut(), Par::Seq, MemStack::new(&mut memory));
        let at = |n: &Option<usize>| n.map_or(DVec3::ZERO, |n| DVec3::from([0, 1, 2].map(|d| x[(3 * n + d, 0)])));
        self.free.iter().map(at).collect()
    }
}
