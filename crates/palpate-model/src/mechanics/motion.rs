//! Prescribed rigid motion of a clamp: a smooth curve through sampled poses.

use super::path::{Between, chord};
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
        if self.times.is_empty() {
            return (DMat3::IDENTITY, DVec3::ZERO);
        }
        let (first, f) = match Between::at(&self.times, t) {
            Between::Held(m) => return (DMat3::from_quat(self.rotations[m].normalize()), self.translations[m]),
            Between::Cubic { first, value, .. } => (first, value),
        };
        // Neighbouring samples' quaternions are brought to the same hemisphere; q and −q are the same rotation.
        let q0 = self.rotations[first];
        let near = |m: usize| if self.rotations[m].dot(q0) < 0.0 { -self.rotations[m] } else { self.rotations[m] };
        let slope = |m: usize| -> (DVec3, DQuat) {
            let (a, b, span) = chord(&self.times, m);
            ((self.translations[b] - self.translations[a]) / span, (near(b) - near(a)) * (1.0 / span))
        };
        let next = first + 1;
        let ((vi, wi), (vj, wj)) = (slope(first), slope(next));
        let b = self.translations[first] * f[0] + vi * f[1] + self.translations[next] * f[2] + vj * f[3];
        let q = q0 * f[0] + wi * f[1] + near(next) * f[2] + wj * f[3];
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
