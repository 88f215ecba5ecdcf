//! Clamp motion: a CSV of poses.

use crate::error::InputError;
use glam::{DQuat, DVec3};
use palpate_model::mechanics::motion::RigidMotion;
use std::path::Path;

const COLUMNS: [&str; 8] = ["time", "x", "y", "z", "qx", "qy", "qz", "qw"];

/// Reads `time,x,y,z,qx,qy,qz,qw` rows (s, m, unit quaternion) with increasing times.
pub(super) fn read_motion(path: &Path) -> Result<RigidMotion, InputError> {
    let bytes = std::fs::read(path).map_err(|e| InputError::io(path, &e))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
    let broken = |e: csv::Error| {
        let line = e.position().map(|p| p.line() as usize);
        InputError { line, ..InputError::file(path, format!("not a readable CSV file: {e}")) }
    };
    let header: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_string).collect();
    if header != COLUMNS {
        return Err(InputError::line(path, 1, format!("columns are {}, expected {}", header.join(","), COLUMNS.join(","))));
    }
    let mut motion = RigidMotion::default();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        let mut v = [0.0; 8];
        for (i, field) in record.iter().enumerate() {
            v[i] = (field.parse().ok().filter(|x: &f64| x.is_finite()))
                .ok_or_else(|| InputError::line(path, line, format!("{}: \"{field}\" is not a finite number", COLUMNS[i])))?;
        }
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
