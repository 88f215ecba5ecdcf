//! Format `recording/1`: a folder of depth images, masks, clouds, markers and arrays ↔ [`Recording`].

mod arrays;
mod c3d;
mod camera;
mod clouds;
mod image;
mod markers;
mod observation;
mod overlap;
pub(crate) mod sequence;
#[cfg(test)]
mod surface_tests;
#[cfg(test)]
mod tests;
mod write;

pub use arrays::{DepthStack, Noise, Tracks};
pub use camera::RecordedCamera;
pub use clouds::{RecordedCloud, SeenFrom};
pub use image::{DepthImage, DepthPixels, RawDepth};
pub use markers::{MarkerSample, RecordedMarkers};
pub use observation::ObservationError;
pub use overlap::check_overlap;
pub use sequence::{RecordedDisplacements, RecordedPoints, Sequence};
pub use write::write_recording;

use crate::document::{Source, Table};
use crate::error::{InputError, Loaded};
use crate::input::read_bytes;
use crate::keys::{RECORDING, suggest};
use crate::room::{self, gigabytes};
use crate::scene::{check_format, marker_rest};
use palpate_model::observation::{MarkerRest, ReadingKind};
use rayon::prelude::*;
use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};

/// The recording format this version reads and writes.
pub const FORMAT: &str = "recording/1";

/// Everything measured of one object; SI units, checked.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The TOML file.
    pub path: PathBuf,
    /// Free text.
    pub title: String,
    /// Where the data come from, licence.
    pub source: String,
    /// Cameras.
    pub cameras: Vec<RecordedCamera>,
    /// Images, ordered by time.
    pub frames: Vec<RecordedFrame>,
    /// Point clouds, ordered by time.
    pub clouds: Vec<RecordedCloud>,
    /// Markers.
    pub markers: Option<RecordedMarkers>,
    /// Tracked points of the body.
    pub points: Option<RecordedPoints>,
    /// Displacements of the simulation's nodes.
    pub displacements: Option<RecordedDisplacements>,
    /// What looks suspicious without being wrong.
    pub warnings: Vec<String>,
}

/// What one camera saw at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedFrame {
    /// Number of the camera in [`Recording::cameras`].
    pub camera: usize,
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Depth image; absent in a silhouette.
    pub depth: Option<DepthImage>,
    /// True where the object is, row by row, shape `[height · width]`; absent = every pixel may be the object.
    pub mask: Option<Vec<bool>>,
}

/// Reads a recording: its folder (then `recording.toml` in it) or a TOML file of the format.
///
/// # Errors
/// The first thing that is wrong, naming file, line and key; see the format's description for what is allowed.
pub fn read_recording(path: impl AsRef<Path>) -> Result<Recording, InputError> {
    read(path.as_ref())
}

fn read(path: &Path) -> Result<Recording, InputError> {
    let file = if path.is_dir() { path.join("recording.toml") } else { path.to_path_buf() };
    let source = Source::read(&file)?;
    let root = source.root();
    check_format(&root, FORMAT)?;
    root.check_keys(&RECORDING)?;
    if let Some(units) = root.optional_str("units")?
        && units.split(',').map(str::trim).ne(["m", "s"])
    {
        return Err(root.error("units", format!("\"{units}\" is not understood; a recording is in \"m, s\"")));
    }
    let mut warnings = Vec::new();
    let cameras = camera::cameras(&root)?;
    let frames = frames(&source, &root, &cameras, &mut warnings)?;
    let clouds = clouds::clouds(&source, &root, &cameras, &mut warnings)?;
    let markers = markers(&source, &root, &mut warnings)?;
    let points = sequence::points(&source, &root)?;
    let displacements = sequence::displacements(&source, &root)?;
    if frames.is_empty() && clouds.is_empty() && markers.is_none() && points.is_none() && displacements.is_none() {
        let text = "holds neither a [[frame]] nor [[cloud]], [markers], [points] or [displacements]: nothing was measured";
        return Err(root.own_error(text));
    }
    image::check_depth_unit(&root, &cameras, &frames)?;
    Ok(Recording {
        title: root.optional_str("title")?.unwrap_or_default().to_string(),
        source: root.optional_str("source")?.unwrap_or_default().to_string(),
        path: source.path.clone(),
        cameras,
        frames,
        clouds,
        markers,
        points,
        displacements,
        warnings,
    })
}

/// The tracked points of a recording alone, in world coordinates; its images are not read.
///
/// # Errors
/// As [`read_recording`].
pub(crate) fn read_points(file: &Path) -> Result<Option<RecordedPoints>, InputError> {
    let source = Source::read(file)?;
    sequence::points(&source, &source.root())
}

/// Times at which a recording has readings of markers, tracked points or displacements [s], rising; of the first of these kinds that it is asked
/// for and has.
///
/// # Errors
/// As [`read_recording`].
pub(crate) fn read_times(file: &Path, kinds: &[ReadingKind]) -> Result<Option<Vec<f64>>, InputError> {
    let source = Source::read(file)?;
    let root = source.root();
    for kind in kinds {
        let times = match kind {
            ReadingKind::Depth => None,
            ReadingKind::Track => sequence::points(&source, &root)?.map(|p| p.track.times),
            ReadingKind::Displacement => sequence::displacements(&source, &root)?.map(|d| d.track.times),
            ReadingKind::Marker => markers(&source, &root, &mut Vec::new())?.map(|m| {
                let mut times: Vec<f64> = m.samples.iter().map(|s| s.time).collect();
                times.dedup();
                times
            }),
        };
        if times.is_some() {
            return Ok(times);
        }
    }
    Ok(None)
}

/// The markers of a C3D file, in metres and on the file's own clock, without noise and rest places.
///
/// # Errors
/// The file cannot be read, is damaged, or holds no marker that was seen.
pub fn read_c3d(path: impl AsRef<Path>) -> Result<Loaded<RecordedMarkers>, InputError> {
    let path = path.as_ref();
    let bytes = read_bytes(path)?;
    let mut warnings = Vec::new();
    let (names, samples) = c3d::read_c3d(path, &bytes, &mut warnings)?;
    let file = path.to_path_buf();
    let value = RecordedMarkers { file, names, samples, noise_sigma: None, noise_systematic: 0.0, rest: Vec::new() };
    Ok(Loaded { value, warnings })
}

/// True for a path that leads out of the folder that it starts from. A recording is handed from person to person: what it names lies in its
/// folder. A scene is its author's own, and its paths may lead anywhere but through a recording.
pub(crate) fn leaves(text: &str) -> bool {
    let mut depth = 0i32;
    Path::new(text).components().any(|c| {
        match c {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => depth = i32::MIN / 2,
        }
        depth < 0
    })
}

/// A file that is there; its path must stay inside the recording's folder.
fn inside(source: &Source, t: &Table, key: &str) -> Result<Option<PathBuf>, InputError> {
    t.optional_str(key)?.map(|text| inside_text(source, t, key, text)).transpose()
}

/// The same for a path that is part of a key's value.
fn inside_text(source: &Source, t: &Table, key: &str, text: &str) -> Result<PathBuf, InputError> {
    if leaves(text) {
        return Err(t.error(key, format!("\"{text}\" leaves the recording's folder; paths are relative to it and stay inside")));
    }
    let path = source.folder().join(text);
    // A link may lead out of the folder where the text does not.
    if let (Ok(real), Ok(folder)) = (path.canonicalize(), source.folder().canonicalize())
        && !real.starts_with(&folder)
    {
        return Err(t.error(key, format!("\"{text}\" is a link out of the recording's folder")));
    }
    if !path.exists() {
        return Err(t.error(key, format!("there is no file {}", path.display())));
    }
    Ok(path)
}

/// A frame's table, before its images are loaded.
struct Header<'a> {
    table: Table<'a>,
    camera: usize,
    time: f64,
    depth: Option<PathBuf>,
    mask: Option<PathBuf>,
}

fn frames(
    source: &Source,
    root: &Table,
    cameras: &[RecordedCamera],
    warnings: &mut Vec<String>,
) -> Result<Vec<RecordedFrame>, InputError> {
    let tables = root.tables("frame")?;
    if !tables.is_empty() && cameras.is_empty() {
        return Err(root.error("frame", format!("{} frames but no [[camera]]; every frame needs one", tables.len())));
    }
    let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
    let mut headers: Vec<Header> = Vec::new();
    for table in tables {
        let name = table.optional_str("camera")?.ok_or_else(|| table.missing("camera", "the name of a camera"))?;
        let camera = (names.iter().position(|n| *n == name))
            .ok_or_else(|| table.error("camera", format!("no [[camera]] is named \"{name}\"; {}", suggest(name, &names))))?;
        let time = table.optional_f64("time")?.ok_or_else(|| table.missing("time", "a number (s)"))?;
        if let Some(before) = headers.last().filter(|b| b.time > time) {
            return Err(
                table.error("time", format!("{time} comes after {} in the file; frames are ordered by time", before.time))
            );
        }
        if headers.iter().rev().take_while(|b| b.time == time).any(|b| b.camera == camera) {
            return Err(table.error("time", format!("camera \"{name}\" has two frames at {time}")));
        }
        let (depth, mask) = (inside(source, &table, "depth")?, inside(source, &table, "mask")?);
        if depth.is_none() && mask.is_none() {
            return Err(table.missing("depth", "a depth image, a mask, or both"));
        }
        headers.push(Header { table, camera, time, depth, mask });
    }
    // A count has two bytes at least, a flag of a mask one.
    let bytes = |h: &Header| {
        let pixels = cameras[h.camera].width as u64 * cameras[h.camera].height as u64;
        pixels * (2 * u64::from(h.depth.is_some()) + u64::from(h.mask.is_some()))
    };
    let all = headers.iter().map(bytes).fold(0, u64::saturating_add);
    if let Some(room) = room::available().filter(|r| r.bytes < all) {
        return Err(root.error("frame", format!("{} frames take {} at least, and {room}", headers.len(), gigabytes(all))));
    }
    // Files are read and decoded side by side; what is wrong is still reported in the order of the file.
    type Images = (Option<Result<DepthImage, InputError>>, Option<Result<Vec<bool>, InputError>>);
    let images: Vec<Images> = (headers.iter().map(|h| (h.camera, h.depth.clone(), h.mask.clone())).collect::<Vec<_>>())
        .into_par_iter()
        .map(|(c, depth, mask)| {
            let size = (cameras[c].width, cameras[c].height);
            (
                depth.map(|p| read_bytes(&p).and_then(|b| image::depth(&p, &b, size))),
                mask.map(|p| read_bytes(&p).and_then(|b| image::mask(&p, &b, size))),
            )
        })
        .collect();
    let (mut frames, mut useless) = (Vec::new(), Vec::new());
    for (h, (depth, mask)) in headers.iter().zip(images) {
        let frame = RecordedFrame { camera: h.camera, time: h.time, depth: depth.transpose()?, mask: mask.transpose()? };
        if frame.mask.as_ref().is_some_and(|m| !m.contains(&true)) {
            let e = h.table.error("mask", "is empty: no pixel is marked as the object (255)");
            return Err(e);
        }
        if frame.depth.is_some() && frame.readings().next().is_none() {
            useless.push(h);
        }
        frames.push(frame);
    }
    if let Some(first) = useless.first() {
        let others = match useless.len() - 1 {
            0 => "the frame is of no use".to_string(),
            n => format!("the frame is of no use, and so are {n} others"),
        };
        warnings.push(first.table.error("depth", format!("holds no reading of the object; {others}")).to_string());
    }
    Ok(frames)
}

impl Recording {
    /// What kinds of readings it holds, in a fixed order.
    pub fn kinds(&self) -> Vec<ReadingKind> {
        let holds = |kind: &ReadingKind| match kind {
            ReadingKind::Depth => !self.clouds.is_empty() || self.frames.iter().any(|f| f.depth.is_some()),
            ReadingKind::Marker => self.markers.is_some(),
            ReadingKind::Track => self.points.is_some(),
            ReadingKind::Displacement => self.displacements.is_some(),
        };
        ReadingKind::ALL.into_iter().filter(holds).collect()
    }
}

impl RecordedFrame {
    /// Pixels (column u, row v) of the object with a reading, and what is read there, row by row.
    pub fn readings(&self) -> impl Iterator<Item = (usize, usize, RawDepth)> + '_ {
        let width = self.depth.as_ref().map_or(1, |d| d.width);
        let count = self.depth.as_ref().map_or(0, |d| d.pixels.count());
        (0..count)
            .filter(|i| self.mask.as_ref().is_none_or(|m| m[*i]))
            .filter_map(move |i| Some((i % width, i / width, self.depth.as_ref()?.pixels.reading(i)?)))
    }
}

fn markers(source: &Source, root: &Table, warnings: &mut Vec<String>) -> Result<Option<RecordedMarkers>, InputError> {
    let Some(t) = root.optional_table("markers")? else { return Ok(None) };
    let file = inside(source, &t, "file")?.ok_or_else(|| t.missing("file", "a .csv or .c3d file"))?;
    let extension = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let bytes = read_bytes(&file)?;
    let (names, samples) = match extension.as_str() {
        "csv" => markers::read_csv(&file, &bytes)?,
        "c3d" => c3d::read_c3d(&file, &bytes, warnings)?,
        _ => return Err(t.error("file", format!("\"{}\" is neither a .csv nor a .c3d file", file.display()))),
    };
    let mut rest: Vec<MarkerRest> = Vec::new();
    for r in t.tables("rest")? {
        let m = marker_rest(&r)?;
        if rest.iter().any(|o| o.name == m.name) {
            return Err(r.error("name", format!("\"{}\" is given twice", m.name)));
        }
        if !names.contains(&m.name) {
            let known: Vec<&str> = names.iter().map(String::as_str).collect();
            let hint = suggest(&m.name, &known);
            return Err(r.error("name", format!("\"{}\" does not occur in {}; {hint}", m.name, file.display())));
        }
        rest.push(m);
    }
    Ok(Some(RecordedMarkers {
        file,
        names,
        samples,
        noise_sigma: noise(&t, "noise_sigma")?,
        noise_systematic: noise(&t, "noise_systematic")?.unwrap_or(0.0),
        rest,
    }))
}

/// What a noise in metres may be, and how that is said. Costs divide by its square: zero would be an infinite weight, and less than a
/// nanometre is no measurement.
fn noise_range(key: &str) -> (RangeInclusive<f64>, &'static str) {
    match key {
        "noise_sigma" => (1e-9..=10.0, "is not allowed: must lie in [1e-9, 10] (m)"),
        _ => (0.0..=10.0, "is not allowed: must lie in [0, 10] (m)"),
    }
}

fn noise(t: &Table, key: &str) -> Result<Option<f64>, InputError> {
    let (range, allowed) = noise_range(key);
    t.f64_where(key, |x| range.contains(&x), allowed)
}
