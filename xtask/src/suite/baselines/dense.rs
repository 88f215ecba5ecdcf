//! Small dense algebra: Cholesky's factor of a symmetric matrix and what is solved with it.

/// The lower factor of a positive definite matrix, row by row.
pub struct Factor {
    n: usize,
    l: Vec<f64>,
}

impl Factor {
    /// Factorises the matrix whose entry (i, j) with j ≤ i is `entry(i, j)`; `None` where it is not positive definite.
    pub fn new(n: usize, entry: impl Fn(usize, usize) -> f64) -> Option<Factor> {
        let mut l = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let dot: f64 = l[i * n..i * n + j].iter().zip(&l[j * n..j * n + j]).map(|(a, b)| a * b).sum();
                let rest = entry(i, j) - dot;
                if i == j {
                    if !(rest > 0.0 && rest.is_finite()) {
                        return None;
                    }
                    l[i * n + i] = rest.sqrt();
                } else {
                    l[i * n + j] = rest / l[j * n + j];
                }
            }
        }
        Some(Factor { n, l })
    }

    /// ln of the determinant.
    pub fn log_determinant(&self) -> f64 {
        (0..self.n).map(|i| 2.0 * self.l[i * self.n + i].ln()).sum()
    }

    /// L⁻¹ b.
    pub fn halfway(&self, b: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x = b.to_vec();
        for i in 0..n {
            let dot: f64 = self.l[i * n..i * n + i].iter().zip(&x).map(|(a, b)| a * b).sum();
            x[i] = (x[i] - dot) / self.l[i * n + i];
        }
        x
    }

    /// A⁻¹ b.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x = self.halfway(b);
        for i in (0..n).rev() {
            x[i] /= self.l[i * n + i];
            let (before, at) = x.split_at_mut(i);
            before.iter_mut().zip(&self.l[i * n..i * n + i]).for_each(|(b, l)| *b -= l * at[0]);
        }
        x
    }
}

/// a · b.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_times_what_is_solved_is_the_right_side() {
        let a = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.2], [0.5, -0.2, 2.0]];
        let f = Factor::new(3, |i, j| a[i][j]).unwrap();
        let b = [1.0, -2.0, 0.3];
        let x = f.solve(&b);
        a.iter().zip(b).for_each(|(row, b)| assert!((dot(row, &x) - b).abs() < 1e-12));
        // 4 (6 − 0.04) − 1 (2 + 0.1) + 0.5 (−0.2 − 1.5)
        assert!((f.log_determinant() - 20.89f64.ln()).abs() < 1e-12);
        assert!((dot(&f.halfway(&b), &f.halfway(&b)) - dot(&b, &x)).abs() < 1e-12);
        assert!(Factor::new(2, |i, j| if i == j { 1.0 } else { 2.0 }).is_none());
    }
}
