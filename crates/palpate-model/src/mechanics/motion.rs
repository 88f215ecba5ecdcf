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
        let pose = self.pose(t);
        (pose.rotation, pose.translation)
    }

    /// The same with its rates.
    pub fn pose(&self, t: f64) -> Pose {
        if self.times.is_empty() {
            return Pose::STILL;
        }
        let (first, value, rate) = match Between::at(&self.times, t) {
            Between::Held(m) => {
                let rotation = DMat3::from_quat(self.rotations[m].normalize());
                return Pose { rotation, translation: self.translations[m], ..Pose::STILL };
            }
            Between::Cubic { first, value, rate } => (first, value, rate),
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
        let [b, db] =
            [value, rate].map(|f| self.translations[first] * f[0] + vi * f[1] + self.translations[next] * f[2] + vj * f[3]);
        let [q, dq] = [value, rate].map(|f| q0 * f[0] + wi * f[1] + near(next) * f[2] + wj * f[3]);
        let (rotation, length) = (DMat3::from_quat(q.normalize()), q.length());
        // Ṙ = [ω]× R with the angular velocity ω, the vector part of 2 q̇ q̄ / |q|²: what q̇ has along q does not turn.
        let spin = 2.0 / (length * length) * (dq * q.conjugate()).xyz();
        let turned = DMat3::from_cols(spin.cross(rotation.x_axis), spin.cross(rotation.y_axis), spin.cross(rotation.z_axis));
        Pose { rotation, translation: b, rotation_rate: turned, velocity: db }
    }
}

/// A rigid motion x ↦ R x + b at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation R.
    pub rotation: DMat3,
    /// Translation b [m].
    pub translation: DVec3,
    /// Ṙ [1/s].
    pub rotation_rate: DMat3,
    /// ḃ [m/s].
    pub velocity: DVec3,
}

impl Pose {
    /// Where the world is, at rest.
    pub const STILL: Pose =
        Pose { rotation: DMat3::IDENTITY, translation: DVec3::ZERO, rotation_rate: DMat3::ZERO, velocity: DVec3::ZERO };
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
        for t in [0.03, 0.27, 0.45, 0.99] {
            let (d, pose) = (1e-6, m.pose(t));
            let ((r1, b1), (r0, b0)) = (m.at(t + d), m.at(t - d));
            // A central difference: rounding of 1e-10.
            assert!(((b1 - b0) / (2.0 * d) - pose.velocity).length() < 1e-9);
            let turned = (r1 - r0) * (0.5 / d);
            assert!((0..3).all(|c| (turned.col(c) - pose.rotation_rate.col(c)).length() < 1e-9), "{t}");
        }
    }
}
