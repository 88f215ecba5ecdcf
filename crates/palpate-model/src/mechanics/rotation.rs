//! Rotation of a deformation gradient and its exact derivative.
//!
//! The rotation of F is the R ∈ SO(3) that maximises tr(RᵀF), i.e. the nearest rotation in the Frobenius norm. For
//! det F > 0 it is the orthogonal factor of the polar decomposition; for inverted or flat F it is still a proper rotation,
//! so that inverted cells feel a restoring force. It is unique unless the two smallest signed stretches sum to zero.

use glam::{DMat3, DQuat, DVec3};

/// Determinant, relative to that of an isotropic matrix of the same norm, above which Newton's iteration is used:
/// rounding of det F (1e-16 relative to the norm cubed) is then harmless and R is far from the non-unique set.
pub const NEWTON_DETERMINANT: f64 = 1e-3;

/// Smallest eigenvalue of G [dimensionless, like a stretch] that [`Polar::new`] leaves as it is.
pub const SMALLEST_PAIR: f64 = 1e-3;

/// Rotation R ∈ SO(3) that maximises tr(RᵀF), orthonormal to rounding; also for singular and inverted `f`.
///
/// Scaled Newton iteration (Higham, SIAM J. Sci. Stat. Comput. 7(4), 1986) where det F is comfortably positive, else the
/// leading eigenvector of Davenport's 4 × 4 matrix (Horn, J. Opt. Soc. Am. A 4(4), 1987) by Jacobi rotations.
pub fn polar(f: DMat3) -> DMat3 {
    let norm2 = f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared();
    let reference = norm2 / 3.0;
    if f.determinant() > NEWTON_DETERMINANT * reference * reference.sqrt() { newton(f) } else { davenport(f) }
}

fn newton(f: DMat3) -> DMat3 {
    let norm2 = |m: &DMat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    let mut x = f;
    let mut far = true;
    // Ten scaled steps reach rounding even at a condition number of 1e16; the bound only stops NaN.
    for _ in 0..20 {
        let (a, b, c) = (x.x_axis, x.y_axis, x.z_axis);
        let cofactor = DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b));
        let det = a.dot(cofactor.x_axis);
        // γ² = ‖X⁻¹‖ / ‖X‖ makes the stretches' geometric mean one; close to R it would only add rounding.
        let gamma = if far { (norm2(&cofactor) / (norm2(&x) * det * det)).sqrt().sqrt() } else { 1.0 };
        let next = x * (0.5 * gamma) + cofactor * (0.5 / (gamma * det));
        let moved = norm2(&(next - x));
        x = next;
        // The error after a step is about half the step squared.
        if moved < 1e-16 {
            break;
        }
        far = moved > 1e-2;
    }
    x
}

fn davenport(f: DMat3) -> DMat3 {
    let (a, b, c) = (f.x_axis, f.y_axis, f.z_axis);
    let trace = a.x + b.y + c.z;
    let skew = [b.z - c.y, c.x - a.z, a.y - b.x];
    // Quaternion order (w, x, y, z): qᵀ N q = tr(R(q)ᵀ F).
    let mut n = [
        [trace, skew[0], skew[1], skew[2]],
        [skew[0], 2.0 * a.x - trace, a.y + b.x, a.z + c.x],
        [skew[1], a.y + b.x, 2.0 * b.y - trace, b.z + c.y],
        [skew[2], a.z + c.x, b.z + c.y, 2.0 * c.z - trace],
    ];
    let mut v = [[0.0; 4]; 4];
    for i in 0..4 {
        v[i][i] = 1.0;
    }
    // Cyclic Jacobi converges quadratically: five sweeps in practice, the bound only stops NaN.
    for _ in 0..16 {
        let off: f64 = (0..4).flat_map(|i| (i + 1..4).map(move |j| (i, j))).map(|(i, j)| n[i][j] * n[i][j]).sum();
        let diagonal: f64 = (0..4).map(|i| n[i][i] * n[i][i]).sum();
        // Squares: off-diagonal 1e-17 of the diagonal leaves eigenvectors exact to rounding.
        if off <= 1e-34 * diagonal {
            break;
        }
        for p in 0..3 {
            for q in p + 1..4 {
                jacobi_rotate(&mut n, &mut v, p, q);
            }
        }
    }
    // The first of equal eigenvalues: F = 0 gives the identity.
    let best = (1..4).fold(0, |best, i| if n[i][i] > n[best][best] { i } else { best });
    DMat3::from_quat(DQuat::from_xyzw(v[1][best], v[2][best], v[3][best], v[0][best]).normalize())
}

fn jacobi_rotate(n: &mut [[f64; 4]; 4], v: &mut [[f64; 4]; 4], p: usize, q: usize) {
    if n[p][q] == 0.0 {
        return;
    }
    let tau = (n[q][q] - n[p][p]) / (2.0 * n[p][q]);
    let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
    let c = 1.0 / (1.0 + t * t).sqrt();
    let s = t * c;
    for k in 0..4 {
        let (x, y) = (n[k][p], n[k][q]);
        n[k][p] = c * x - s * y;
        n[k][q] = s * x + c * y;
        let (x, y) = (v[k][p], v[k][q]);
        v[k][p] = c * x - s * y;
        v[k][q] = s * x + c * y;
    }
    for k in 0..4 {
        let (x, y) = (n[p][k], n[q][k]);
        n[p][k] = c * x - s * y;
        n[q][k] = s * x + c * y;
    }
}

/// Vector w with [w]× = A − Aᵀ.
pub fn axial(a: DMat3) -> DVec3 {
    DVec3::new(a.y_axis.z - a.z_axis.y, a.z_axis.x - a.x_axis.z, a.x_axis.y - a.y_axis.x)
}

/// The matrix [w]× with [w]× v = w × v.
pub fn cross_matrix(w: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, w.z, -w.y), DVec3::new(-w.z, 0.0, w.x), DVec3::new(w.y, -w.x, 0.0))
}

/// A deformation gradient F = R S with what the derivative of R needs.
#[derive(Clone, Copy, Debug)]
pub struct Polar {
    /// Rotation R.
    pub r: DMat3,
    /// Stretch S = sym(RᵀF).
    pub s: DMat3,
    /// Inverse of G = tr(S) I − S, whose eigenvalues are the sums of two signed stretches.
    ///
    /// When the smallest sum falls below 1e-3 G is shifted until it equals 1e-3: at zero (a cell inverted as far along
    /// one axis as it is stretched along another) R is not unique, jumps, and has no derivative. The shift keeps the
    /// derivative finite and continuous there; it is then no longer exact.
    pub g_inv: DMat3,
}

impl Polar {
    /// Decomposes `f`.
    pub fn new(f: DMat3) -> Polar {
        let r = polar(f);
        let m = r.transpose() * f;
        let s = (m + m.transpose()) * 0.5;
        let trace = s.x_axis.x + s.y_axis.y + s.z_axis.z;
        let mut g = DMat3::from_diagonal(DVec3::splat(trace)) - s;
        // λ₁ λ₂ λ₃ = det G and λ₂ λ₃ ≤ (tr G / 2)² = (tr S)² show cheaply that λ₁ is large enough.
        if g.determinant() <= SMALLEST_PAIR * trace * trace {
            let smallest = smallest_eigenvalue(g);
            if smallest < SMALLEST_PAIR {
                g += DMat3::from_diagonal(DVec3::splat(SMALLEST_PAIR - smallest));
            }
        }
        Polar { r, s, g_inv: g.inverse() }
    }

    /// ω with dR = R [ω]× for a change `df` of F: ω = G⁻¹ ax(RᵀdF − dFᵀR).
    pub fn spin(&self, df: DMat3) -> DVec3 {
        self.g_inv * axial(self.r.transpose() * df)
    }
}

/// Smallest eigenvalue of a symmetric matrix (trigonometric solution of the cubic).
fn smallest_eigenvalue(a: DMat3) -> f64 {
    let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
    let b = a - DMat3::from_diagonal(DVec3::splat(mean));
    let p = ((b.x_axis.length_squared() + b.y_axis.length_squared() + b.z_axis.length_squared()) / 6.0).sqrt();
    if p == 0.0 {
        return mean;
    }
    let angle = (b.determinant() / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    mean + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Reproducible numbers for tests (SplitMix64).
    pub(crate) struct Noise(pub u64);

    impl Noise {
        pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }

        pub(crate) fn vector(&mut self, size: f64) -> DVec3 {
            DVec3::from_array([0; 3].map(|_| self.uniform(-size, size)))
        }

        pub(crate) fn rotation(&mut self) -> DMat3 {
            let axis = self.vector(1.0).try_normalize().unwrap_or(DVec3::X);
            DMat3::from_axis_angle(axis, self.uniform(-1.0, 1.0) * std::f64::consts::PI)
        }
    }

    fn norm(m: DMat3) -> f64 {
        m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    fn assert_rotation(r: DMat3) {
        assert!(norm(r.transpose() * r - DMat3::IDENTITY) < 1e-14, "{r:?}");
        assert!((r.determinant() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn finds_the_rotation_of_stretched_and_inverted_matrices() {
        let mut noise = Noise(1);
        for i in 0..2000 {
            let (u, v) = (noise.rotation(), noise.rotation());
            // Stretches from 1e-4 to 1e4, every third one inverted along its smallest axis.
            let mut s = [0; 3].map(|_| 10f64.powf(noise.uniform(-1.0, 1.0) * if i % 2 == 0 { 0.3 } else { 4.0 }));
            s.sort_by(|a, b| b.total_cmp(a));
            if i % 3 == 0 {
                s[2] = -s[2];
            }
            let r = u * v;
            let f = r * (v.transpose() * DMat3::from_diagonal(DVec3::from_array(s)) * v);
            let found = polar(f);
            assert_rotation(found);
            // Conditioning of R: rounding of F divided by the sum of the two smallest signed stretches.
            let tolerance = 1e-14 * (1.0 + 10.0 * s[0] / (s[1] + s[2]));
            assert!(norm(found - r) < tolerance, "{s:?}: {}", norm(found - r));
        }
    }

    #[test]
    fn flat_and_zero_matrices_give_a_rotation() {
        for f in [
            DMat3::ZERO,
            DMat3::from_diagonal(DVec3::new(1.0, 0.0, 0.0)),
            DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)),
            -DMat3::IDENTITY,
        ] {
            assert_rotation(polar(f));
        }
        assert_eq!(polar(DMat3::ZERO), DMat3::IDENTITY);
    }

    #[test]
    fn spin_matches_central_differences() {
        let mut noise = Noise(2);
        let mut tested = 0;
        while tested < 500 {
            let s = DVec3::from_array([0; 3].map(|_| 10f64.powf(noise.uniform(-1.0, 1.0))));
            let (r, v) = (noise.rotation(), noise.rotation());
            let sign = if tested % 4 == 0 { -1.0 } else { 1.0 };
            let f = r * (v.transpose() * DMat3::from_diagonal(DVec3::new(s.x, s.y, sign * s.z)) * v);
            let p = Polar::new(f);
            let pair = 1.0 / norm(p.g_inv);
            // Differences need a smooth neighbourhood: well away from the set where R is not unique.
            if pair < 0.02 {
                continue;
            }
            tested += 1;
            let df = DMat3::from_cols(noise.vector(1.0), noise.vector(1.0), noise.vector(1.0));
            let d = 1e-5 * pair;
            let turn = (polar(f + df * d) - polar(f - df * d)) * (0.5 / d);
            let exact = p.r * cross_matrix(p.spin(df));
            // Truncation (d/pair)² = 1e-10 and rounding 1e-16 · norm / d, both relative to 1/pair.
            assert!(norm(turn - exact) * pair < 1e-8, "{}", norm(turn - exact) * pair);
        }
    }

    #[test]
    fn spin_stays_bounded_where_the_rotation_is_not_unique() {
        for small in [1e-3, 1e-6, 0.0, -1e-9] {
            let f = DMat3::from_diagonal(DVec3::new(1.0, 0.5, -0.5 + small));
            let p = Polar::new(f);
            // The largest eigenvalue of G⁻¹ is 1/1e-3; 1 % for the eigenvalue's rounding.
            assert!(norm(p.g_inv) < 1.01e3 * 3f64.sqrt());
        }
    }
}
