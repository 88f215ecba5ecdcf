//! Generalised minimal residuals (Saad & Schultz 1986) for operators that are not symmetric, without restarts.

use super::vector::{add_scaled, dot};
use glam::DVec3;

/// Solves A x = b from zero to this part of |b|; `None` where so many products did not do it. The basis is kept whole: what is asked here takes
/// some ten products, because A is close to the identity.
pub fn solve(apply: impl Fn(&[DVec3]) -> Vec<DVec3>, b: &[DVec3], relative: f64, most: usize) -> Option<Vec<DVec3>> {
    let size = dot(b, b).sqrt();
    if size == 0.0 {
        return Some(vec![DVec3::ZERO; b.len()]);
    }
    let mut basis: Vec<Vec<DVec3>> = vec![b.iter().map(|v| *v / size).collect()];
    // Columns of the Hessenberg matrix, already turned by the rotations before, and the right-hand side turned alike.
    let (mut columns, mut turns, mut right): (Vec<Vec<f64>>, Vec<[f64; 2]>, Vec<f64>) = (Vec::new(), Vec::new(), vec![size]);
    for k in 0..most {
        let mut w = apply(&basis[k]);
        let whole = dot(&w, &w).sqrt();
        let mut column = vec![0.0; k + 2];
        // Twice, so that rounding leaves the basis orthogonal.
        for _ in 0..2 {
            for (i, v) in basis.iter().enumerate() {
                let part = dot(v, &w);
                column[i] += part;
                add_scaled(&mut w, -part, v);
            }
        }
        let left = dot(&w, &w).sqrt();
        column[k + 1] = left;
        for (i, [c, s]) in turns.iter().enumerate() {
            let [a, b] = [column[i], column[i + 1]];
            [column[i], column[i + 1]] = [c * a + s * b, c * b - s * a];
        }
        let length = column[k].hypot(column[k + 1]);
        if length.is_nan() || length == 0.0 {
            return None;
        }
        let [c, s] = [column[k] / length, column[k + 1] / length];
        (column[k], column[k + 1]) = (length, 0.0);
        turns.push([c, s]);
        let before = right[k];
        right[k] = c * before;
        right.push(-s * before);
        columns.push(column);
        if right[k + 1].abs() <= relative * size {
            return Some(combined(&basis, &columns, &right));
        }
        // The space is closed, and the solution not in it.
        if left <= 1e-14 * whole {
            return None;
        }
        basis.push(w.into_iter().map(|v| v / left).collect());
    }
    None
}

/// Σ y_i v_i with the y that solves the triangular system.
fn combined(basis: &[Vec<DVec3>], columns: &[Vec<f64>], right: &[f64]) -> Vec<DVec3> {
    let n = columns.len();
    let mut y = right[..n].to_vec();
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| columns[j][i] * y[j]).sum();
        y[i] = (y[i] - known) / columns[i][i];
    }
    let mut x = vec![DVec3::ZERO; basis[0].len()];
    y.iter().zip(basis).for_each(|(y, v)| add_scaled(&mut x, *y, v));
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_is_not_symmetric_is_inverted_and_a_singular_one_is_said_to_be() {
        let a = |v: &[DVec3]| -> Vec<DVec3> {
            (0..v.len()).map(|i| v[i] + 0.3 * DVec3::new(v[i].y, -v[i].z, v[(i + 1) % v.len()].x)).collect()
        };
        let x: Vec<DVec3> = (0..40).map(|i| DVec3::new(i as f64, (i * i % 7) as f64, -1.0)).collect();
        let found = solve(a, &a(&x), 1e-12, 100).unwrap();
        assert!(found.iter().zip(&x).all(|(f, x)| (*f - *x).length() < 1e-9));
        assert!(solve(|v| v.iter().map(|v| DVec3::X * v.x).collect(), &x, 1e-6, 100).is_none());
        assert!(solve(a, &a(&x), 1e-12, 3).is_none());
    }
}
