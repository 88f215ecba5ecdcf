//! Weights that pass the patch test: the smallest change of the stars' G, in the 2-norm, under
//! Σ_j G_ij = 0 and Σ_j X_j G_ijᵀ = I for each star, and Σ_i V_i G_ij = t_j for each point, its share of the outward area.
//!
//! Least-squares weights alone leave Σ_i V_i G_ij ≠ 0 within the body, so that a constant stress is not in equilibrium: irregular bars keep half of
//! their modulus. Stars' own conditions are projected out star by star; what is left is one sparse system of a number per point, the same for the three
//! axes. Affine multipliers do nothing, so that it is singular, and solvable because the surface is closed.

use super::graph::Star;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par, Side};
use glam::DVec3;

/// What is added to the diagonal, over its mean: keeps the singular matrix factorisable.
const SHIFT: f64 = 1e-10;
/// Rounds of refinement, which take away what the shift does to the solution.
const ROUNDS: usize = 4;

/// The conditions of a star by itself, orthonormal: rows of the span of 1 and of the coordinates over its nodes.
fn own(star: &Star, points: &[DVec3], spacing: f64) -> Vec<Vec<f64>> {
    let x = points[star.nodes[0] as usize];
    let arms: Vec<DVec3> = star.nodes.iter().map(|n| (points[*n as usize] - x) / spacing).collect();
    let mut rows: Vec<Vec<f64>> = vec![vec![1.0; arms.len()]];
    rows.extend((0..3).map(|a| arms.iter().map(|d| d[a]).collect()));
    for k in 0..rows.len() {
        // Twice is enough (Kahan and Parlett): rows stay orthogonal to rounding.
        for _ in 0..2 {
            let (before, rest) = rows.split_at_mut(k);
            for b in before.iter() {
                let along: f64 = b.iter().zip(&rest[0]).map(|(b, r)| b * r).sum();
                rest[0].iter_mut().zip(b).for_each(|(r, b)| *r -= along * b);
            }
        }
        let length = rows[k].iter().map(|r| r * r).sum::<f64>().sqrt();
        rows[k].iter_mut().for_each(|r| *r /= length);
    }
    rows
}

/// Takes the part along a star's own conditions off a vector per node.
fn project(rows: &[Vec<f64>], v: &mut [DVec3]) {
    for row in rows {
        let along: DVec3 = row.iter().zip(v.iter()).map(|(r, v)| *r * *v).sum();
        row.iter().zip(v.iter_mut()).for_each(|(r, v)| *v -= *r * along);
    }
}

/// Changes the stars' G so that they are compatible with the points' volumes [m³] and shares of the outward area [m²].
///
/// # Errors
/// The system cannot be factorised.
pub fn make_compatible(stars: &mut [Star], points: &[DVec3], volume: &[f64], area: &[DVec3], spacing: f64) -> Result<(), String> {
    let n = points.len();
    let mean = volume.iter().sum::<f64>() / n as f64;
    let rows: Vec<Vec<Vec<f64>>> = stars.iter().map(|s| own(s, points, spacing)).collect();
    let mut entries = Vec::new();
    let mut trace = 0.0;
    for ((star, rows), v) in stars.iter().zip(&rows).zip(volume) {
        let square = (v / mean).powi(2);
        for (a, i) in star.nodes.iter().enumerate() {
            for (b, j) in star.nodes.iter().enumerate().filter(|(_, j)| *j <= i) {
                let kept = f64::from(u8::from(a == b)) - rows.iter().map(|r| r[a] * r[b]).sum::<f64>();
                entries.push(Triplet::new(*i as usize, *j as usize, square * kept));
                trace += if a == b { square * kept } else { 0.0 };
            }
        }
    }
    entries.extend((0..n).map(|i| Triplet::new(i, i, SHIFT * trace / n as f64)));
    let fault = |e: &dyn std::fmt::Debug| {
        format!("compatible weights of the points cannot be found ({e:?}); try weights = \"published\"")
    };
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries).map_err(|e| fault(&e))?;
    let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, SymmetricOrdering::Amd, Default::default())
        .map_err(|e| fault(&e))?;
    let mut factor = vec![0.0; symbolic.len_val()];
    // One thread: the same bits on any number of them.
    let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
    symbolic
        .factorize_numeric_llt(
            &mut factor,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|e| fault(&e))?;
    let factor = LltRef::new(&symbolic, &factor);
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(3, Par::Seq));
    for _ in 0..ROUNDS {
        let missing = missing(stars, volume, area);
        let mut solution = Mat::from_fn(n, 3, |i, a| missing[i][a] / mean);
        factor.solve_in_place_with_conj(Conj::No, solution.as_mut(), Par::Seq, MemStack::new(&mut memory));
        for ((star, rows), v) in stars.iter_mut().zip(&rows).zip(volume) {
            let at = |i: &u32| DVec3::from_array([0, 1, 2].map(|a| solution[(*i as usize, a)])) * (v / mean);
            let mut change: Vec<DVec3> = star.nodes.iter().map(at).collect();
            project(rows, &mut change);
            star.gradient.iter_mut().zip(change).for_each(|(g, d)| *g += d);
        }
    }
    Ok(())
}

/// t_j − Σ_i V_i G_ij of every point [m²].
pub fn missing(stars: &[Star], volume: &[f64], area: &[DVec3]) -> Vec<DVec3> {
    let mut out = area.to_vec();
    for (star, v) in stars.iter().zip(volume) {
        star.nodes.iter().zip(&star.gradient).for_each(|(n, g)| out[*n as usize] -= *v * *g);
    }
    out
}
