//! Prescribed rigid motion of a clamp: a smooth curve through sampled poses.

use glam::{DMat3, DQuat, DVec3};

/// A rigid motion x ↦ R(t) x + b(t) about the world origin, sampled at increasing times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigidMotion {
    /// Sample times on the recording's clock [s], increasing.
    pub times: Vec<f64>,
    /// Translations b [m].
    pub translations: Vec<DVec3>,
    /// Rotations (unit quaternions).
    pub rotations: Vec<DQuat>,
}

impl RigidMotion {
    /// Rotation matrix and translation [m] at a time: cubic (Catmull–Rom) between samples, held outside them.
    pub fn at(&self, t: f64) -> (DMat3, DVec3) {
        let n = self.times.len();
        if n == 0 {
            return (DMat3::IDENTITY, DVec3::ZERO);
        }
        let k = self.times.partition_point(|&s| s <= t);
        if k == 0 || k == n {
            let i = k.saturating_sub(1).min(n - 1);
            return (DMat3::from_quat(self.rotations[i].normalize()), self.translations[i]);
        }
        let (i, j) = (k - 1, k);
        let dt = self.times[j] - self.times[i];
        let s = (t - self.times[i]) / dt;
        // Neighbouring samples' quaternions are brought to the same hemisphere; q and −q are the same rotation.
        let q0 = self.rotations[i];
        let near = |q: DQuat| if q.dot(q0) < 0.0 { -q } else { q };
        let slope = |m: usize| -> (DVec3, DQuat) {
            let (a, b) = (m.saturating_sub(1), (m + 1).min(n - 1));
            let span = self.times[b] - self.times[a];
            let dq = (near(self.rotations[b]) - near(self.rotations[a])) * (1.0 / span);
            ((self.translations[b] - self.translations[a]) / span, dq)
        };
        let ((vi, wi), (vj, wj)) = (slope(i), slope(j));
        let (s2, s3) = (s * s, s * s * s);
        let (h0, h1, h2, h3) = (2.0 * s3 - 3.0 * s2 + 1.0, (s3 - 2.0 * s2 + s) * dt, -2.0 * s3 + 3.0 * s2, (s3 - s2) * dt);
        let b = self.translations[i] * h0 + vi * h1 + self.translations[j] * h2 + vj * h3;
        let q = q0 * h0 + wi * h1 + near(self.rotations[j]) * h2 + wj * h3;
        (DMat3::from_quat(q.normalize()), b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_through_samples_and_keeps_constant_rotation_rate() {
        let times: Vec<f64> = (0..11).map(|i| f64::from(i) * 0.1).collect();
        let m = RigidMotion {
            translations: times.iter().map(|t| DVec3::new(*t, t * t, 0.0)).collect(),
            rotations: times.iter().map(|t| DQuat::from_rotation_z(*t)).collect(),
            times,
        };
        let (r, b) = m.at(0.45);
        assert!((b - DVec3::new(0.45, 0.2025, 0.0)).length() < 1e-12, "{b}");
        let exact = DMat3::from_rotation_z(0.45);
        assert!((0..3).all(|c| (r.col(c) - exact.col(c)).length() < 1e-5), "{r}");
        assert!((m.at(0.3).1.x - 0.3).abs() < 1e-12);
        assert_eq!(m.at(9.0).1.x, 1.0);
    }
}
