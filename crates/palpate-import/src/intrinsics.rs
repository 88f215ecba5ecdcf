//! Intrinsics of cameras in JSON, as the tools of camera makers and Open3D write them.

use crate::error::{ImportError, read_text, refuse, refuse_key};
use crate::lens::Optics;
use crate::place::has_ending;
use palpate_io::lens::Lens;
use serde_json::Value;
use std::path::Path;

/// What a JSON file says about a camera.
#[derive(Clone, Debug)]
pub struct Intrinsics {
    /// Columns and rows, where it says them.
    pub size: Option<[usize; 2]>,
    /// Focal lengths, principal point, distortion.
    pub optics: Optics,
    /// Metres of a count, where it says it.
    pub scale: Option<f64>,
    /// Frames per second, where it says it.
    pub fps: Option<f64>,
}

/// Reads a file that may hold a camera: JSON, or the metadata in CSV that the RealSense Viewer writes beside an image, as the same in JSON.
pub fn read_camera(path: &Path) -> Result<Value, ImportError> {
    if !has_ending(path, &["csv"]) {
        return read_json(path);
    }
    let text = read_text(path)?;
    let mut camera = serde_json::Map::new();
    for (key, value) in text.lines().filter_map(|l| l.split_once(',')) {
        let key = match key.trim() {
            "Resolution x" => "width",
            "Resolution y" => "height",
            k @ ("Fx" | "Fy" | "PPx" | "PPy") => k,
            _ => continue,
        };
        let value = value.trim();
        let whole = value.parse::<u64>().map(Value::from);
        let number = whole.or_else(|_| value.parse::<f64>().map(Value::from));
        camera.insert(key.into(), number.unwrap_or_else(|_| Value::from(value)));
    }
    Ok(Value::Object(camera))
}

/// Reads a file as JSON; what is wrong with it is said with its line.
pub fn read_json(path: &Path) -> Result<Value, ImportError> {
    let text = read_text(path)?;
    serde_json::from_str(&text).map_err(|e| {
        let hint = if text.contains("NaN") { " (NaN is no number of JSON: the camera's intrinsics are not known)" } else { "" };
        let message = format!("not valid JSON: {e}{hint}");
        palpate_io::InputError::line(path, e.line().max(1), message).into()
    })
}

/// The value under one of these names, whatever their case, here.
fn named<'a>(v: &'a Value, names: &[&str]) -> Option<(&'a String, &'a Value)> {
    v.as_object()?.iter().find(|(k, _)| names.iter().any(|n| k.eq_ignore_ascii_case(n)))
}

/// The values under one of these names, here and below, with their dotted paths.
fn everywhere<'a>(v: &'a Value, names: &[&str], path: &str, found: &mut Vec<(String, &'a Value)>) {
    let at = |k: &str| if path.is_empty() { k.to_string() } else { format!("{path}.{k}") };
    match v {
        Value::Object(o) => {
            for (k, inner) in o {
                if names.iter().any(|n| k.eq_ignore_ascii_case(n)) {
                    found.push((at(k), inner));
                }
                everywhere(inner, names, &at(k), found);
            }
        }
        Value::Array(a) => {
            for (i, inner) in a.iter().enumerate().take(64) {
                everywhere(inner, names, &at(&i.to_string()), found);
            }
        }
        _ => {}
    }
}

const MATRICES: [&str; 6] = ["intrinsic_matrix", "camera_matrix", "K", "intrinsics_matrix", "cameraMatrix", "camera_intrinsics"];

/// Tables that hold a camera: with fx, or with a matrix; and their dotted paths.
fn cameras<'a>(v: &'a Value, path: &str, found: &mut Vec<(String, &'a Value)>) {
    if named(v, &["fx"]).is_some() || named(v, &MATRICES).is_some_and(|(_, m)| numbers(m).len() == 9) {
        found.push((path.to_string(), v));
        return;
    }
    let at = |k: &str| if path.is_empty() { k.to_string() } else { format!("{path}.{k}") };
    match v {
        Value::Object(o) => o.iter().for_each(|(k, inner)| cameras(inner, &at(k), found)),
        Value::Array(a) => a.iter().take(64).enumerate().for_each(|(i, inner)| cameras(inner, &at(&i.to_string()), found)),
        _ => {}
    }
}

/// True where a JSON value holds a camera.
pub fn holds_camera(v: &Value) -> bool {
    let mut found = Vec::new();
    cameras(v, "", &mut found);
    !found.is_empty()
}

/// Numbers of an array, of arrays in it (row by row), or of OpenCV's `{ data = […] }`.
fn numbers(v: &Value) -> Vec<f64> {
    match v {
        Value::Array(a) => a.iter().flat_map(numbers).collect(),
        Value::Object(o) => o.get("data").map(numbers).unwrap_or_default(),
        Value::Number(n) => n.as_f64().into_iter().collect(),
        // What is no number is one that is missing.
        _ => vec![f64::NAN],
    }
}

/// Reads the intrinsics of a depth camera.
///
/// # Errors
/// The file is no JSON, holds none or several cameras, or a number that cannot be one of a camera.
pub fn read_intrinsics(path: &Path) -> Result<Intrinsics, ImportError> {
    of_json(path, &read_camera(path)?)
}

/// The same of what was read.
pub fn of_json(path: &Path, json: &Value) -> Result<Intrinsics, ImportError> {
    let mut found = Vec::new();
    cameras(json, "", &mut found);
    if found.len() > 1 {
        let deep: Vec<_> = found.iter().filter(|(p, _)| p.to_ascii_lowercase().contains("depth")).cloned().collect();
        if deep.len() != 1 {
            let names: Vec<&str> = found.iter().map(|f| f.0.as_str()).collect();
            return refuse(
                path,
                format!("holds {} cameras ({}), none or several with depth in its name", names.len(), names.join(", ")),
            );
        }
        found = deep;
    }
    let Some((place, camera)) = found.pop() else {
        return refuse(path, "holds no intrinsics: fx, fy, cx (or ppx), cy (or ppy), or a 3 × 3 intrinsic_matrix");
    };
    let key = |k: &str| if place.is_empty() { k.to_string() } else { format!("{place}.{k}") };
    let number = |names: &[&str]| -> Result<f64, ImportError> {
        match named(camera, names) {
            Some((k, v)) => match v.as_f64().filter(|x| x.is_finite()) {
                Some(x) => Ok(x),
                None => refuse_key(path, key(k), format!("{v} is not a finite number")),
            },
            None => refuse_key(path, key(names[0]), "is missing"),
        }
    };
    let [fx, fy, cx, cy] = match named(camera, &MATRICES) {
        Some((k, m)) => matrix(&numbers(m)).map_or_else(|e| refuse_key(path, key(k), e), Ok)?,
        None => [number(&["fx"])?, number(&["fy"])?, number(&["cx", "ppx"])?, number(&["cy", "ppy"])?],
    };
    for (k, f) in [("fx", fx), ("fy", fy)] {
        if f <= 0.0 {
            return refuse_key(path, key(k), format!("{f} is not allowed: a focal length is > 0 (pixels)"));
        }
    }
    let length = |names: &[&str]| -> Result<Option<usize>, ImportError> {
        let here = named(camera, names).map(|(k, v)| (key(k), v)).or_else(|| named(json, names).map(|(k, v)| (k.clone(), v)));
        match here {
            None => Ok(None),
            Some((k, v)) => match v.as_u64().filter(|n| (1..=65536).contains(n)) {
                Some(n) => Ok(Some(n as usize)),
                None => refuse_key(path, k, format!("{v} is not allowed: 1 to 65536 pixels")),
            },
        }
    };
    let size = match (length(&["width", "w", "image_width"])?, length(&["height", "h", "image_height"])?) {
        (Some(w), Some(h)) => Some([w, h]),
        _ => None,
    };
    let one = |names: &[&str]| -> Result<Option<(String, f64)>, ImportError> {
        let mut all = Vec::new();
        everywhere(json, names, "", &mut all);
        match all.first() {
            None => Ok(None),
            Some((k, v)) => match v.as_f64().filter(|x| *x > 0.0 && x.is_finite()) {
                Some(x) => Ok(Some((k.clone(), x))),
                None => refuse_key(path, k.clone(), format!("{v} is not allowed: must be a number > 0")),
            },
        }
    };
    let scale = one(&["depth_scale", "depthscale", "depth_units", "depth_unit"])?;
    // Some write metres of a count (0.001), some counts of a metre (1000).
    let scale = scale.map(|(_, x)| if x > 1.0 { 1.0 / x } else { x });
    let fps = one(&["fps", "framerate", "frame_rate"])?.map(|f| f.1);
    let lens = lens(path, camera, &place)?;
    let optics = Optics { focal: [fx, fy], center: [cx, cy], lens };
    check_center(path, &key("cx"), &optics, size)?;
    Ok(Intrinsics { size, optics, scale, fps })
}

/// Focal lengths in sides of the image: fields of view of 170° to half a degree.
const FOCAL: std::ops::RangeInclusive<f64> = 0.04..=60.0;

/// A principal point far outside the image belongs to another image, and so does a focal length with which it would show all or nothing.
pub fn check_center(path: &Path, key: &str, optics: &Optics, size: Option<[usize; 2]>) -> Result<(), ImportError> {
    let Some(size) = size else { return Ok(()) };
    let inside = |a: usize| (-0.5..=size[a] as f64 + 0.5).contains(&optics.center[a]);
    if inside(0) && inside(1) {
        return match (0..2).find(|a| !FOCAL.contains(&(optics.focal[*a] / size[*a] as f64))) {
            None => Ok(()),
            Some(a) => {
                let text =
                    format!("the focal length {} is no one of an image of {} × {} pixels", optics.focal[a], size[0], size[1]);
                refuse_key(path, key, format!("{text}: allowed are {} to {} of its side", FOCAL.start(), FOCAL.end()))
            }
        };
    }
    let [x, y] = optics.center;
    refuse_key(path, key, format!("the principal point ({x}, {y}) lies outside of the {} × {} pixels", size[0], size[1]))
}

/// fx, fy, cx, cy of a 3 × 3 matrix, row by row or (Open3D) column by column.
fn matrix(m: &[f64]) -> Result<[f64; 4], String> {
    let &[fx, a, b, c, fy, d, e, f, one] = m else { return Err(format!("has {} numbers, a 3 × 3 matrix has 9", m.len())) };
    if m.iter().any(|x| !x.is_finite()) {
        return Err("holds what is not a finite number".into());
    }
    let (cx, cy, zero) = if e == 0.0 && f == 0.0 { (b, d, [a, c]) } else { (e, f, [b, d]) };
    if one != 1.0 || zero[0] != 0.0 && zero[1] != 0.0 {
        return Err(format!("{m:?} is no intrinsic matrix: [fx, 0, cx, 0, fy, cy, 0, 0, 1]"));
    }
    if a != 0.0 || c != 0.0 {
        return Err(format!("has a skew of {}; pixels with a skew are not known here", if a != 0.0 { a } else { c }));
    }
    Ok([fx, fy, cx, cy])
}

fn lens(path: &Path, camera: &Value, place: &str) -> Result<Lens, ImportError> {
    let names = ["coeffs", "distortion", "distortion_coefficients", "dist_coeffs", "dist", "D", "distCoeffs"];
    let key = |k: &str| if place.is_empty() { k.to_string() } else { format!("{place}.{k}") };
    let Some((k, v)) = named(camera, &names).filter(|(_, v)| v.is_array() || v.is_object()) else {
        let single: Vec<f64> = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]
            .iter()
            .filter_map(|n| named(camera, &[n]))
            .map(|(_, v)| v.as_f64().unwrap_or(f64::NAN))
            .collect();
        return lens_of("", &single).or_else(|e| refuse_key(path, key("k1"), e));
    };
    let model = named(camera, &["model", "distortion_model", "distortion"]).and_then(|(_, v)| v.as_str()).unwrap_or("");
    lens_of(model, &numbers(v)).or_else(|e| refuse_key(path, key(k), e))
}

/// A lens of a model's name and coefficients in OpenCV's order.
pub fn lens_of(model: &str, k: &[f64]) -> Result<Lens, String> {
    if let Some(x) = k.iter().find(|x| !x.is_finite()) {
        return Err(format!("holds {x}, which is not a finite number"));
    }
    if k.iter().all(|x| *x == 0.0) {
        return Ok(Lens::Brown([0.0; 5]));
    }
    let model = model.to_ascii_lowercase().replace(['-', ' '], "_");
    let model = model.rsplit('.').next().unwrap_or("");
    let five = || match *k {
        [k1, k2, p1, p2] => Ok([k1, k2, p1, p2, 0.0]),
        [k1, k2, p1, p2, k3] => Ok([k1, k2, p1, p2, k3]),
        _ => Err(format!("has {} coefficients; k1 k2 p1 p2 k3 are five", k.len())),
    };
    match (model, k.len()) {
        ("none", _) => Ok(Lens::Brown([0.0; 5])),
        ("inverse_brown_conrady", _) => five().map(Lens::Inverse),
        ("modified_brown_conrady", _) => five().map(Lens::Modified),
        ("equidistant" | "fisheye" | "kannala_brandt4", 4..) => Ok(Lens::Angle([k[0], k[1], k[2], k[3]])),
        (
            "" | "brown_conrady" | "plumb_bob" | "opencv" | "radtan" | "radial_tangential" | "rational_polynomial" | "rational",
            8,
        ) => Ok(Lens::Rational(std::array::from_fn(|i| k[i]))),
        (
            "" | "brown_conrady" | "plumb_bob" | "opencv" | "radtan" | "radial_tangential" | "rational_polynomial" | "rational",
            4 | 5,
        ) => five().map(Lens::Brown),
        (_, n) => Err(format!(
            "{n} coefficients of model \"{model}\" are not known; allowed: 4, 5 or 8 of OpenCV's (k1 k2 p1 p2 k3 k4 k5 k6), \
             brown_conrady, modified_brown_conrady, inverse_brown_conrady, rational_polynomial, equidistant"
        )),
    }
}
