//! Variational corotation of a cell: rest-frame deformation q of eight corners, and exact first and second derivatives.
//!
//! With corners x_i, centre x_c and R the rotation of F = Σ x_i b_iᵀ, b_i = σ_i / (4h) (the gradient at the cell's
//! centre), q_i = Rᵀ(x_i − x_c) − X_i. Any energy in q is then invariant under rigid motion, and its exact gradient has
//! neither resultant force nor moment. The published method keeps R Kq and drops the derivative of R, which loses a
//! little angular momentum at every step.
//!
//! Notation: a tilde marks body-frame increments dx̃ = Rᵀdx, z_i = Rᵀ(x_i − x_c), S = Σ z_i b_iᵀ, G = tr(S) I − S,
//! dR = R [ω]×. All formulas follow from ω = Ω dx̃ = G⁻¹ Σ b_i × dx̃_i and dq_i = dx̃_i − ω × z_i =: P dx̃:
//! - gradient of y·q: f̃_i = y_i − t × b_i with t = G⁻¹ Σ z_i × y_i;
//! - second derivative of y·q: ΩᵀD + DᵀΩ with D = B + ½ Q Ω, B_i = [f̃_i]×,
//!   Q = sym(M) − tr(M) I + ½ (S[t]× − [t]×S), M = Σ z_i y_iᵀ;
//! - PᵀKP = K − ΩᵀE − EᵀΩ with E = N − ½ T Ω, N = ZᵀK, T = ZᵀKZ, (Zω)_i = ω × z_i.
//!
//! So a cell's Hessian is its stiffness matrix plus a symmetric update of rank six.

mod hessian;
pub mod inversion;

use crate::cutcells::grid::SIGNS;
use crate::mechanics::rotation::{Polar, cross_matrix};
use glam::{DMat3, DVec3};

/// Three components for each of a cell's eight corners, entry 3 · corner + component.
pub type V24 = [f64; 24];

/// A cell's 24 × 24 matrix, row-major; symmetric unless said otherwise.
pub type M24 = [f64; 576];

/// Eight corner vectors as one array.
#[inline(always)]
pub fn flatten(v: &[DVec3; 8]) -> V24 {
    let mut out = [0.0; 24];
    for i in 0..8 {
        out[3 * i..3 * i + 3].copy_from_slice(&v[i].to_array());
    }
    out
}

/// One array as eight corner vectors.
#[inline(always)]
pub fn corners(v: &V24) -> [DVec3; 8] {
    std::array::from_fn(|i| DVec3::new(v[3 * i], v[3 * i + 1], v[3 * i + 2]))
}

/// K v of a symmetric matrix.
#[inline(always)]
pub fn multiply(k: &M24, v: &V24) -> V24 {
    let mut out = [0.0; 24];
    // Column by column (K is symmetric), three at a time: independent sums, so that the compiler may use vector instructions.
    for (rows, s) in k.as_chunks::<72>().0.iter().zip(v.as_chunks::<3>().0) {
        for c in 0..24 {
            out[c] += rows[c] * s[0] + rows[24 + c] * s[1] + rows[48 + c] * s[2];
        }
    }
    out
}

/// Σ a_i × b_i over the corners: the moment of forces `b` at arms `a`.
#[inline(always)]
pub fn cross_sum(a: &V24, b: &V24) -> DVec3 {
    let mut m = [0.0; 3];
    for i in 0..8 {
        let (a, b) = (&a[3 * i..3 * i + 3], &b[3 * i..3 * i + 3]);
        m[0] += a[1] * b[2] - a[2] * b[1];
        m[1] += a[2] * b[0] - a[0] * b[2];
        m[2] += a[0] * b[1] - a[1] * b[0];
    }
    DVec3::from_array(m)
}

#[inline(always)]
fn dot(a: &V24, b: &V24) -> f64 {
    let mut sums = [0.0; 4];
    for (a, b) in a.as_chunks::<4>().0.iter().zip(b.as_chunks::<4>().0) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Multiplies every corner's vector by a matrix.
#[inline(always)]
fn turned(m: DMat3, v: &V24) -> V24 {
    let [a, b, c] = m.to_cols_array_2d();
    let mut out = [0.0; 24];
    for i in 0..8 {
        let (x, y, z) = (v[3 * i], v[3 * i + 1], v[3 * i + 2]);
        for k in 0..3 {
            out[3 * i + k] = a[k] * x + b[k] * y + c[k] * z;
        }
    }
    out
}

/// Subtracts the mean of the eight corners.
#[inline(always)]
fn centred(mut v: V24) -> V24 {
    let mut mean = [0.0; 3];
    for i in 0..24 {
        mean[i % 3] += 0.125 * v[i];
    }
    for i in 0..24 {
        v[i] -= mean[i % 3];
    }
    v
}

/// A cell in one configuration, with its own frame and the derivative of that frame.
#[derive(Clone, Copy, Debug)]
pub struct CellPose {
    /// Rotation R of the cell and what its derivative needs.
    pub polar: Polar,
    /// Arms Rᵀ(x_i − x_c) [m].
    pub z: V24,
    /// Deformation z_i − X_i in the body frame [m].
    pub q: V24,
    /// 1 / (4h) [1/m].
    scale: f64,
}

impl CellPose {
    /// Pose of a cell with corners `x` [m] and edge `h` [m]; R follows x.
    #[inline(always)]
    pub fn new(x: &[DVec3; 8], h: f64) -> CellPose {
        let polar = Polar::new(deformation_gradient(x, h));
        let z = turned(polar.r.transpose(), &centred(flatten(x)));
        let mut q = z;
        for i in 0..24 {
            q[i] -= 0.5 * h * SIGNS[i / 3][i % 3];
        }
        CellPose { polar, z, q, scale: 0.25 / h }
    }

    /// Rᵀ v per corner.
    pub fn to_body(&self, v: &[DVec3; 8]) -> V24 {
        turned(self.polar.r.transpose(), &flatten(v))
    }

    /// R v per corner.
    #[inline(always)]
    pub fn to_world(&self, v: &V24) -> [DVec3; 8] {
        corners(&turned(self.polar.r, v))
    }

    /// ½ scale qᵀKq.
    pub fn energy(&self, k: &M24, scale: f64) -> f64 {
        0.5 * scale * dot(&self.q, &multiply(k, &self.q))
    }

    /// ω with dR = R \[ω\]×, for corner increments in the body frame.
    fn spin_body(&self, dx: &V24) -> DVec3 {
        let mut m = [0.0; 3];
        for i in 0..8 {
            let (s, d) = (&SIGNS[i], &dx[3 * i..3 * i + 3]);
            m[0] += s[1] * d[2] - s[2] * d[1];
            m[1] += s[2] * d[0] - s[0] * d[2];
            m[2] += s[0] * d[1] - s[1] * d[0];
        }
        self.polar.g_inv * (DVec3::from_array(m) * self.scale)
    }

    #[inline(always)]
    fn spin_adjoint_body(&self, g: DVec3) -> V24 {
        let t = (self.polar.g_inv * g) * self.scale;
        let mut out = [0.0; 24];
        for i in 0..8 {
            let s = &SIGNS[i];
            out[3 * i] = t.y * s[2] - t.z * s[1];
            out[3 * i + 1] = t.z * s[0] - t.x * s[2];
            out[3 * i + 2] = t.x * s[1] - t.y * s[0];
        }
        out
    }

    /// dq for world-frame corner increments `dx` (or q's rate for velocities).
    pub fn strain_rate(&self, dx: &[DVec3; 8]) -> V24 {
        let mut d = centred(self.to_body(dx));
        let omega = self.spin_body(&d);
        subtract_cross(&mut d, omega, &self.z);
        d
    }

    /// World-frame gradient of y·q by the corners at fixed `y`; the transpose of [`CellPose::strain_rate`].
    #[inline(always)]
    pub fn force(&self, y: &V24) -> [DVec3; 8] {
        self.to_world(&self.force_body(&centred(*y)))
    }

    #[inline(always)]
    fn force_body(&self, y: &V24) -> V24 {
        let mut f = *y;
        let turn = self.spin_adjoint_body(cross_sum(&self.z, y));
        for i in 0..24 {
            f[i] -= turn[i];
        }
        f
    }

    /// Q of the second derivative, for a `y` without resultant.
    #[inline(always)]
    fn spin_stiffness(&self, y: &V24) -> DMat3 {
        let mut m = [[0.0; 3]; 3];
        for i in 0..8 {
            for c in 0..3 {
                for r in 0..3 {
                    m[c][r] += self.z[3 * i + r] * y[3 * i + c];
                }
            }
        }
        let m = DMat3::from_cols_array_2d(&m);
        let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
        let half = m + self.polar.s * cross_matrix(self.polar.g_inv * cross_sum(&self.z, y));
        (half + half.transpose()) * 0.5 - DMat3::from_diagonal(DVec3::splat(trace))
    }

    /// World-frame second derivative of y·q at fixed `y`, times `dx`.
    pub fn second(&self, y: &V24, dx: &[DVec3; 8]) -> [DVec3; 8] {
        self.to_world(&self.second_body(&centred(*y), &centred(self.to_body(dx))))
    }

    fn second_body(&self, y: &V24, dx: &V24) -> V24 {
        let f = self.force_body(y);
        let omega = self.spin_body(dx);
        let mut out = self.spin_adjoint_body(cross_sum(&f, dx) + self.spin_stiffness(y) * omega);
        subtract_cross(&mut out, -omega, &f);
        out
    }

    /// (scale · PᵀKP + D²q\[y\]) dx in the world frame: [`CellPose::hessian`] without the matrix.
    pub fn hessian_product(&self, k: &M24, scale: f64, y: &V24, dx: &[DVec3; 8]) -> [DVec3; 8] {
        let d = centred(self.to_body(dx));
        let mut dq = d;
        subtract_cross(&mut dq, self.spin_body(&d), &self.z);
        let mut out = self.force_body(&multiply(k, &dq));
        for v in &mut out {
            *v *= scale;
        }
        let second = self.second_body(&centred(*y), &d);
        for i in 0..24 {
            out[i] += second[i];
        }
        self.to_world(&out)
    }
}

/// Deformation gradient at a cell's centre: F = (1/4h) Σ x_i σ_iᵀ.
#[inline(always)]
pub fn deformation_gradient(x: &[DVec3; 8], h: f64) -> DMat3 {
    let mut f = DMat3::ZERO;
    for i in 0..8 {
        let s = SIGNS[i];
        f += DMat3::from_cols(x[i] * s[0], x[i] * s[1], x[i] * s[2]);
    }
    f * (0.25 / h)
}

/// out_i −= ω × v_i.
#[inline(always)]
fn subtract_cross(out: &mut V24, omega: DVec3, v: &V24) {
    for i in 0..8 {
        let (x, y, z) = (v[3 * i], v[3 * i + 1], v[3 * i + 2]);
        out[3 * i] -= omega.y * z - omega.z * y;
        out[3 * i + 1] -= omega.z * x - omega.x * z;
        out[3 * i + 2] -= omega.x * y - omega.y * x;
    }
}

#[cfg(test)]
mod tests;
