//! Tracked points: C3D files of motion-capture systems.

use super::MarkerSample;
use crate::error::InputError;
use c3dio::C3d;
use glam::DVec3;
use std::path::Path;

/// Names and samples of a C3D file, in metres; frame k of the capture (from 0) is at k / rate.
pub(super) fn read_c3d(
    path: &Path,
    bytes: &[u8],
    warnings: &mut Vec<String>,
) -> Result<(Vec<String>, Vec<MarkerSample>), InputError> {
    let refuse = |text: String| InputError::file(path, text);
    // The parser indexes into damaged files without looking; a panic there is a fault of the file.
    let parsed =
        std::panic::catch_unwind(|| C3d::from_bytes(bytes)).map_err(|_| refuse("not a readable C3D file: damaged".into()))?;
    let c3d = parsed.map_err(|e| refuse(format!("not a readable C3D file: {e}")))?;
    let p = &c3d.points;
    let unit: String = p.units.iter().filter(|c| !c.is_whitespace() && **c != '\0').collect();
    let scale = match unit.to_ascii_lowercase().as_str() {
        "mm" => 1e-3,
        "cm" => 1e-2,
        "m" => 1.0,
        _ => return Err(refuse(format!("POINT:UNITS is \"{unit}\", expected mm, cm or m"))),
    };
    let rate = f64::from(p.frame_rate);
    if !(rate > 0.0 && rate.is_finite()) {
        return Err(refuse(format!("POINT:RATE is {rate}, must be > 0 (frames per second)")));
    }
    let (frames, columns) = (p.points.rows(), p.points.cols());
    let announced = usize::from(p.last_frame).saturating_sub(usize::from(p.first_frame)) + 1;
    if frames < announced {
        warnings.push(format!("{}: holds {frames} frames, its header announces {announced} (truncated?)", path.display()));
    }
    let names: Vec<String> = (0..columns)
        .map(|j| match p.labels.get(j).map(|l| l.trim_matches(|c: char| c.is_whitespace() || c == '\0')) {
            Some(l) if !l.is_empty() => l.to_string(),
            _ => format!("point{}", j + 1),
        })
        .collect();
    for (j, name) in names.iter().enumerate() {
        if names[..j].contains(name) {
            return Err(refuse(format!("POINT:LABELS holds \"{name}\" twice")));
        }
    }
    let mut samples = Vec::new();
    for k in 0..frames {
        for j in 0..columns {
            let m = &p.points[k][j];
            // −1 marks a point that was not seen. The crate multiplies residuals by the scale factor, whose sign
            // tells integers from floats.
            let absent = m.residual / p.scale_factor < -0.5;
            let position = DVec3::from_array(m.point.map(f64::from)) * scale;
            if !absent && position.is_finite() {
                samples.push(MarkerSample { time: k as f64 / rate, marker: j, position });
            }
        }
    }
    if samples.is_empty() {
        return Err(refuse("holds no marker that was seen".into()));
    }
    Ok((names, samples))
}
