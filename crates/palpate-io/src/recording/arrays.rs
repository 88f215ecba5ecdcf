//! Recordings made of arrays in memory, with the checks that files go through. Keys in messages are those of the file format.

use super::sequence::{check_times, check_vectors};
use super::{
    DepthImage, DepthPixels, MarkerSample, RecordedCamera, RecordedDisplacements, RecordedFrame, RecordedMarkers, RecordedPoints,
    Recording, Sequence, image, noise_range,
};
use crate::error::{InputError, number};
use crate::rigid::rigid;
use glam::DVec3;
use palpate_model::observation::MarkerRest;
use std::path::PathBuf;

/// What stands for a file's name in messages.
const NAME: &str = "<arrays>";

/// Errors of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Standard deviation of one coordinate or depth [m]; `None` where it is not known, and a usual one is assumed.
    pub sigma: Option<f64>,
    /// Size of errors that do not average out [m].
    pub systematic: f64,
}

/// N things seen at T times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tracks {
    /// Rising times on the recording's clock [s] `[T]`.
    pub times: Vec<f64>,
    /// World vectors [m] `[T, N]`, time by time; NaN where a thing was not seen.
    pub vectors: Vec<DVec3>,
    /// Their errors.
    pub noise: Noise,
}

/// Depth images of one camera.
#[derive(Clone, Debug)]
pub struct DepthStack {
    /// The camera; its pose is taken from `pose`.
    pub camera: RecordedCamera,
    /// World from camera, row by row; checked to be rigid.
    pub pose: [[f64; 4]; 4],
    /// Rising times on the recording's clock [s] `[F]`.
    pub times: Vec<f64>,
    /// Counts of the camera's `depth_scale`, or metres `[F, height, width]`.
    pub pixels: DepthPixels,
    /// True where the object is `[F, height, width]`; `None` = every pixel may be the object.
    pub masks: Option<Vec<bool>>,
}

/// An error about a key.
fn wrong(key: &str, message: impl Into<String>) -> InputError {
    InputError { key: key.into(), ..InputError::file(NAME, message) }
}

impl Noise {
    fn check(self, table: &str) -> Result<Noise, InputError> {
        for (key, value) in [("noise_sigma", self.sigma), ("noise_systematic", Some(self.systematic))] {
            let (range, allowed) = noise_range(key);
            if let Some(x) = value.filter(|x| !range.contains(x)) {
                return Err(wrong(&format!("{table}.{key}"), format!("{} {allowed}", number(x))));
            }
        }
        Ok(self)
    }
}

impl Tracks {
    /// The tracks as a recording holds them; `table` is that of the file format.
    fn sequence(self, table: &str, count: usize) -> Result<Sequence, InputError> {
        let key = |name: &str| format!("{table}.{name}");
        if count == 0 || self.times.is_empty() {
            return Err(wrong(table, "holds nothing: no times, or no points"));
        }
        if !self.vectors.len().is_multiple_of(count) {
            return Err(wrong(table, format!("{} vectors are no whole number of frames of {count}", self.vectors.len())));
        }
        check_times(&self.times, self.vectors.len() / count).map_err(|e| wrong(&key("times"), e))?;
        check_vectors(self.vectors.iter().copied()).map_err(|e| wrong(table, e))?;
        if self.vectors.iter().all(|v| v.is_nan()) {
            return Err(wrong(table, "holds not a single reading: all is NaN"));
        }
        let noise = self.noise.check(table)?;
        Ok(Sequence {
            file: PathBuf::from(NAME),
            times: self.times,
            vectors: self.vectors,
            noise_sigma: noise.sigma,
            noise_systematic: noise.systematic,
        })
    }
}

/// Places that must be known.
fn places(key: &str, rest: &[DVec3]) -> Result<(), InputError> {
    match rest.iter().filter(|p| !p.is_finite()).count() {
        0 => Ok(()),
        n => Err(wrong(key, format!("{n} of {} places are not finite", rest.len()))),
    }
}

impl Recording {
    /// A recording that holds nothing yet.
    pub fn empty(title: &str, source: &str) -> Recording {
        Recording {
            path: PathBuf::from(NAME),
            title: title.into(),
            source: source.into(),
            cameras: Vec::new(),
            frames: Vec::new(),
            markers: None,
            points: None,
            displacements: None,
            clouds: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// The recording with tracked points, which lie at `rest` [m] `[N]` on the body at rest, at most `tolerance` [m] from its surface.
    ///
    /// # Errors
    /// What a file with the same arrays would be refused for.
    pub fn with_points(self, tracks: Tracks, rest: Vec<DVec3>, tolerance: Option<f64>) -> Result<Recording, InputError> {
        let track = tracks.sequence("points", rest.len())?;
        places("points.rest", &rest)?;
        if let Some(t) = tolerance.filter(|t| t.is_nan() || *t <= 0.0) {
            return Err(wrong("points.tolerance", format!("{} is not allowed: must be > 0 (m)", number(t))));
        }
        Ok(Recording { points: Some(RecordedPoints { track, rest, tolerance }), ..self })
    }

    /// The recording with displacements of `nodes` simulation nodes, or of as many as lie at `rest` [m] `[N]`.
    ///
    /// # Errors
    /// As [`Recording::with_points`].
    pub fn with_displacements(self, tracks: Tracks, nodes: usize, rest: Vec<DVec3>) -> Result<Recording, InputError> {
        let track = tracks.sequence("displacements", nodes)?;
        if !rest.is_empty() {
            places("displacements.nodes", &rest)?;
            if rest.len() != nodes {
                return Err(wrong("displacements.nodes", format!("holds {} places for {nodes} nodes", rest.len())));
            }
        }
        Ok(Recording { displacements: Some(RecordedDisplacements { track, nodes: rest }), ..self })
    }

    /// The recording with markers, one for each of `rest`.
    ///
    /// # Errors
    /// As [`Recording::with_points`].
    pub fn with_markers(self, tracks: Tracks, rest: Vec<MarkerRest>) -> Result<Recording, InputError> {
        let s = tracks.sequence("markers", rest.len())?;
        let names: Vec<String> = rest.iter().map(|r| r.name.clone()).collect();
        if let Some(twice) = (1..names.len()).find(|k| names[..*k].contains(&names[*k])) {
            return Err(wrong("markers.rest.name", format!("\"{}\" is given twice", names[twice])));
        }
        places("markers.rest.position", &rest.iter().map(|r| r.position).collect::<Vec<_>>())?;
        places("markers.rest.surface", &rest.iter().filter_map(|r| r.surface).collect::<Vec<_>>())?;
        let at = |k: usize| s.seen(k).map(move |(marker, position)| (k, marker, position));
        let samples = (0..s.times.len()).flat_map(at);
        let samples = samples.map(|(k, marker, position)| MarkerSample { time: s.times[k], marker, position }).collect();
        let (noise_sigma, noise_systematic) = (s.noise_sigma, s.noise_systematic);
        let markers = RecordedMarkers { file: PathBuf::from(NAME), names, samples, noise_sigma, noise_systematic, rest };
        Ok(Recording { markers: Some(markers), ..self })
    }

    /// The recording with the images of one more depth camera.
    ///
    /// # Errors
    /// As [`Recording::with_points`].
    pub fn with_depth(mut self, stack: DepthStack) -> Result<Recording, InputError> {
        let DepthStack { camera, pose, times, pixels, masks } = stack;
        let name = format!("camera \"{}\"", camera.name);
        let camera =
            RecordedCamera { world_from_camera: rigid(pose).map_err(|e| wrong("camera.world_from_camera", e))?, ..camera };
        if self.cameras.iter().any(|c| c.name == camera.name) {
            return Err(wrong("camera.name", format!("two cameras are named \"{}\"", camera.name)));
        }
        for (key, focal) in ["camera.fx", "camera.fy"].iter().zip(camera.focal) {
            if !(focal.is_finite() && focal > 0.0) {
                return Err(wrong(key, format!("{} is not allowed: must be > 0 (pixels)", number(focal))));
            }
        }
        let others = camera.center.iter().chain(&camera.distortion).chain([&camera.depth_offset]);
        if others.chain(&camera.depth_scale).any(|x| !x.is_finite()) || camera.depth_scale.is_some_and(|s| s <= 0.0) {
            return Err(wrong("camera", format!("{name}: a number is not finite, or depth_scale is not > 0 (m per count)")));
        }
        Noise { sigma: camera.noise_sigma, systematic: camera.noise_systematic }.check("camera")?;
        if let Some(message) = camera.folded() {
            return Err(wrong("camera.distortion", message));
        }
        let (width, height) = (camera.width, camera.height);
        let size = width * height;
        let count = pixels.count();
        if size == 0 || !count.is_multiple_of(size) || masks.as_ref().is_some_and(|m| m.len() != count) {
            return Err(wrong("frame.depth", format!("{name}: depths or masks are no images of {width} × {height} pixels")));
        }
        check_times(&times, count / size).map_err(|e| wrong("frame.time", e))?;
        if camera.depth_scale.is_none() && matches!(pixels, DepthPixels::Counts(_)) {
            return Err(wrong("camera.depth_scale", format!("{name}: is missing: metres per count (0.001 for millimetres)")));
        }
        let number = self.cameras.len();
        let mask = |k: usize| masks.as_ref().map(|m| m[k * size..(k + 1) * size].to_vec());
        let frames: Vec<RecordedFrame> = (times.iter().enumerate())
            .map(|(k, time)| RecordedFrame {
                camera: number,
                time: *time,
                depth: Some(DepthImage { width, height, pixels: pixels.slice(k * size..(k + 1) * size) }),
                mask: mask(k),
            })
            .collect();
        image::median_depth(&camera, frames.iter()).map_err(|(key, text)| wrong(&format!("camera.{key}"), text))?;
        if frames.iter().all(|f| f.readings().next().is_none()) {
            return Err(wrong("frame.depth", format!("{name}: no image holds a reading of the object")));
        }
        self.cameras.push(camera);
        self.frames.extend(frames);
        self.frames.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(self)
    }
}

#[cfg(test)]
#[path = "arrays_tests.rs"]
mod tests;
