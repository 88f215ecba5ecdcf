//! Small dense algebra over cells: orthonormal bases and least squares.

use faer::prelude::Solve;
use faer::{Mat, Side};

/// Columns shorter than this share of their length after projection are dependent on the others.
const DEPENDENT: f64 = 1e-7;

/// a · b.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Orthonormal basis of some columns.
#[derive(Clone, Debug, Default)]
pub struct Basis {
    vectors: Vec<Vec<f64>>,
}

impl Basis {
    /// Basis of the columns by Gram–Schmidt, twice for orthogonality to rounding; dependent columns add nothing.
    pub fn new<'a>(columns: impl IntoIterator<Item = &'a Vec<f64>>) -> Basis {
        let mut basis = Basis::default();
        columns.into_iter().for_each(|c| basis.add(c));
        basis
    }

    /// Adds a column.
    pub fn add(&mut self, column: &[f64]) {
        let before = dot(column, column).sqrt();
        let v = self.without(&self.without(column));
        let after = dot(&v, &v).sqrt();
        if after.is_finite() && after > DEPENDENT * before && after > 0.0 {
            self.vectors.push(v.iter().map(|x| x / after).collect());
        }
    }

    /// What of a vector lies outside the basis.
    pub fn without(&self, v: &[f64]) -> Vec<f64> {
        let mut out = v.to_vec();
        for q in &self.vectors {
            let s = dot(q, &out);
            out.iter_mut().zip(q).for_each(|(o, q)| *o -= s * q);
        }
        out
    }

    /// Number of independent columns.
    pub fn rank(&self) -> usize {
        self.vectors.len()
    }

    /// Share of each entry's variance that the basis takes away, 0 to 1.
    pub fn leverage(&self, i: usize) -> f64 {
        self.vectors.iter().map(|q| q[i] * q[i]).sum()
    }
}

/// x that makes |y + Σ x_q a_q|² + |x|² `ridge` smallest, columns brought to unit length first; `None` if that is not finite.
pub fn least_squares(columns: &[&[f64]], y: &[f64], ridge: f64) -> Option<Vec<f64>> {
    let size: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    least_squares_in(columns, y, ridge, &size)
}

/// As [`least_squares`] with x_q counted in units of 1 / `size[q]`: columns of one kind that share a size are held back alike, however
/// little one of them says.
pub fn least_squares_in(columns: &[&[f64]], y: &[f64], ridge: f64, size: &[f64]) -> Option<Vec<f64>> {
    let q = columns.len();
    let unit = |i: usize| if size[i] > 0.0 { 1.0 / size[i] } else { 0.0 };
    let normal =
        Mat::from_fn(q, q, |i, j| dot(columns[i], columns[j]) * unit(i) * unit(j) + if i == j { ridge.max(1e-12) } else { 0.0 });
    let right = Mat::from_fn(q, 1, |i, _| -dot(columns[i], y) * unit(i));
    let x = normal.llt(Side::Lower).ok()?.solve(&right);
    let x: Vec<f64> = (0..q).map(|i| x[(i, 0)] * unit(i)).collect();
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// The value below which a share of the numbers lies; NaN without any.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    if values.is_empty() {
        return f64::NAN;
    }
    values[((values.len() - 1) as f64 * share).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_and_least_squares_agree() {
        let a = vec![1.0, 2.0, 3.0, -1.0];
        let b = vec![0.5, -1.0, 2.0, 4.0];
        // Depends on the others.
        let c: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect();
        let y = [1.0, -1.0, 0.3, 2.0];
        let basis = Basis::new([&a, &b, &c]);
        assert_eq!(basis.rank(), 2);
        let x = least_squares(&[&a, &b], &y, 0.0).unwrap();
        let left: Vec<f64> = (0..4).map(|i| y[i] + x[0] * a[i] + x[1] * b[i]).collect();
        for (p, l) in basis.without(&y).iter().zip(&left) {
            // The ridge of 1e-12 that keeps the matrix regular.
            assert!((p - l).abs() < 1e-10, "{p} {l}");
        }
        assert!((0..4).map(|i| basis.leverage(i)).sum::<f64>() - 2.0 < 1e-12);
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 0.5), 2.0);
    }
}
