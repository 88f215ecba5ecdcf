//! The stretch of a deformation as six numbers, with derivatives: what laws of the strain see of one F.

use super::Gradient;
use super::corotated_linear::stretch;
use num_dual::HyperDual64;

/// Rows and columns of the strain components xx, yy, zz, yz, zx, xy.
pub const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]];

/// A strain that knows no rotation: the components of S − I with F = R S, and their derivatives by F, row by row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stretch {
    /// xx, yy, zz, yz, zx, xy.
    pub value: [f64; 6],
    /// Of each component by F.
    pub slopes: [[f64; 9]; 6],
}

/// Components with derivatives along entries i and j of F, and along both.
fn lifted(h: &Gradient<f64>, i: usize, j: usize) -> [HyperDual64; 6] {
    let mut all: Gradient<HyperDual64> = h.map(|row| row.map(HyperDual64::from));
    all[i / 3][i % 3].eps1 = 1.0;
    all[j / 3][j % 3].eps2 = 1.0;
    let s = stretch(&all);
    PAIRS.map(|[a, b]| s[a][b])
}

impl Stretch {
    /// At a displacement gradient.
    pub fn new(h: &Gradient<f64>) -> Stretch {
        let mut out = Stretch::default();
        for i in (0..9).step_by(2) {
            let j = (i + 1).min(8);
            for (c, s) in lifted(h, i, j).into_iter().enumerate() {
                out.value[c] = s.re;
                out.slopes[c][i] = s.eps1;
                out.slopes[c][j] = s.eps2;
            }
        }
        out
    }

    /// Σ g_c ∂²ε_c/∂F∂F, symmetric, at a displacement gradient.
    pub fn bend(h: &Gradient<f64>, g: &[f64; 6]) -> [[f64; 9]; 9] {
        let mut out = [[0.0; 9]; 9];
        for i in 0..9 {
            for j in 0..=i {
                let second = lifted(h, i, j).iter().zip(g).map(|(s, g)| g * s.eps1eps2).sum();
                out[i][j] = second;
                out[j][i] = second;
            }
        }
        out
    }

    /// Change of the components along a change of F.
    pub fn along(&self, df: &[f64; 9]) -> [f64; 6] {
        self.slopes.map(|row| row.iter().zip(df).map(|(s, d)| s * d).sum())
    }

    /// Its transpose: Σ g_c ∂ε_c/∂F.
    pub fn back(&self, g: &[f64; 6]) -> [f64; 9] {
        std::array::from_fn(|k| (0..6).map(|c| g[c] * self.slopes[c][k]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_stretch_and_rotations_have_none() {
        let h = [[0.1, 0.3, -0.2], [-0.25, -0.05, 0.1], [0.15, 0.05, 0.2]];
        let g = [0.3, -0.7, 0.2, 1.1, -0.4, 0.6];
        let (at, bend) = (Stretch::new(&h), Stretch::bend(&h, &g));
        for k in 0..9 {
            let d = 1e-5;
            let moved = |by: f64| {
                let mut h = h;
                h[k / 3][k % 3] += by;
                Stretch::new(&h)
            };
            let [a, b] = [moved(d), moved(-d)];
            for c in 0..6 {
                assert!(((a.value[c] - b.value[c]) / (2.0 * d) - at.slopes[c][k]).abs() < 1e-9);
            }
            let mut entry = [0.0; 9];
            entry[k] = 2.0;
            assert_eq!(at.along(&entry), at.slopes.map(|row| 2.0 * row[k]));
            let (a, b) = (a.back(&g), b.back(&g));
            assert!((0..9).all(|l| ((a[l] - b[l]) / (2.0 * d) - bend[k][l]).abs() < 1e-8));
        }
        // F times a rotation from the left has the same stretch; at rest it is the symmetric gradient.
        let (s, c) = 0.7f64.sin_cos();
        let turn = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
        let f = |i: usize, j: usize| h[i][j] + f64::from(u8::from(i == j));
        let turned = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..3).map(|k| turn[i][k] * f(k, j)).sum::<f64>() - f64::from(u8::from(i == j)))
        });
        assert!(Stretch::new(&turned).value.iter().zip(at.value).all(|(a, b)| (a - b).abs() < 1e-14));
        let small = Stretch::new(&h.map(|row| row.map(|x| 1e-7 * x)));
        assert!(PAIRS.iter().zip(small.value).all(|([a, b], s)| (s / 0.5e-7 - h[*a][*b] - h[*b][*a]).abs() < 1e-6));
    }
}
