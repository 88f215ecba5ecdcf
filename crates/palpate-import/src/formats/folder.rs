//! What folders of depth images have in common: which files are images, what belongs to them, when they were taken.

use crate::Watch;
use crate::budget::Budget;
use crate::capture::{Capture, DepthCamera, DepthFrame, Guess};
use crate::error::{ImportError, refuse};
use crate::images::{ENDINGS, read_depth, read_mask};
use crate::intrinsics::{Intrinsics, check_center, holds_camera, read_camera, read_intrinsics, read_json};
use crate::options::Options;
use crate::place::{Place, has_ending};
use crate::times::{Times, of_files};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Words in paths of pictures that are not depth.
const OTHERS: [&str; 8] = ["color", "colour", "rgb", "infrared", "_ir", "/ir", "mask", "confidence"];

/// The depth images of a source: files under a folder named after depth, files named so, or all images that are not named after something else.
pub fn depth_files(place: &Place) -> Vec<PathBuf> {
    let images: Vec<&PathBuf> = place.with_ending(&ENDINGS).filter(|f| *f != &place.path).collect();
    let other = |name: &str| OTHERS.iter().any(|o| format!("/{name}").contains(o));
    let named = |f: &Path, part: fn(&str) -> &str| {
        let name = place.name(f);
        part(&name).contains("depth")
    };
    let in_folder: fn(&str) -> &str = |n| n.rsplit_once('/').map_or("", |(folder, _)| folder);
    let own: fn(&str) -> &str = |n| n;
    for part in [in_folder, own] {
        let found: Vec<PathBuf> = images.iter().filter(|f| named(f, part)).map(|f| (*f).clone()).collect();
        if !found.is_empty() {
            return one_kind(found);
        }
    }
    one_kind(images.into_iter().filter(|f| !other(&place.name(f))).cloned().collect())
}

/// Where a tool wrote every image twice (PNG to look at, raw to compute with), the files that are numbers alone.
fn one_kind(files: Vec<PathBuf>) -> Vec<PathBuf> {
    for ending in ["npy", "tiff", "tif", "raw", "bin"] {
        let of: Vec<PathBuf> = files.iter().filter(|f| has_ending(f, &[ending])).cloned().collect();
        if !of.is_empty() && of.len() < files.len() {
            return of;
        }
    }
    files
}

/// Refuses images that lie in several folders: they are of several cameras, or of several takes.
pub fn one_folder(place: &Place, files: &[PathBuf]) -> Result<(), ImportError> {
    let mut folders: Vec<&Path> = files.iter().filter_map(|f| f.parent()).collect();
    folders.dedup();
    if folders.len() < 2 {
        return Ok(());
    }
    let names: Vec<String> = folders.iter().take(4).map(|f| place.name(f)).collect();
    refuse(
        &place.path,
        format!("holds depth images in several folders ({}); name the folder of one camera and take", names.join(", ")),
    )
}

/// The files of a source that hold a camera, with what they hold: JSON, or the Viewer's metadata in CSV, of which one stands for all that say the same.
pub fn camera_files(place: &Place) -> Vec<(PathBuf, Value)> {
    let small = |f: &&PathBuf| std::fs::metadata(f).is_ok_and(|m| m.len() < 1 << 24);
    let viewer = |f: &&PathBuf| has_ending(f, &["json"]) || place.name(f).contains("metadata");
    let mut found: Vec<(PathBuf, Value)> = Vec::new();
    for f in place.with_ending(&["json", "csv"]).filter(small).filter(viewer) {
        let Some(v) = read_camera(f).ok().filter(holds_camera) else { continue };
        if !(has_ending(f, &["csv"]) && found.iter().any(|(_, w)| *w == v)) {
            found.push((f.clone(), v));
        }
    }
    found
}

/// The intrinsics of a source: of the file that the user names, of the only JSON file that holds a camera, or of the one named after depth.
pub fn intrinsics(place: &Place, o: &Options) -> Result<(PathBuf, Intrinsics), ImportError> {
    if let Some(path) = &o.intrinsics {
        return Ok((path.clone(), read_intrinsics(path)?));
    }
    let files: Vec<PathBuf> = camera_files(place).into_iter().map(|(f, _)| f).collect();
    let deep: Vec<&PathBuf> = files.iter().filter(|f| place.name(f).contains("depth")).collect();
    match (&files[..], &deep[..]) {
        ([one], _) => Ok((one.clone(), read_intrinsics(one)?)),
        (_, [one]) => Ok(((*one).clone(), read_intrinsics(one)?)),
        ([], _) => {
            // A file that should be the one and is broken says more than that there is none.
            for f in place.with_ending(&["json"]) {
                read_json(f)?;
            }
            refuse(
                &place.path,
                "holds no JSON file with intrinsics (fx, fy, cx, cy or an intrinsic_matrix); --intrinsics FILE names one",
            )
        }
        (several, _) => {
            let names: Vec<String> = several.iter().map(|f| place.name(f)).collect();
            refuse(&place.path, format!("holds several cameras' intrinsics ({}); --intrinsics FILE names one", names.join(", ")))
        }
    }
}

/// Reads images with their times and masks into the one camera of a capture.
pub fn read_images(
    place: &Place,
    files: &[PathBuf],
    times: Times,
    camera: (&Path, &Intrinsics),
    usual_scale: (f64, &'static str),
    watch: &mut Watch,
) -> Result<Capture, ImportError> {
    let (path, i) = camera;
    let masks: Vec<&PathBuf> = place.with_ending(&["png"]).filter(|f| place.name(f).contains("mask")).collect();
    if !masks.is_empty() && masks.len() != files.len() {
        return refuse(&place.path, format!("holds {} masks for {} depth images", masks.len(), files.len()));
    }
    let (mut frames, mut budget) = (Vec::<DepthFrame>::new(), Budget::new());
    let mut size = i.size;
    // In parts, so that somebody may look and stop.
    for (part, numbered) in files.iter().enumerate().collect::<Vec<_>>().chunks(32).enumerate() {
        watch.at(part * 32, files.len(), "depth images")?;
        if size.is_none() {
            size = Some(read_depth(&files[0], None)?.0);
        }
        let read: Vec<Result<DepthFrame, ImportError>> = numbered
            .par_iter()
            .map(|(k, file)| {
                let (found, pixels) = read_depth(file, size)?;
                let mask = masks.get(*k).map(|m| read_mask(m, found)).transpose()?;
                Ok(DepthFrame { time: times.seconds[*k], file: (*file).clone(), pixels, mask })
            })
            .collect();
        for frame in read {
            let frame = frame?;
            frame.pixels.take(&place.path, &mut budget)?;
            frames.push(frame);
        }
    }
    let Some(size) = size else { return refuse(&place.path, "holds no depth image") };
    check_center(path, "cx", &i.optics, Some(size))?;
    let camera = DepthCamera {
        name: "cam0".into(),
        size,
        optics: i.optics,
        scale: i.scale,
        usual_scale,
        poses: Vec::new(),
        frames,
        made: false,
    };
    Ok(Capture {
        title: place.title(),
        cameras: vec![camera],
        guesses: times.guess.into_iter().collect(),
        facts: vec![times.fact, format!("intrinsics from {}", path.display())],
        ..Capture::default()
    })
}

/// A folder of depth images with intrinsics in JSON.
pub fn read(place: &Place, o: &Options, usual_scale: (f64, &'static str), watch: &mut Watch) -> Result<Capture, ImportError> {
    let files = depth_files(place);
    if files.is_empty() {
        return refuse(&place.path, format!("holds no depth image; read are .{}", ENDINGS.join(", .")));
    }
    one_folder(place, &files)?;
    let (path, i) = intrinsics(place, o)?;
    let times = of_files(place, &files, o.fps, i.fps)?;
    let mut capture = read_images(place, &files, times, (&path, &i), usual_scale, watch)?;
    if has_ending(&path, &["csv"]) {
        let text = "no distortion, since the Viewer's metadata state none; depth images of D400 cameras have none";
        capture.guesses.push(Guess::recording("intrinsics", "camera.0.distortion", text, "--intrinsics"));
    }
    Ok(capture)
}
