//! Units, lenses and poses: depth images of any kind become those of a recording, in metres.

use crate::Watch;
use crate::capture::{Capture, DepthCamera, Guess, Pixels};
use crate::error::{ImportError, refuse, refuse_option};
use crate::lens::Straightened;
use crate::options::Options;
use glam::DAffine3;
use palpate_io::Recording;
use palpate_io::lens::Lens;
use palpate_io::recording::{DepthImage, DepthPixels, RecordedCamera, RecordedFrame};
use rayon::prelude::*;

/// Noise of a depth reading where nothing says it [m]: that of common depth cameras at half a metre.
pub const DEPTH_NOISE: f64 = 0.002;

/// Medians of depth outside of this are another unit [m], as for recordings.
const RANGE: std::ops::RangeInclusive<f64> = 0.02..=20.0;

/// No camera sees this far in the middle: longer floats are millimetres.
const FLOAT_METRES: f64 = 50.0;

/// What is said about an import on the way.
#[derive(Clone, Debug, Default)]
pub struct Said {
    /// Assumptions.
    pub guesses: Vec<Guess>,
    /// What is known.
    pub facts: Vec<String>,
    /// What is lost.
    pub losses: Vec<String>,
}

/// The depth images of a capture in metres, as a recording without markers.
pub fn depth(capture: &mut Capture, o: &Options, said: &mut Said, watch: &mut Watch) -> Result<Recording, ImportError> {
    let mut r = Recording {
        path: Default::default(),
        title: capture.title.clone(),
        source: String::new(),
        cameras: Vec::new(),
        frames: Vec::new(),
        clouds: Vec::new(),
        markers: None,
        points: None,
        displacements: None,
        warnings: Vec::new(),
    };
    for camera in std::mem::take(&mut capture.cameras) {
        add(camera, o, said, &mut r, watch)?;
    }
    r.frames.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(r)
}

/// The middle of some numbers; `None` of none.
pub fn median(mut all: Vec<f64>) -> Option<f64> {
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Every so-maniest reading of a camera, in its unit: enough for a median.
fn sample(camera: &DepthCamera) -> Vec<f64> {
    let every = (camera.frames.iter().map(|f| f.pixels.count()).sum::<usize>() / 200_000).max(1);
    let mut all = Vec::new();
    let mut k = 0;
    for f in &camera.frames {
        let mut push = |x: f64| {
            if x > 0.0 && x.is_finite() {
                k += 1;
                if k % every == 0 {
                    all.push(x);
                }
            }
        };
        match &f.pixels {
            Pixels::Counts(c) => c.iter().for_each(|x| push(f64::from(*x))),
            Pixels::Lengths(l) => l.iter().for_each(|x| push(f64::from(*x))),
        }
    }
    all
}

/// Metres of a number of the images, and the guess where it is one.
fn metres(camera: &DepthCamera, key: &str, o: &Options, said: &mut Said) -> Result<f64, ImportError> {
    let file = &camera.frames[0].file;
    let Some(median) = median(sample(camera)) else {
        return refuse(file, format!("holds no reading, and neither do the other images of camera \"{}\"", camera.name));
    };
    let counts = matches!(camera.frames[0].pixels, Pixels::Counts(_));
    let key = format!("{key}.depth_scale");
    let asked = o.depth_scale.map(|s| ("depth-scale", s)).or(o.unit.map(|u| ("unit", u.metres()))).filter(|_| !camera.made);
    let scale = match (asked, counts, camera.scale) {
        (Some((option, s)), _, stated) => {
            if !(s > 0.0 && s <= 1.0) {
                return refuse_option(option, s, "must be > 0 and at most 1 (m per count)");
            }
            if let Some(stated) = stated.filter(|x| counts && (x - s).abs() > 1e-6 * s) {
                said.facts.push(format!("--{option} says {s} m a count, the source {stated}; the option is followed"));
            }
            s
        }
        (None, true, Some(stated)) if camera.made => stated,
        (None, true, Some(stated)) => {
            said.facts.push(format!("{stated} m a count, as the source says"));
            stated
        }
        (None, true, None) => {
            let (usual, why) = camera.usual_scale;
            let text = format!("{usual} m a count, {why}; the median depth is then {:.3} m", usual * median);
            said.guesses.push(Guess::recording("unit", key, text, "--depth-scale"));
            usual
        }
        (None, false, Some(1.0)) => {
            said.facts.push("floats in metres, as the source says".into());
            1.0
        }
        // Any other scale is that of counts, which the camera could have written as well.
        (None, false, _) => {
            let (scale, unit) = if median > FLOAT_METRES { (0.001, "millimetres") } else { (1.0, "metres") };
            let text = format!("floats are {unit}, since their median is {median:.4}");
            said.guesses.push(Guess::recording("unit", key, text, "--unit"));
            scale
        }
    };
    if !RANGE.contains(&(median * scale)) {
        let hint = [0.001, 0.0001, 0.00025, 0.0002, 1.0].iter().find(|s| (0.1..=10.0).contains(&(median * **s)));
        let hint = hint.map_or(String::new(), |s| format!("; --depth-scale {s} would make it {:.3} m", median * s));
        let text = format!(
            "the median depth of camera \"{}\" is {} m at {scale} m a count, expected {} to {} m{hint}",
            camera.name,
            median * scale,
            RANGE.start(),
            RANGE.end()
        );
        return refuse(file, text);
    }
    Ok(scale)
}

/// Poses of a camera's images: one where it stood still.
fn poses(camera: &DepthCamera, key: &str, o: &Options, said: &mut Said) -> Vec<DAffine3> {
    if let Some(p) = o.camera_pose.filter(|_| !camera.made) {
        return vec![p];
    }
    let Some(first) = camera.poses.first() else {
        let text = "the world's axes are the camera's: x right, y down, z forward";
        said.guesses.push(Guess::recording("pose", format!("{key}.world_from_camera"), text, "--camera-pose"));
        return vec![DAffine3::IDENTITY];
    };
    // Closer than a depth reading is exact: a millimetre, and a milliradian at arm's length.
    let near = |p: &DAffine3| {
        let turn = glam::DQuat::from_mat3(&(first.matrix3.transpose() * p.matrix3));
        (p.translation - first.translation).length() < 1e-3 && 2.0 * turn.xyz().length() < 1e-3
    };
    if camera.poses.iter().all(near) { vec![*first] } else { camera.poses.clone() }
}

fn add(camera: DepthCamera, o: &Options, said: &mut Said, r: &mut Recording, watch: &mut Watch) -> Result<(), ImportError> {
    if camera.frames.is_empty() {
        return Ok(());
    }
    let key = format!("camera.{}", r.cameras.len());
    let metres = metres(&camera, &key, o, said)?;
    let poses = poses(&camera, &key, o, said);
    let lens = camera.optics.lens.as_recorded();
    let straight = lens.is_none().then(|| Straightened::new(&camera.optics, camera.size));
    // Floats stay floats, and counts that pass through no lens stay as they are.
    let floats = matches!(camera.frames[0].pixels, Pixels::Lengths(_));
    let keep = floats || straight.is_none();
    let scale = if keep { metres } else { count_for(&camera, metres) };
    if let Some(s) = &straight {
        said.losses.push(format!(
            "camera \"{}\": its lens is none that a recording knows; images are straightened, depth between pixels is interpolated, and {:.1} % \
             of the picture lies beyond the straight one's edge",
            camera.name,
            100.0 * s.lost
        ));
    }
    if !keep {
        said.losses.push(format!("camera \"{}\": depth is rounded to {scale} m, the count of its 16-bit images", camera.name));
    }
    let [width, height] = camera.size;
    let noise = o.noise.unwrap_or(DEPTH_NOISE);
    if o.noise.is_none() {
        let text = format!("{DEPTH_NOISE} m a reading, that of common depth cameras at half a metre");
        said.guesses.push(Guess::recording("noise", format!("{key}.noise_sigma"), text, "--noise"));
    }
    let first = r.cameras.len();
    for (i, pose) in poses.iter().enumerate() {
        r.cameras.push(RecordedCamera {
            name: if poses.len() == 1 { camera.name.clone() } else { format!("{}-{i}", camera.name) },
            width,
            height,
            focal: camera.optics.focal,
            center: camera.optics.center,
            distortion: lens.unwrap_or([0.0; 8]),
            world_from_camera: *pose,
            depth_scale: (!floats).then_some(scale),
            depth_offset: 0.0,
            noise_sigma: Some(noise),
            noise_systematic: 0.0,
        });
    }
    if poses.len() > 1 {
        said.facts.push(format!("the camera moves: each of its {} images is a camera of its own", poses.len()));
    }
    if let Some(message) = r.cameras[first].folded() {
        return refuse(&camera.frames[0].file, format!("its camera's distortion {message}"));
    }
    let blind = blind(&r.cameras[first]);
    let mut unseen = 0;
    for (part, frames) in camera.frames.chunks(32).enumerate() {
        watch.at(part * 32, camera.frames.len(), "units and lenses")?;
        let done: Vec<(RecordedFrame, usize)> = frames
            .par_iter()
            .enumerate()
            .map(|(k, f)| {
                let number = if poses.len() == 1 { first } else { first + part * 32 + k };
                let at = |i: usize| match &f.pixels {
                    Pixels::Counts(c) => f32::from(c[i]),
                    Pixels::Lengths(l) => l[i],
                };
                let in_metres = |x: f32| (f64::from(x) * metres) as f32;
                let mut pixels = match (&f.pixels, &straight) {
                    (Pixels::Counts(c), None) if !floats => DepthPixels::Counts(c.clone()),
                    (p, None) => DepthPixels::Metres((0..p.count()).map(|i| in_metres(at(i))).collect()),
                    (_, Some(s)) if floats => DepthPixels::Metres(s.depth(at).into_iter().map(in_metres).collect()),
                    (_, Some(s)) => {
                        DepthPixels::Counts(s.depth(at).into_iter().map(|x| count(f64::from(x) * metres, scale)).collect())
                    }
                };
                let read: Vec<usize> = blind.iter().copied().filter(|i| pixels.reading(*i).is_some()).collect();
                read.iter().for_each(|i| pixels.clear(*i));
                let mask = f.mask.as_ref().map(|m| straight.as_ref().map_or_else(|| m.clone(), |s| s.mask(m)));
                (
                    RecordedFrame { camera: number, time: f.time, depth: Some(DepthImage { width, height, pixels }), mask },
                    read.len(),
                )
            })
            .collect();
        for (frame, read) in done {
            r.frames.push(frame);
            unseen += read;
        }
    }
    if unseen > 0 {
        said.losses.push(format!(
            "camera \"{}\": {unseen} readings lie at pixels for which its lens has no ray, and are left out",
            camera.name
        ));
    }
    Ok(())
}

/// Pixels of a rational lens that no ray falls on: the corners of wide images.
fn blind(camera: &RecordedCamera) -> Vec<usize> {
    let [w, h] = [camera.width, camera.height];
    match camera.lens() {
        Lens::Rational(_) => (0..w * h).filter(|i| camera.ray((i % w) as f64, (i / w) as f64).is_none()).collect(),
        _ => Vec::new(),
    }
}

/// Metres of a count that hold the farthest reading: tenths of a millimetre up to 6.5 m, millimetres beyond.
fn count_for(camera: &DepthCamera, metres: f64) -> f64 {
    let farthest = |p: &Pixels| match p {
        Pixels::Counts(c) => f64::from(c.iter().copied().max().unwrap_or(0)),
        Pixels::Lengths(l) => f64::from(l.iter().copied().filter(|x| x.is_finite()).fold(0.0, f32::max)),
    };
    let far = camera.frames.iter().map(|f| farthest(&f.pixels)).fold(0.0, f64::max) * metres;
    if far <= 6.5535 { 1e-4 } else { 1e-3 }
}

/// A depth [m] in counts; 0 where there is none, or one beyond the last count.
fn count(depth: f64, scale: f64) -> u16 {
    let n = (depth / scale).round();
    if n >= 1.0 && n <= f64::from(u16::MAX) { n as u16 } else { 0 }
}
