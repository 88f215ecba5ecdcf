//! The path of the nozzle in a PLUSH folder: poses of a marker in the first camera's axes become places and directions of the jet.

use crate::capture::Capture;
use crate::error::{ImportError, refuse_key};
use crate::intrinsics::read_json;
use glam::{DMat3, DVec3};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// From the marker to the nozzle's mouth, in the marker's axes [mm], and the direction in which it blows, as the data set's page says.
const MOUTH: DVec3 = DVec3::new(0.0, 105.0, 0.0);
const AXIS: DVec3 = DVec3::NEG_Z;

/// Largest error of an entry of RᵀR: files hold six digits and more.
const ORTHOGONAL: f64 = 1e-3;

/// Name of the file that is written.
pub const FILE: &str = "nozzle.csv";

/// Numbers in nested arrays, in order.
fn flat(v: &Value, out: &mut Vec<f64>) {
    match v {
        Value::Array(all) => all.iter().for_each(|v| flat(v, out)),
        v => out.extend(v.as_f64()),
    }
}

/// Reads the path of the nozzle; its entries belong to frames in order, at so many a second.
pub fn read(path: &Path, rate: f64, frames: usize, capture: &mut Capture) -> Result<(), ImportError> {
    let poses: Vec<(usize, Value)> = match read_json(path)? {
        Value::Array(all) => all.into_iter().enumerate().collect(),
        Value::Object(all) => {
            let mut out = Vec::new();
            for (key, value) in all {
                match key.parse() {
                    Ok(k) => out.push((k, value)),
                    Err(_) => return refuse_key(path, key, "is no number of a frame"),
                }
            }
            out.sort_by_key(|p| p.0);
            out
        }
        _ => return refuse_key(path, "", "must be an array with a pose, or null, for every frame"),
    };
    let mut text = "time,x,y,z,axis_x,axis_y,axis_z\n".to_string();
    let mut seen = 0;
    for (k, pose) in poses.iter().filter(|p| !p.1.is_null()) {
        let numbers = |key: &str, count: usize| {
            let mut all = Vec::new();
            pose.get(key).iter().for_each(|v| flat(v, &mut all));
            match all.len() == count && all.iter().all(|x| x.is_finite()) {
                true => Ok(all),
                false => refuse_key(path, format!("{k}.{key}"), format!("holds {} finite numbers, expected {count}", all.len())),
            }
        };
        let (r, t) = (numbers("rvecs", 9)?, DVec3::from_slice(&numbers("tvecs", 3)?));
        let r = DMat3::from_cols_slice(&r).transpose();
        let error = (r.transpose() * r - DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        if error > ORTHOGONAL || r.determinant() < 0.0 {
            return refuse_key(path, format!("{k}.rvecs"), "is no rotation matrix");
        }
        // From the camera's axes (y down, z forward) to those of the reconstruction (y up), and from millimetres to metres.
        let turned = |v: DVec3| DVec3::new(v.x, -v.y, -v.z);
        // Adding zero turns −0 into 0.
        let (p, a) = (turned(r * MOUTH + t) * 1e-3 + DVec3::ZERO, turned(r * AXIS).normalize() + DVec3::ZERO);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:?},{:?},{:?},{:?},{:?},{:?},{:?}", *k as f64 / rate, p.x, p.y, p.z, a.x, a.y, a.z);
        seen += 1;
    }
    if poses.len() != frames {
        capture
            .facts
            .push(format!("the nozzle's path has {} entries for {frames} frames; both begin at the same time", poses.len()));
    }
    if seen > 0 {
        capture.beside.push((FILE.into(), text));
        capture.losses.push(format!(
            "the jet: where the nozzle was (m) and blew to in {seen} of {} frames is in {FILE}, and the scene has no law of a jet; [[effect]] \
             kind = \"wind\" blows everywhere alike",
            poses.len()
        ));
    }
    Ok(())
}
