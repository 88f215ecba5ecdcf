//! Clamp motion: a CSV of poses.

use super::rows::rows;
use crate::error::InputError;
use glam::{DQuat, DVec3};
use palpate_model::mechanics::motion::RigidMotion;
use std::path::Path;

const COLUMNS: [&str; 8] = ["time", "x", "y", "z", "qx", "qy", "qz", "qw"];

/// Reads `time,x,y,z,qx,qy,qz,qw` rows (s, m, unit quaternion) with increasing times.
pub(super) fn read_motion(path: &Path) -> Result<RigidMotion, InputError> {
    let mut motion = RigidMotion::default();
    for (line, v) in rows(path, COLUMNS)? {
        if motion.times.last().is_some_and(|t| *t >= v[0]) {
            return Err(InputError::line(path, line, format!("time {} does not come after the row before it", v[0])));
        }
        let q = DQuat::from_xyzw(v[4], v[5], v[6], v[7]);
        // Rounding in files stays well below this; a wrong column order does not.
        if (q.length() - 1.0).abs() > 1e-3 {
            return Err(InputError::line(
                path,
                line,
                format!("qx,qy,qz,qw has length {}, expected 1 (unit quaternion)", q.length()),
            ));
        }
        motion.times.push(v[0]);
        motion.translations.push(DVec3::new(v[1], v[2], v[3]));
        motion.rotations.push(q.normalize());
    }
    if motion.times.is_empty() {
        return Err(InputError::file(path, "holds no row"));
    }
    Ok(motion)
}
