//! Splats that a deforming body carries: Gaussians with a colour that depends on where they are looked at from (Kerbl et al., *3D Gaussian
//! Splatting*, ACM TOG 42(4), 2023).
//!
//! A motion with deformation gradient F takes a Gaussian of covariance Σ to one of F Σ Fᵀ. With Σ = R S² Rᵀ its axes are the left singular vectors of
//! F R S, and its lengths the singular values. One-sided Jacobi rotations (Hestenes 1958) find them from F R S itself, so that a rigid motion
//! changes no length and no order. A colour in spherical harmonics turns with the rotation of F = R U: the function of the direction d becomes that
//! of Rᵀd.

use glam::{DMat3, DQuat, DVec3};

/// Rounds of rotations: three converge from any start, and more change nothing.
const ROUNDS: usize = 12;

/// Orientation and standard deviations [m] of a Gaussian of orientation `q` (any length) and deviations `s` [m] that F has deformed.
pub fn deformed(f: DMat3, q: DQuat, s: DVec3) -> (DQuat, DVec3) {
    let r = DMat3::from_quat(q.normalize());
    let m = f * r;
    let mut a = [m.x_axis * s.x, m.y_axis * s.y, m.z_axis * s.z];
    for _ in 0..ROUNDS {
        let mut turned = false;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (p, b, c) = (a[i].dot(a[j]), a[i].length_squared(), a[j].length_squared());
            if p.abs() <= 1e-15 * (b * c).sqrt() {
                continue;
            }
            turned = true;
            let zeta = (c - b) / (2.0 * p);
            let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cos = 1.0 / t.hypot(1.0);
            (a[i], a[j]) = (cos * (a[i] - t * a[j]), cos * (a[j] + t * a[i]));
        }
        if !turned {
            break;
        }
    }
    let lengths = DVec3::new(a[0].length(), a[1].length(), a[2].length());
    // A flat splat's normal is across both other axes; a place that is turned inside out keeps a proper orientation.
    let x = a[0].try_normalize().unwrap_or(r.x_axis);
    let y = (a[1] - x * x.dot(a[1])).try_normalize().unwrap_or_else(|| x.any_orthonormal_vector());
    (DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))), lengths)
}

/// Highest degree of the harmonics.
const DEGREE: usize = 3;
/// Directions that harmonics are compared at; more than the seven functions of the highest degree.
const DIRECTIONS: usize = 20;
/// Functions of degrees 1 to 3.
pub const FUNCTIONS: usize = 15;

/// Real spherical harmonics of degrees 1 to 3 at a unit direction, in the order and with the signs of splat files.
pub fn harmonics(d: DVec3) -> [f64; FUNCTIONS] {
    let (x, y, z) = (d.x, d.y, d.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    use std::f64::consts::PI;
    let root = |x: f64| (x / PI).sqrt();
    let one = 0.5 * root(3.0);
    let [a, b, c] = [0.5 * root(15.0), 0.25 * root(5.0), 0.25 * root(15.0)];
    let [e, f, g, h, i] = [0.25 * root(17.5), 0.5 * root(105.0), 0.25 * root(10.5), 0.25 * root(7.0), 0.25 * root(105.0)];
    [
        -one * y,
        one * z,
        -one * x,
        a * x * y,
        -a * y * z,
        b * (2.0 * zz - xx - yy),
        -a * x * z,
        c * (xx - yy),
        -e * y * (3.0 * xx - yy),
        f * x * y * z,
        -g * y * (4.0 * zz - xx - yy),
        h * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -g * x * (4.0 * zz - xx - yy),
        i * z * (xx - yy),
        -e * x * (xx - 3.0 * yy),
    ]
}

/// First function of a degree, and how many there are.
fn span(degree: usize) -> (usize, usize) {
    (degree * degree - 1, 2 * degree + 1)
}

/// Turns the coefficients of harmonics.
#[derive(Clone, Debug)]
pub struct Turner {
    directions: [DVec3; DIRECTIONS],
    /// Of each degree the least-squares inverse of its functions at the directions `[2l + 1][DIRECTIONS]`.
    inverse: [Vec<[f64; DIRECTIONS]>; DEGREE],
}

impl Default for Turner {
    fn default() -> Turner {
        // A spiral around the sphere spreads any number of directions evenly (González, *Math. Geosci.* 42, 2010).
        let directions: [DVec3; DIRECTIONS] = std::array::from_fn(|k| {
            let z = 1.0 - (2.0 * k as f64 + 1.0) / DIRECTIONS as f64;
            let (r, angle) = ((1.0 - z * z).sqrt(), 2.399_963_229_728_653 * k as f64);
            DVec3::new(r * angle.cos(), r * angle.sin(), z)
        });
        let values = directions.map(harmonics);
        let inverse = [1, 2, 3].map(|degree| {
            let (first, count) = span(degree);
            let at = |k: usize, i: usize| values[k][first + i];
            let gram = |i: usize, j: usize| (0..DIRECTIONS).map(|k| at(k, i) * at(k, j)).sum::<f64>();
            let mut m: Vec<Vec<f64>> = (0..count).map(|i| (0..count).map(|j| gram(i, j)).collect()).collect();
            let mut rows: Vec<[f64; DIRECTIONS]> = (0..count).map(|i| std::array::from_fn(|k| at(k, i))).collect();
            // Gauss and Jordan on a Gram matrix that is nearly diagonal.
            for p in 0..count {
                let pivot = m[p][p];
                m[p].iter_mut().for_each(|x| *x /= pivot);
                rows[p].iter_mut().for_each(|x| *x /= pivot);
                for i in (0..count).filter(|i| *i != p) {
                    let factor = m[i][p];
                    for j in 0..count {
                        m[i][j] -= factor * m[p][j];
                    }
                    for k in 0..DIRECTIONS {
                        rows[i][k] -= factor * rows[p][k];
                    }
                }
            }
            rows
        });
        Turner { directions, inverse }
    }
}

impl Turner {
    /// Coefficients `[C][K]` of every colour channel, of degrees from 1 on (K is 3, 8 or 15), turned by R in place. A lower degree does not
    /// depend on a higher one.
    pub fn turn(&self, r: DMat3, channels: &mut [&mut [f64]]) {
        let seen: [[f64; FUNCTIONS]; DIRECTIONS] = self.directions.map(|d| harmonics(r.transpose() * d));
        for channel in channels.iter_mut() {
            let known = channel.len();
            for (degree, (first, count)) in
                (1..=DEGREE).map(|l| (l, span(l))).filter(|(_, (first, count))| first + count <= known)
            {
                let part = &channel[first..first + count];
                let values: [f64; DIRECTIONS] =
                    std::array::from_fn(|k| seen[k][first..first + count].iter().zip(part).map(|(b, c)| b * c).sum());
                for (i, row) in self.inverse[degree - 1].iter().enumerate() {
                    channel[first + i] = row.iter().zip(&values).map(|(a, v)| a * v).sum();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rotation::tests::Noise;

    fn covariance(q: DQuat, s: DVec3) -> DMat3 {
        let r = DMat3::from_quat(q.normalize());
        r * DMat3::from_diagonal(s * s) * r.transpose()
    }

    fn random(noise: &mut Noise) -> DMat3 {
        DMat3::from_axis_angle(noise.vector(1.0).normalize(), noise.uniform(-3.0, 3.0))
    }

    #[test]
    fn a_covariance_follows_its_motion() {
        let mut noise = Noise(21);
        for _ in 0..200 {
            let q = DQuat::from_mat3(&random(&mut noise)) * noise.uniform(0.5, 2.0);
            let s = DVec3::new(noise.uniform(0.1, 1.0), noise.uniform(0.1, 1.0), noise.uniform(0.001, 0.1));
            let turn = random(&mut noise);
            let f = turn + DMat3::from_cols(noise.vector(0.3), noise.vector(0.3), noise.vector(0.3));
            let (p, t) = deformed(f, q, s);
            let (found, wanted) = (covariance(p, t), f * covariance(q, s) * f.transpose());
            assert!((0..3).all(|c| (found.col(c) - wanted.col(c)).length() < 1e-12), "{found} {wanted}");
            // Rigid motion keeps every length where it is.
            let (p, t) = deformed(turn, q, s);
            assert!((t - s).length() < 1e-14);
            let (moved, whole) = (DMat3::from_quat(p), turn * DMat3::from_quat(q.normalize()));
            assert!((0..3).all(|c| (moved.col(c) - whole.col(c)).length() < 1e-12));
        }
        // A disk without thickness stays one.
        let (p, t) = deformed(random(&mut noise), DQuat::IDENTITY, DVec3::new(0.2, 0.1, 0.0));
        assert!((t - DVec3::new(0.2, 0.1, 0.0)).length() < 1e-14 && (p.length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_colour_turns_with_the_body() {
        let (turner, mut noise) = (Turner::default(), Noise(22));
        for count in [3, 8, 15] {
            let before: Vec<f64> = (0..count).map(|_| noise.uniform(-1.0, 1.0)).collect();
            let (turn, mut after) = (random(&mut noise), before.clone());
            turner.turn(turn, &mut [&mut after]);
            let colour = |c: &[f64], d: DVec3| harmonics(d).iter().zip(c).map(|(h, c)| h * c).sum::<f64>();
            for _ in 0..50 {
                let d = noise.vector(1.0).normalize();
                assert!((colour(&after, turn * d) - colour(&before, d)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn harmonics_are_those_of_splat_files() {
        // Constants as the files' programs print them: degree 1, 2 and 3.
        let h = harmonics(DVec3::new(0.6, 0.0, 0.8));
        assert!((h[1] - 0.488_602_511_902_919_9 * 0.8).abs() < 1e-15 && (h[2] + 0.488_602_511_902_919_9 * 0.6).abs() < 1e-15);
        assert!((h[6] + 1.092_548_430_592_079_2 * 0.48).abs() < 1e-15 && (h[7] - 0.546_274_215_296_039_6 * 0.36).abs() < 1e-15);
        assert!((h[5] - 0.315_391_565_252_520_05 * (1.28 - 0.36)).abs() < 1e-15);
        assert!((h[11] - 0.373_176_332_590_115_4 * 0.8 * (1.28 - 1.08)).abs() < 1e-15);
        assert!((h[12] + 0.457_045_799_464_465_8 * 0.6 * (2.56 - 0.36)).abs() < 1e-15);
        assert!((h[13] - 1.445_305_721_320_277 * 0.8 * 0.36).abs() < 1e-15);
        assert!((h[14] + 0.590_043_589_926_643_5 * 0.6 * 0.36).abs() < 1e-15);
        let g = harmonics(DVec3::new(0.48, 0.6, 0.64));
        assert!((g[9] - 2.890_611_442_640_554 * 0.48 * 0.6 * 0.64).abs() < 1e-15);
    }
}
