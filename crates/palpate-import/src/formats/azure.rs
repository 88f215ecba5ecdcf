//! Folders of an Azure Kinect: depth images with Open3D's `intrinsic.json`, or with the device's own calibration, whose lens is rational.

use super::{Format, folder};
use crate::Watch;
use crate::capture::Capture;
use crate::error::{ImportError, refuse, refuse_key};
use crate::images::read_depth;
use crate::intrinsics::{Intrinsics, read_json};
use crate::lens::Optics;
use crate::options::Options;
use crate::place::Place;
use crate::times::of_files;
use palpate_io::lens::Lens;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "azure-kinect",
    what: "folder of depth images with an Azure Kinect's calibration",
    detect: |place| {
        let (file, _) = calibration(place).or_else(|| open3d(place))?;
        (!folder::depth_files(place).is_empty()).then(|| format!("{} is of an Azure Kinect", place.name(&file)))
    },
    read,
};

/// What all depth images of the device are in.
const MILLIMETRES: (f64, &str) = (0.001, "an Azure Kinect counts millimetres");

fn calibration(place: &Place) -> Option<(PathBuf, Value)> {
    place
        .with_ending(&["json"])
        .filter_map(|f| Some((f.clone(), read_json(f).ok()?)))
        .find(|(_, v)| v.pointer("/CalibrationInformation/Cameras").is_some_and(Value::is_array))
}

fn open3d(place: &Place) -> Option<(PathBuf, Value)> {
    let ours = |v: &Value| v.get("depth_mode").is_some() || v.get("color_mode").is_some();
    folder::camera_files(place).into_iter().find(|(_, v)| ours(v))
}

fn read(place: &Place, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some((path, json)) = calibration(place).filter(|_| o.intrinsics.is_none()) else {
        let mut capture = folder::read(place, o, MILLIMETRES, watch)?;
        if open3d(place).is_some_and(|(_, v)| v.get("color_mode").is_some()) {
            capture.facts.push("Open3D's intrinsics are those of the colour camera, to which it has aligned the depth".into());
        }
        return Ok(capture);
    };
    let files = folder::depth_files(place);
    let Some(first) = files.first() else { return refuse(&place.path, "holds no depth image") };
    folder::one_folder(place, &files)?;
    let (size, _) = read_depth(first, None)?;
    let optics = depth_camera(&path, &json, size)?;
    let i = Intrinsics { size: Some(size), optics, scale: None, fps: None };
    let times = of_files(place, &files, o.fps, None)?;
    folder::read_images(place, &files, times, (&path, &i), MILLIMETRES, watch)
}

/// Depth modes by the size of their images: pixels of the binned sensor, and where the image begins on it.
const MODES: [([usize; 2], f64, [f64; 2]); 4] = [
    ([640, 576], 1024.0, [192.0, 180.0]),
    ([320, 288], 512.0, [96.0, 90.0]),
    ([512, 512], 512.0, [0.0, 0.0]),
    ([1024, 1024], 1024.0, [0.0, 0.0]),
];

/// The depth camera of the device's calibration, which is in shares of the sensor, for images of a size.
fn depth_camera(path: &Path, json: &Value, size: [usize; 2]) -> Result<Optics, ImportError> {
    let Some((_, sensor, crop)) = MODES.iter().find(|m| m.0 == size) else {
        let text =
            format!("{} × {} pixels are of no depth mode (640 × 576, 320 × 288, 512 × 512, 1024 × 1024)", size[0], size[1]);
        return refuse(
            path,
            format!("{text}; are the images aligned to the colour camera? --intrinsics FILE gives its intrinsics"),
        );
    };
    let cameras = json.pointer("/CalibrationInformation/Cameras").and_then(Value::as_array).map_or(&[][..], |a| a);
    let depth = |c: &&Value| c.get("Location").and_then(Value::as_str).is_some_and(|l| l.ends_with("D0"));
    let Some(k) = cameras.iter().position(|c| depth(&c)) else {
        return refuse_key(path, "CalibrationInformation.Cameras", "has none at CALIBRATION_CameraLocationD0, the depth camera");
    };
    let key = format!("CalibrationInformation.Cameras.{k}.Intrinsics.ModelParameters");
    let given = cameras[k].pointer("/Intrinsics/ModelParameters").and_then(Value::as_array).map_or(&[][..], |a| a);
    let p: Vec<f64> = given.iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect();
    // cx, cy, fx, fy, k1 … k6, codx, cody, p2, p1.
    let &[cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, codx, cody, p2, p1] = &p[..] else {
        return refuse_key(path, key, format!("has {} numbers, expected 14", p.len()));
    };
    if p.iter().any(|x| !x.is_finite()) || !(fx > 0.0 && fy > 0.0) {
        return refuse_key(path, key, "holds what is no finite number, or a focal length that is not > 0");
    }
    if codx != 0.0 || cody != 0.0 {
        return refuse_key(path, key, "has a centre of distortion off the axis, which no model here has");
    }
    Ok(Optics {
        focal: [fx * sensor, fy * sensor],
        center: [cx * sensor - 0.5 - crop[0], cy * sensor - 0.5 - crop[1]],
        lens: Lens::Rational([k1, k2, p1, p2, k3, k4, k5, k6]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_published_calibration_gives_the_published_intrinsics() {
        let json: Value = serde_json::from_str(
            r#"{"CalibrationInformation": {"Cameras": [{"Location": "CALIBRATION_CameraLocationD0", "Intrinsics": {"ModelParameters":
            [0.5122697949409485, 0.49451231956481934, 0.4921168386936188, 0.4921667277812958, 3.1305770874023438, 2.324939012527466,
             0.1304156482219696, 3.458651542663574, 3.350114583969116, 0.6629416346549988, 0, 0, -0.0000511557373101823,
             0.00008132171933539212]}}]}}"#,
        )
        .unwrap();
        let o = depth_camera(Path::new("c.json"), &json, [640, 576]).unwrap();
        // What the device's software printed for the same calibration, with six digits.
        for (a, b) in [(o.center[0], 332.064270), (o.center[1], 325.880615), (o.focal[0], 503.927643), (o.focal[1], 503.978729)] {
            assert!((a - b).abs() < 5e-6 * b, "{a} {b}");
        }
        let Lens::Rational(k) = o.lens else { panic!("{:?}", o.lens) };
        assert!((k[2] - 0.000081).abs() < 1e-6 && (k[3] + 0.000051).abs() < 1e-6 && k[4] == 0.1304156482219696);
        let e = depth_camera(Path::new("c.json"), &json, [1280, 720]).unwrap_err().to_string();
        assert!(e.contains("no depth mode"), "{e}");
    }
}
