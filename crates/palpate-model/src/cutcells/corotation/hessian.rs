//! A cell's 24 × 24 Hessian: its stiffness matrix and the symmetric update of rank six, turned into the world frame.

use super::{CellPose, M24, V24, centred, dot};
use glam::{DMat3, DVec3};

impl CellPose {
    /// World-frame, exactly symmetric matrix scale · PᵀKP + D²q\[y\]; not definite in general.
    ///
    /// With y = scale · K q this is the second derivative of [`CellPose::energy`].
    pub fn hessian(&self, k: &M24, scale: f64, y: &V24, out: &mut M24) {
        self.upper_hessian(k, scale, Some(y), out);
        mirror(out);
    }

    /// World-frame, exactly symmetric and positive semi-definite part scale · PᵀKP.
    pub fn gauss_newton(&self, k: &M24, scale: f64, out: &mut M24) {
        self.upper_hessian(k, scale, None, out);
        mirror(out);
    }

    /// The 3 × 3 blocks (i, j ≥ i) of [`CellPose::hessian`], or without `y` of [`CellPose::gauss_newton`]; overwrites those alone.
    #[inline(always)]
    pub fn upper_hessian(&self, k: &M24, scale: f64, y: Option<&V24>, out: &mut M24) {
        // W = scale K + ΩᵀD + DᵀΩ with D = B + ½QΩ − scale (N − ½TΩ), rows of N = ZᵀK; then H = R W Rᵀ.
        let omega = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| self.spin_adjoint_body(e));
        let arms = self.arm_rows();
        let mut d = self.arm_products(k);
        let mut q = DMat3::from_cols_array_2d(&arms.map(|z| d.map(|n| scale * dot(&n, &z))));
        d.iter_mut().flatten().for_each(|n| *n *= -scale);
        if let Some(y) = y {
            let y = centred(*y);
            add_cross_rows(&mut d, &self.force_body(&y));
            q += self.spin_stiffness(&y);
        }
        let q = q.to_cols_array_2d();
        for (d, q) in d.iter_mut().zip(&q) {
            for c in 0..24 {
                d[c] += 0.5 * (q[0] * omega[0][c] + q[1] * omega[1][c] + q[2] * omega[2][c]);
            }
        }
        let r = self.polar.r.to_cols_array_2d();
        let mut half = [[0.0; 24]; 3];
        for (i, rows) in k.as_chunks::<72>().0.iter().enumerate() {
            // In pieces of four columns, one vector register each, from the diagonal block on.
            let first = 3 * i / 4;
            let mut w = [[0.0; 24]; 3];
            for a in 0..3 {
                let row = 3 * i + a;
                let [o, e] = [[omega[0][row], omega[1][row], omega[2][row]], [d[0][row], d[1][row], d[2][row]]];
                for c in first..6 {
                    for c in 4 * c..4 * c + 4 {
                        w[a][c] = scale * rows[24 * a + c]
                            + (o[0] * d[0][c] + o[1] * d[1][c] + o[2] * d[2][c])
                            + (e[0] * omega[0][c] + e[1] * omega[1][c] + e[2] * omega[2][c]);
                    }
                }
            }
            for a in 0..3 {
                for c in first..6 {
                    for c in 4 * c..4 * c + 4 {
                        half[a][c] = r[0][a] * w[0][c] + r[1][a] * w[1][c] + r[2][a] * w[2][c];
                    }
                }
            }
            for a in 0..3 {
                let out = &mut out[24 * (3 * i + a)..24 * (3 * i + a + 1)];
                for j in i..8 {
                    let h = &half[a][3 * j..3 * j + 3];
                    for b in 0..3 {
                        out[3 * j + b] = h[0] * r[0][b] + h[1] * r[1][b] + h[2] * r[2][b];
                    }
                }
            }
            // Exactly symmetric, not only to rounding.
            for (a, b) in [(1, 0), (2, 0), (2, 1)] {
                out[24 * (3 * i + a) + 3 * i + b] = out[24 * (3 * i + b) + 3 * i + a];
            }
        }
    }

    /// Rows of N = ZᵀK.
    #[inline(always)]
    fn arm_products(&self, k: &M24) -> [V24; 3] {
        let mut n = [[0.0; 24]; 3];
        for (rows, z) in k.as_chunks::<72>().0.iter().zip(self.z.as_chunks::<3>().0) {
            for c in 0..24 {
                n[0][c] += z[1] * rows[48 + c] - z[2] * rows[24 + c];
                n[1][c] += z[2] * rows[c] - z[0] * rows[48 + c];
                n[2][c] += z[0] * rows[24 + c] - z[1] * rows[c];
            }
        }
        n
    }

    /// Columns of Z: e_a × z_i.
    #[inline(always)]
    fn arm_rows(&self) -> [V24; 3] {
        let mut out = [[0.0; 24]; 3];
        for i in 0..8 {
            let (x, y, z) = (self.z[3 * i], self.z[3 * i + 1], self.z[3 * i + 2]);
            out[0][3 * i + 1] = -z;
            out[0][3 * i + 2] = y;
            out[1][3 * i] = z;
            out[1][3 * i + 2] = -x;
            out[2][3 * i] = -y;
            out[2][3 * i + 1] = x;
        }
        out
    }
}

/// Adds the blocks [f_i]× to three rows.
#[inline(always)]
fn add_cross_rows(rows: &mut [V24; 3], f: &V24) {
    for i in 0..8 {
        let (a, b, c) = (f[3 * i], f[3 * i + 1], f[3 * i + 2]);
        rows[0][3 * i + 1] -= c;
        rows[0][3 * i + 2] += b;
        rows[1][3 * i] += c;
        rows[1][3 * i + 2] -= a;
        rows[2][3 * i] -= b;
        rows[2][3 * i + 1] += a;
    }
}

/// Fills what is below the diagonal with what is above.
fn mirror(out: &mut M24) {
    for i in 0..24 {
        for j in 0..i {
            out[24 * i + j] = out[24 * j + i];
        }
    }
}
