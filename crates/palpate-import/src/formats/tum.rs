//! Folders of the TUM RGB-D benchmark: `depth.txt`, images of 1/5000 m, and `groundtruth.txt` with the way of the camera.

use super::{Format, folder};
use crate::Watch;
use crate::capture::{Capture, Guess};
use crate::error::{ImportError, read_text, refuse};
use crate::intrinsics::Intrinsics;
use crate::lens::Optics;
use crate::options::{Options, rigid_of};
use crate::place::{Place, head_text};
use crate::times::{Times, rising};
use glam::{DAffine3, DQuat, DVec3};
use palpate_io::InputError;
use palpate_io::lens::Lens;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "tum",
    what: "TUM RGB-D folder with depth.txt",
    detect: |place| {
        let list = list(place)?;
        let text = head_text(list);
        let line = text.lines().find(|l| !l.starts_with('#') && !l.trim().is_empty())?;
        let (time, file) = line.split_once(char::is_whitespace)?;
        (time.parse::<f64>().is_ok() && file.contains(".png")).then(|| "depth.txt lists times and images".into())
    },
    read,
};

fn list(place: &Place) -> Option<&PathBuf> {
    place.files.iter().find(|f| place.name(f) == "depth.txt")
}

/// Poses farther apart than this are not interpolated [s].
const GAP: f64 = 0.1;

/// Intrinsics that the benchmark's page states for its sequences: fx, fy, cx, cy of the depth images, which are registered to the colour camera.
const CAMERAS: [(&str, [f64; 4]); 4] = [
    ("freiburg1", [517.3, 516.5, 318.6, 255.3]),
    ("freiburg2", [520.9, 521.0, 325.1, 249.7]),
    ("freiburg3", [535.4, 539.2, 320.1, 247.6]),
    ("", [525.0, 525.0, 319.5, 239.5]),
];

/// Rows of a time and what follows it.
fn entries(path: &Path) -> Result<Vec<(usize, f64, Vec<String>)>, ImportError> {
    let mut all = Vec::new();
    for (i, line) in read_text(path)?.lines().enumerate() {
        let mut words = line.split([' ', '\t', ',']).filter(|w| !w.is_empty());
        let Some(first) = words.next().filter(|w| !w.starts_with('#')) else { continue };
        match first.parse::<f64>().ok().filter(|t| t.is_finite()) {
            Some(t) => all.push((i + 1, t, words.map(str::to_string).collect())),
            None => return Err(InputError::line(path, i + 1, format!("\"{first}\" is no time")).into()),
        }
    }
    let times: Vec<f64> = all.iter().map(|e| e.1).collect();
    rising(&times, |k| InputError::line(path, all[k].0, format!("time {} is not after the one before it", times[k])))?;
    Ok(all)
}

fn read(place: &Place, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some(path) = list(place) else { return refuse(&place.path, "holds no depth.txt") };
    let images = entries(path)?;
    let mut files = Vec::new();
    for (line, _, words) in &images {
        let file = place.path.join(words.first().map_or("", String::as_str));
        if !file.is_file() {
            return Err(InputError::line(path, *line, format!("there is no image {}", file.display())).into());
        }
        files.push(file);
    }
    let Some(&(_, zero, _)) = images.first() else { return refuse(path, "lists no image") };
    let mut guesses = Vec::new();
    let (from, i) = if o.intrinsics.is_some() || !folder::camera_files(place).is_empty() {
        folder::intrinsics(place, o)?
    } else {
        let title = place.title().to_ascii_lowercase();
        let short = |n: &str| n.replace("freiburg", "fr");
        let known = CAMERAS.iter().find(|(n, _)| title.contains(n) || title.contains(&short(n)));
        let (name, [fx, fy, cx, cy]) = known.expect("the last is in every name");
        let name = if name.is_empty() { "the default of the benchmark" } else { name };
        let text = format!("intrinsics {fx}, {fy}, {cx}, {cy} ({name}), since no file states them");
        guesses.push(Guess::recording("intrinsics", "camera.0.fx", text, "--intrinsics"));
        let optics = Optics { focal: [*fx, *fy], center: [*cx, *cy], lens: Lens::Brown([0.0; 5]) };
        (path.clone(), Intrinsics { size: Some([640, 480]), optics, scale: None, fps: None })
    };
    let times = Times {
        seconds: images.iter().map(|e| e.1 - zero).collect(),
        guess: None,
        fact: format!("times from depth.txt; 0 is its {zero}"),
    };
    let mut capture =
        folder::read_images(place, &files, times, (&from, &i), (1.0 / 5000.0, "the benchmark counts 5000 a metre"), watch)?;
    capture.guesses.extend(guesses);
    if let Some(truth) = place.files.iter().find(|f| place.name(f) == "groundtruth.txt") {
        let poses = poses(truth)?;
        let camera = &mut capture.cameras[0];
        let all = camera.frames.len();
        let mut kept = Vec::new();
        for f in std::mem::take(&mut camera.frames) {
            if let Some(p) = at(&poses, f.time + zero) {
                camera.poses.push(p);
                kept.push(f);
            }
        }
        camera.frames = kept;
        if camera.frames.is_empty() {
            return refuse(truth, "holds no pose at the time of any image");
        }
        if camera.frames.len() < all {
            let lost = all - camera.frames.len();
            capture.losses.push(format!("{lost} of {all} images lie outside of the poses in groundtruth.txt and are left out"));
        }
    }
    Ok(capture)
}

fn poses(path: &Path) -> Result<Vec<(f64, DAffine3)>, ImportError> {
    let mut all = Vec::new();
    for (line, t, words) in entries(path)? {
        let n: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
        if n.len() != 7 {
            return Err(InputError::line(path, line, "must be time tx ty tz qx qy qz qw").into());
        }
        all.push((t, rigid_of(&n).map_err(|e| InputError::line(path, line, e))?));
    }
    Ok(all)
}

/// The pose at a time, between two that are near.
fn at(poses: &[(f64, DAffine3)], t: f64) -> Option<DAffine3> {
    let k = poses.partition_point(|p| p.0 <= t);
    let before = k.checked_sub(1).map(|k| &poses[k]);
    match (before, poses.get(k)) {
        (Some((a, p)), Some((b, q))) if b - a <= GAP => {
            let s = (t - a) / (b - a);
            let turn = |x: &DAffine3| DQuat::from_mat3(&x.matrix3);
            let shift: DVec3 = p.translation.lerp(q.translation, s);
            Some(DAffine3::from_rotation_translation(turn(p).slerp(turn(q), s), shift))
        }
        (Some((a, p)), _) if t - a <= 0.5 * GAP => Some(*p),
        (_, Some((b, q))) if b - t <= 0.5 * GAP => Some(*q),
        _ => None,
    }
}
