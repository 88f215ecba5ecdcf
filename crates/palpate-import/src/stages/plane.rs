//! The largest plane among points: random samples of three (RANSAC, Fischler & Bolles 1981), then least squares. The same points give the same plane.

use glam::{DMat3, DVec3};

/// A plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, on the side on which most of the other points lie.
    pub normal: DVec3,
    /// Distance from the origin along it [m].
    pub offset: f64,
    /// Share of the points that lie on it.
    pub share: f64,
}

impl Plane {
    /// Signed distance of a point [m].
    pub fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }
}

/// Samples of three points that are tried. Where a third of the points lies on a plane, one sample in 27 is of it alone.
const TRIES: usize = 600;

/// Points that are looked at.
const POINTS: usize = 4000;

/// The plane with the most points nearer than `tolerance` [m]; `None` of fewer than ten points.
pub fn largest(points: &[DVec3], tolerance: f64) -> Option<Plane> {
    let every = points.len().div_ceil(POINTS).max(1);
    let some: Vec<DVec3> = points.iter().step_by(every).copied().collect();
    if some.len() < 10 {
        return None;
    }
    // A generator by itself (SplitMix64): three lines, and nothing in the world depends on its quality.
    let mut state = 1u64;
    let mut draw = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        some[((z ^ (z >> 31)) % some.len() as u64) as usize]
    };
    let near = |n: DVec3, d: f64| some.iter().filter(|p| (n.dot(**p) - d).abs() < tolerance).count();
    let mut best: Option<(usize, DVec3, f64)> = None;
    for _ in 0..TRIES {
        let [a, b, c] = [draw(), draw(), draw()];
        let Some(n) = (b - a).cross(c - a).try_normalize() else { continue };
        let count = near(n, n.dot(a));
        if best.is_none_or(|b| count > b.0) {
            best = Some((count, n, n.dot(a)));
        }
    }
    let (_, mut n, mut d) = best?;
    for _ in 0..3 {
        let on: Vec<DVec3> = some.iter().copied().filter(|p| (n.dot(*p) - d).abs() < tolerance).collect();
        (n, d) = refined(&on, n).unwrap_or((n, d));
    }
    let above = some.iter().filter(|p| n.dot(**p) - d > tolerance).count();
    let below = some.iter().filter(|p| n.dot(**p) - d < -tolerance).count();
    let sign = if below > above { -1.0 } else { 1.0 };
    Some(Plane { normal: sign * n, offset: sign * d, share: near(n, d) as f64 / some.len() as f64 })
}

/// Least squares of heights over the plane that is there: h = a x + b y + c.
fn refined(points: &[DVec3], n: DVec3) -> Option<(DVec3, f64)> {
    let (x, y) = n.any_orthonormal_pair();
    let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let (mut m, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for p in points {
        let q = *p - mean;
        let row = DVec3::new(q.dot(x), q.dot(y), 1.0);
        m += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        right += row * q.dot(n);
    }
    (points.len() > 3 && m.determinant().abs() > 0.0).then(|| {
        let s = m.inverse() * right;
        let normal = (n - s.x * x - s.y * y).normalize();
        (normal, normal.dot(mean + s.z * n))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_under_a_ball_is_found() {
        let up = DVec3::new(0.1, -0.97, 0.2).normalize();
        let (x, y) = up.any_orthonormal_pair();
        let mut points = Vec::new();
        for i in 0..60 {
            for j in 0..60 {
                // Ripples of a millimetre stand for noise.
                let ripple = 0.001 * f64::from((i * 7 + j * 13) % 5 - 2) / 2.0;
                points.push(x * (0.01 * f64::from(i)) + y * (0.01 * f64::from(j)) + up * (0.3 + ripple));
            }
        }
        for i in 0..500 {
            let a = f64::from(i) * 0.7;
            points.push(up * 0.4 + x * 0.3 + y * 0.3 + DVec3::new(a.cos(), a.sin(), (3.0 * a).sin()) * 0.05);
        }
        let plane = largest(&points, 0.008).unwrap();
        // Ripples even out over 3600 points.
        assert!(plane.normal.dot(up) > 1.0 - 1e-6 && (plane.offset - 0.3).abs() < 2e-4, "{plane:?}");
        assert!((0.8..0.95).contains(&plane.share), "{plane:?}");
        assert_eq!(largest(&points, 0.008), Some(plane));
        assert_eq!(largest(&points[..5], 0.008), None);
    }
}
