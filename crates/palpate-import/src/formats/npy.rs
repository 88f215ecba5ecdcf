//! Arrays of NumPy: stacks of depth images (frames, rows, columns) with intrinsics, or tracks of points (frames, points, 3).

use super::{Format, folder};
use crate::Watch;
use crate::arrays::{Array, Numbers, read_arrays};
use crate::capture::{Capture, DepthCamera, DepthFrame, Guess, Tracks};
use crate::error::{ImportError, refuse, refuse_option};
use crate::images::pixels;
use crate::intrinsics::{check_center, lens_of};
use crate::lens::Optics;
use crate::options::{Options, rigid_of};
use crate::place::{Place, head};
use crate::times::rising;
use glam::DVec3;
use palpate_io::InputError;
use palpate_io::lens::Lens;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "npy",
    what: "NPY or NPZ with a stack of depth images or tracks of points",
    detect: |place| {
        let files: Vec<&PathBuf> = place.with_ending(&["npy", "npz"]).collect();
        let stack = |f: &&PathBuf| head(f, 2) == b"PK" || axes(f) == Some(3);
        let found = if files.len() <= FEW { files.iter().find(|f| stack(f)) } else { None };
        found.map(|f| format!("{} holds a stack of frames", place.name(f)))
    },
    read,
};

/// More files than this are one image each.
const FEW: usize = 20;

/// Names of arrays that say something about others.
const TIMES: [&str; 6] = ["times", "time", "timestamps", "timestamp", "t", "stamps"];
const MATRIX: [&str; 6] = ["k", "intrinsics", "camera_matrix", "intrinsic_matrix", "intrinsic", "mtx"];
const LENS: [&str; 6] = ["distortion", "dist", "d", "coeffs", "dist_coeffs", "distortion_coefficients"];
const MASKS: [&str; 2] = ["mask", "masks"];
const POSE: [&str; 3] = ["world_from_camera", "camera_to_world", "camera_pose"];
const SCALE: [&str; 2] = ["depth_scale", "scale"];
const RATE: [&str; 3] = ["fps", "rate", "frame_rate"];

/// Number of axes of an `.npy` file, by its header.
fn axes(file: &Path) -> Option<usize> {
    let text = String::from_utf8_lossy(&head(file, 512)).into_owned();
    let shape = text.split_once("'shape':")?.1.split_once('(')?.1.split_once(')')?.0.to_string();
    Some(shape.split(',').filter(|n| !n.trim().is_empty()).count())
}

/// An array and where it was read from.
struct Found {
    file: PathBuf,
    array: Array,
}

fn read(place: &Place, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let files: Vec<&PathBuf> = place.with_ending(&["npy", "npz"]).collect();
    let mut all = Vec::new();
    for (k, file) in files.iter().enumerate().take(FEW) {
        watch.at(k, files.len(), "arrays")?;
        for mut array in read_arrays(file)? {
            if array.name.is_empty() {
                array.name = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            }
            all.push(Found { file: (*file).clone(), array });
        }
    }
    let is = |f: &Found, names: &[&str]| names.contains(&f.array.name.to_ascii_lowercase().as_str());
    let named = |names: &[&str]| all.iter().find(|f| is(f, names));
    let mut main: Vec<&Found> = all
        .iter()
        .filter(|f| f.array.shape.len() == 3 && f.array.shape[1..] != [4, 4])
        .filter(|f| [&MASKS[..], &MATRIX, &POSE].iter().all(|names| !is(f, names)))
        .filter(|f| o.pick.as_ref().is_none_or(|p| *p == f.array.name))
        .collect();
    // Beside others, what has three by three numbers a frame is matrices; alone, tracks of three points.
    if main.iter().any(|f| f.array.shape[1..] != [3, 3]) {
        main.retain(|f| f.array.shape[1..] != [3, 3]);
    }
    let main = match main[..] {
        [one] => one,
        [] => {
            let known: Vec<String> = all.iter().map(|f| format!("{} {}", f.array.name, f.array.shape_text())).collect();
            let text = "holds neither depth images (frames, rows, columns) nor tracks (frames, points, 3)";
            return refuse(&place.path, format!("{text}; there are: {}", known.join(", ")));
        }
        _ => {
            let names: Vec<&str> = main.iter().map(|f| f.array.name.as_str()).collect();
            return refuse_option("pick", o.pick.clone().unwrap_or_default(), format!("say which array: {}", names.join(", ")));
        }
    };
    let [frames, rows, columns] = main.array.shape[..] else { return refuse(&main.file, "has no three axes") };
    if frames * rows * columns == 0 {
        return refuse(
            &main.file,
            format!("array \"{}\" has shape {}: nothing is in it", main.array.name, main.array.shape_text()),
        );
    }
    let mut capture = Capture { title: place.title(), ..Capture::default() };
    let times = times(o, frames, named(&TIMES), named(&RATE), &mut capture)?;
    if columns == 3 {
        capture.tracks = Some(tracks(main, times)?);
        return Ok(capture);
    }
    let size = [columns, rows];
    let mut camera = camera(place, o, main, size, [named(&MATRIX), named(&LENS)], &mut capture)?;
    camera.scale = camera.scale.or(named(&SCALE).and_then(|f| single(&f.array)));
    if let Some(f) = named(&POSE) {
        let numbers = f.array.reals();
        for p in numbers.chunks(16) {
            if p.len() != 16 {
                return refuse(
                    &f.file,
                    format!("array \"{}\" has shape {}, expected (4, 4)", f.array.name, f.array.shape_text()),
                );
            }
            camera.poses.push(rigid_of(p).or_else(|e| refuse(&f.file, format!("array \"{}\": {e}", f.array.name)))?);
        }
        if camera.poses.len() != 1 && camera.poses.len() != frames {
            return refuse(&f.file, format!("array \"{}\" holds {} poses for {frames} images", f.array.name, camera.poses.len()));
        }
    }
    let mask = named(&MASKS);
    if let Some(m) = mask.filter(|m| m.array.shape != main.array.shape) {
        let (a, b) = (m.array.shape_text(), main.array.shape_text());
        return refuse(&m.file, format!("array \"{}\" has shape {a}, the depth images have {b}", m.array.name));
    }
    let masks = mask.map(|m| m.array.reals());
    let n = rows * columns;
    let part = |k: usize| match &main.array.numbers {
        Numbers::Counts(c) => Numbers::Counts(c[k * n..(k + 1) * n].to_vec()),
        Numbers::Whole(w) => Numbers::Whole(w[k * n..(k + 1) * n].to_vec()),
        Numbers::Real(r) => Numbers::Real(r[k * n..(k + 1) * n].to_vec()),
    };
    for (k, time) in times.into_iter().enumerate() {
        let mask = masks.as_ref().map(|m| m[k * n..(k + 1) * n].iter().map(|x| *x > 0.0).collect());
        camera.frames.push(DepthFrame { time, file: main.file.clone(), pixels: pixels(&main.file, part(k))?, mask });
    }
    capture.cameras.push(camera);
    Ok(capture)
}

/// The only number of an array, where it is > 0.
fn single(a: &Array) -> Option<f64> {
    let all = a.reals();
    (all.len() == 1).then(|| all[0]).filter(|x| *x > 0.0 && x.is_finite())
}

fn times(
    o: &Options,
    frames: usize,
    list: Option<&Found>,
    rate: Option<&Found>,
    capture: &mut Capture,
) -> Result<Vec<f64>, ImportError> {
    let evenly = |rate: f64| (0..frames).map(|k| k as f64 / rate).collect();
    if let Some(rate) = o.fps {
        return Ok(evenly(rate));
    }
    if let Some(f) = list {
        let t = f.array.reals();
        let fault = |text: String| InputError::file(&f.file, format!("array \"{}\": {text}", f.array.name));
        if t.len() != frames {
            return Err(fault(format!("holds {} times for {frames} frames", t.len())).into());
        }
        if let Some(k) = t.iter().position(|x| !x.is_finite()) {
            return Err(fault(format!("time {k} is {}", t[k])).into());
        }
        rising(&t, |k| fault(format!("time {k}, {}, is not after the one before it", t[k])))?;
        // A clock of the computer has more digits than a number of seconds needs.
        let zero = if t[0].abs() > 1e7 { t[0] } else { 0.0 };
        return Ok(t.iter().map(|x| x - zero).collect());
    }
    if let Some(rate) = rate.and_then(|f| single(&f.array)) {
        return Ok(evenly(rate));
    }
    if frames > 1 {
        let key = "frame";
        capture.guesses.push(Guess::recording("rate", key, "30 frames a second, since no array holds times or a rate", "--fps"));
    }
    Ok(evenly(30.0))
}

fn tracks(main: &Found, times: Vec<f64>) -> Result<Tracks, ImportError> {
    let count = main.array.shape[1];
    let numbers = main.array.reals();
    let mut places = Vec::with_capacity(times.len() * count);
    for (i, p) in numbers.chunks_exact(3).map(DVec3::from_slice).enumerate() {
        let nan = p.to_array().iter().filter(|x| x.is_nan()).count();
        if nan > 0 && nan < 3 || p.to_array().iter().any(|x| x.is_infinite()) {
            let (t, n) = (i / count, i % count);
            let text = format!("point {n} of frame {t} is {p}; what was not seen is NaN in x, y and z");
            return refuse(&main.file, format!("array \"{}\": {text}", main.array.name));
        }
        places.push(if nan > 0 { DVec3::NAN } else { p });
    }
    Ok(Tracks { times, count, places })
}

fn camera(
    place: &Place,
    o: &Options,
    main: &Found,
    size: [usize; 2],
    [matrix, lens]: [Option<&Found>; 2],
    capture: &mut Capture,
) -> Result<DepthCamera, ImportError> {
    let usual_scale = (0.001, "as most depth cameras count");
    let made = |optics, scale| DepthCamera {
        name: "cam0".into(),
        size,
        optics,
        scale,
        usual_scale,
        poses: Vec::new(),
        frames: Vec::new(),
        made: false,
    };
    let Some(f) = matrix.filter(|_| o.intrinsics.is_none()) else {
        if o.intrinsics.is_none() && folder::camera_files(place).is_empty() {
            let text = "holds depth images and no intrinsics: an array K (3 × 3) in it, or --intrinsics FILE.json";
            return refuse(&main.file, text);
        }
        let (path, i) = folder::intrinsics(place, o)?;
        if let Some(s) = i.size.filter(|s| *s != size) {
            let text = format!("is for {} × {} pixels, the images are {} × {}", s[0], s[1], size[0], size[1]);
            return refuse(&path, text);
        }
        check_center(&path, "cx", &i.optics, Some(size))?;
        capture.facts.push(format!("intrinsics from {}", path.display()));
        return Ok(made(i.optics, i.scale));
    };
    let k = f.array.reals();
    let [fx, fy, cx, cy] = match k[..] {
        [fx, fy, cx, cy] => [fx, fy, cx, cy],
        [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0] => [fx, fy, cx, cy],
        _ => {
            let text = format!(
                "array \"{}\" is {k:?}, expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] or [fx, fy, cx, cy]",
                f.array.name
            );
            return refuse(&f.file, text);
        }
    };
    if !(fx > 0.0 && fy > 0.0 && [fx, fy, cx, cy].iter().all(|x| x.is_finite())) {
        return refuse(
            &f.file,
            format!("array \"{}\": {fx}, {fy}, {cx}, {cy} are no focal lengths > 0 and a centre", f.array.name),
        );
    }
    let lens = match lens {
        None => Lens::Brown([0.0; 5]),
        Some(l) => lens_of("", &l.array.reals()).or_else(|e| refuse(&l.file, format!("array \"{}\": {e}", l.array.name)))?,
    };
    let optics = Optics { focal: [fx, fy], center: [cx, cy], lens };
    check_center(&f.file, &f.array.name, &optics, Some(size))?;
    Ok(made(optics, None))
}
