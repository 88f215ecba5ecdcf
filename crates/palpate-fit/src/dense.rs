//! Small dense symmetric algebra for q free parameters (row-major `[q, q]`).

use faer::{Mat, prelude::Solve};

/// Solves `a x = b`; `None` unless `a` is positive definite and the solution finite.
pub fn solve(a: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let q = b.len();
    let llt = Mat::from_fn(q, q, |i, j| a[i * q + j]).llt(faer::Side::Lower).ok()?;
    let x = llt.solve(&Mat::from_fn(q, 1, |i, _| b[i]));
    let x: Vec<f64> = (0..q).map(|i| x[(i, 0)]).collect();
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// Eigenvalues (ascending) and eigenvectors (one per row); `None` if `a` is not finite.
pub fn eigen(a: &[f64], q: usize) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let eigen = Mat::from_fn(q, q, |i, j| a[i * q + j]).self_adjoint_eigen(faer::Side::Lower).ok()?;
    let values = (0..q).map(|k| eigen.S()[k]).collect();
    let vectors = (0..q).map(|k| (0..q).map(|i| eigen.U()[(i, k)]).collect()).collect();
    Some((values, vectors))
}

/// Scalar product.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Largest absolute entry.
pub fn max_abs(a: &[f64]) -> f64 {
    a.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// The bound that holds an entry of a step.
#[derive(Clone, Copy)]
enum Side {
    Lower,
    Upper,
}

/// Minimises `gᵀp + ½ pᵀHp` over `lower ≤ p ≤ upper` (0 inside) for positive definite `h`: primal active set with simple
/// bounds (Nocedal & Wright, Numerical Optimization, 2nd ed., algorithm 16.3). `None` if `h` is not positive definite.
pub fn box_step(h: &[f64], g: &[f64], lower: &[f64], upper: &[f64]) -> Option<Vec<f64>> {
    let q = g.len();
    let mut p = vec![0.0; q];
    // The side that holds an entry is kept, not read off p: a rounded p may lie beside its bound.
    let mut held: Vec<Option<Side>> = (0..q)
        .map(|i| match g[i] {
            g if g > 0.0 && lower[i] >= 0.0 => Some(Side::Lower),
            g if g < 0.0 && upper[i] <= 0.0 => Some(Side::Upper),
            _ => None,
        })
        .collect();
    // Each pass adds one bound or lowers the model; in exact arithmetic no set of bounds comes twice.
    for _ in 0..10 * q + 10 {
        let free: Vec<usize> = (0..q).filter(|&i| held[i].is_none()).collect();
        let slope = |i: usize, p: &[f64]| g[i] + dot(&h[i * q..(i + 1) * q], p);
        let sub: Vec<f64> = free.iter().flat_map(|&i| free.iter().map(move |&j| h[i * q + j])).collect();
        let rhs: Vec<f64> = free.iter().map(|&i| -slope(i, &p)).collect();
        let d = if free.is_empty() { Vec::new() } else { solve(&sub, &rhs)? };
        let mut length = 1.0;
        let mut blocking = None;
        for (&i, &di) in free.iter().zip(&d) {
            let (side, bound) = if di < 0.0 { (Side::Lower, lower[i]) } else { (Side::Upper, upper[i]) };
            let room = (bound - p[i]) / di;
            if di != 0.0 && room < length {
                length = room.max(0.0);
                blocking = Some((i, side, bound));
            }
        }
        for (&i, &di) in free.iter().zip(&d) {
            p[i] = (p[i] + length * di).clamp(lower[i], upper[i]);
        }
        if let Some((i, side, bound)) = blocking {
            p[i] = bound;
            held[i] = Some(side);
            continue;
        }
        // Release the bound that the model most wants to leave.
        let scale = 1e-12 * max_abs(g);
        let pull = |i: usize| match held[i]? {
            Side::Lower => Some((i, -slope(i, &p))),
            Side::Upper => Some((i, slope(i, &p))),
        };
        match (0..q).filter_map(pull).max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((i, pull)) if pull > scale => held[i] = None,
            _ => return Some(p),
        }
    }
    Some(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_step_meets_the_optimality_conditions() {
        // Coupled, with the free minimiser outside the box in two of three directions.
        let h = [4.0, 1.0, 0.5, 1.0, 3.0, -1.0, 0.5, -1.0, 2.0];
        let g = [-8.0, 2.0, -0.7];
        let (lower, upper) = ([-1.0, -0.5, -2.0], [1.0, 0.5, 2.0]);
        let p = box_step(&h, &g, &lower, &upper).expect("the matrix is positive definite");
        for i in 0..3 {
            let slope = g[i] + dot(&h[3 * i..3 * i + 3], &p);
            if p[i] <= lower[i] {
                assert!(slope >= 0.0);
            } else if p[i] >= upper[i] {
                assert!(slope <= 0.0);
            } else {
                assert!(slope.abs() < 1e-12);
            }
        }
        assert_eq!(p[0], 1.0);
    }

    /// On the way the last entry reaches its lower bound, where a rounded step may end beside it, and has to leave it again. Bounds from 0.1
    /// to 10: some of them round one way, some the other.
    #[test]
    fn an_entry_leaves_a_bound_that_it_reached_on_the_way() {
        let h = [0.32799, 0.0096074, 0.168634, 0.0096074, 0.05184, 0.000418937, 0.168634, 0.000418937, 0.1066726];
        let g = [-0.64144, -0.18931, -0.20338];
        for k in 1..=100 {
            let longest = 0.1 * f64::from(k);
            let (g, bounds) = (g.map(|g| g * longest / 1.5), ([-longest; 3], [longest; 3]));
            let p = box_step(&h, &g, &bounds.0, &bounds.1).expect("positive definite");
            let slope = g[2] + dot(&h[6..], &p);
            assert!(slope.abs() < 1e-12 * longest, "{longest}: {p:?} {slope}");
        }
    }

    #[test]
    fn box_step_without_active_bounds_is_newtons() {
        let h = [4.0, 1.0, 1.0, 3.0];
        let p = box_step(&h, &[1.0, -2.0], &[-9.0; 2], &[9.0; 2]).expect("positive definite");
        let x = solve(&h, &[-1.0, 2.0]).expect("positive definite");
        assert!((p[0] - x[0]).abs() < 1e-14 && (p[1] - x[1]).abs() < 1e-14);
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        assert!(solve(&[1.0, 2.0, 2.0, 1.0], &[1.0, 1.0]).is_none());
    }

    #[test]
    fn eigenvectors_rebuild_the_matrix() {
        let a = [2.0, -1.0, -1.0, 5.0];
        let (values, vectors) = eigen(&a, 2).expect("finite");
        assert!(values[0] <= values[1]);
        for i in 0..2 {
            for j in 0..2 {
                let x: f64 = (0..2).map(|k| values[k] * vectors[k][i] * vectors[k][j]).sum();
                assert!((x - a[2 * i + j]).abs() < 1e-13);
            }
        }
    }
}
