//! Depth images and masks: files to counts, metres and flags.

use super::{RecordedCamera, RecordedFrame};
use crate::cloud::ending;
use crate::document::Table;
use crate::error::{InputError, number};
use crate::npy::decode_array;
use image::{DynamicImage, ImageError, ImageFormat, ImageReader};
use std::io::{Cursor, ErrorKind};
use std::path::Path;
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult};

/// A depth image.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Pixels per row.
    pub width: usize,
    /// Pixels per column.
    pub height: usize,
    /// Its numbers.
    pub pixels: DepthPixels,
}

/// Numbers of a depth image, row by row, shape `[height · width]`.
#[derive(Clone, Debug)]
pub enum DepthPixels {
    /// Counts of the camera's `depth_scale`; 0 = no reading. Files are 16-bit PNG.
    Counts(Vec<u16>),
    /// Metres; what is not finite or not above 0 is no reading. Files are TIFF or NPY.
    Metres(Vec<f32>),
}

impl PartialEq for DepthPixels {
    /// Pixels that hold no number are equal to each other.
    fn eq(&self, other: &DepthPixels) -> bool {
        let same = |(a, b): (&f32, &f32)| a == b || (a.is_nan() && b.is_nan());
        match (self, other) {
            (DepthPixels::Counts(a), DepthPixels::Counts(b)) => a == b,
            (DepthPixels::Metres(a), DepthPixels::Metres(b)) => a.len() == b.len() && a.iter().zip(b).all(same),
            _ => false,
        }
    }
}

/// A reading as its image has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RawDepth {
    /// A count of the camera's `depth_scale`.
    Count(u16),
    /// A depth [m].
    Metres(f32),
}

impl From<u16> for RawDepth {
    fn from(count: u16) -> RawDepth {
        RawDepth::Count(count)
    }
}

impl DepthPixels {
    /// Number of pixels.
    pub fn count(&self) -> usize {
        match self {
            DepthPixels::Counts(c) => c.len(),
            DepthPixels::Metres(m) => m.len(),
        }
    }

    /// The reading of a pixel, where there is one.
    pub fn reading(&self, pixel: usize) -> Option<RawDepth> {
        match self {
            DepthPixels::Counts(c) => c.get(pixel).filter(|c| **c > 0).map(|c| RawDepth::Count(*c)),
            DepthPixels::Metres(m) => m.get(pixel).filter(|z| **z > 0.0 && z.is_finite()).map(|z| RawDepth::Metres(*z)),
        }
    }

    /// Some of the pixels, in the order that is asked for.
    #[must_use]
    pub fn pick(&self, which: &[usize]) -> DepthPixels {
        match self {
            DepthPixels::Counts(c) => DepthPixels::Counts(which.iter().map(|p| c[*p]).collect()),
            DepthPixels::Metres(m) => DepthPixels::Metres(which.iter().map(|p| m[*p]).collect()),
        }
    }

    /// Pixels that follow each other.
    #[must_use]
    pub fn slice(&self, which: std::ops::Range<usize>) -> DepthPixels {
        match self {
            DepthPixels::Counts(c) => DepthPixels::Counts(c[which].to_vec()),
            DepthPixels::Metres(m) => DepthPixels::Metres(m[which].to_vec()),
        }
    }

    /// Takes the reading of a pixel away.
    pub fn clear(&mut self, pixel: usize) {
        match self {
            DepthPixels::Counts(c) => c[pixel] = 0,
            DepthPixels::Metres(m) => m[pixel] = f32::NAN,
        }
    }
}

/// True for the name of a file whose depths are in metres.
pub(super) fn holds_metres(path: &Path) -> bool {
    ["tif", "tiff", "npy"].contains(&ending(path).as_str())
}

/// A depth image of a camera's size (width, height): a 16-bit greyscale PNG, or floats.
pub(super) fn depth(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<DepthImage, InputError> {
    let pixels = match ending(path).as_str() {
        "npy" => DepthPixels::Metres(array(path, bytes, size)?),
        "tif" | "tiff" => DepthPixels::Metres(tiff(path, bytes, size)?),
        _ => DepthPixels::Counts(counts(path, bytes, size)?),
    };
    Ok(DepthImage { width: size.0, height: size.1, pixels })
}

/// Refuses images that are not of their camera's size.
fn check_size(path: &Path, found: (usize, usize), size: (usize, usize)) -> Result<(), InputError> {
    if found == size {
        return Ok(());
    }
    let text = format!("is {} × {} pixels, its camera has {} × {}", found.0, found.1, size.0, size.1);
    Err(InputError::file(path, text))
}

fn array(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<Vec<f32>, InputError> {
    let found = decode_array(path, bytes)?;
    let [rows, columns] = found.shape[..] else {
        return Err(InputError::file(path, format!("has shape {}, an image has (rows, columns)", found.shape_text())));
    };
    check_size(path, (columns, rows), size)?;
    // No sensor resolves a ten-millionth of its distance.
    Ok(found.values.into_iter().map(|z| z as f32).collect())
}

fn tiff(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<Vec<f32>, InputError> {
    let decoded = (|| {
        let mut decoder = Decoder::new(Cursor::new(bytes))?;
        let (w, h) = decoder.dimensions()?;
        if (w as usize, h as usize) != size {
            return Ok(((w as usize, h as usize), None));
        }
        Ok::<_, TiffError>((size, Some(decoder.read_image()?)))
    })();
    let (found, data) = decoded.map_err(|e| InputError::file(path, format!("not a readable TIFF file (truncated?): {e}")))?;
    check_size(path, found, size)?;
    let pixels = match data {
        Some(DecodingResult::F32(z)) => z,
        Some(DecodingResult::F64(z)) => z.into_iter().map(|z| z as f32).collect(),
        _ => {
            return Err(InputError::file(path, "is no TIFF of 32-bit floats (metres); counts are written as 16-bit PNG"));
        }
    };
    if pixels.len() != size.0 * size.1 {
        return Err(InputError::file(path, "has several channels, a depth image has one"));
    }
    Ok(pixels)
}

fn decode(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<DynamicImage, InputError> {
    let broken = |e: ImageError| {
        let cut = matches!(&e, ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof);
        let why = if cut { " (truncated?)" } else { "" };
        InputError::file(path, format!("not a readable PNG file{why}: {e}"))
    };
    // The size stands in the header: nothing is made room for before it is right.
    let header = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png).into_dimensions().map_err(broken)?;
    check_size(path, (header.0 as usize, header.1 as usize), size)?;
    image::load_from_memory_with_format(bytes, ImageFormat::Png).map_err(broken)
}

fn counts(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<Vec<u16>, InputError> {
    match decode(path, bytes, size)? {
        DynamicImage::ImageLuma16(i) => Ok(i.into_raw()),
        other => {
            let found = other.color();
            let text = format!(
                "has {} bits in {} channels, a depth image is 16-bit greyscale",
                found.bits_per_pixel(),
                found.channel_count()
            );
            Err(InputError::file(path, text))
        }
    }
}

/// An 8-bit greyscale PNG of a camera's size, 255 = the object.
pub(super) fn mask(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<Vec<bool>, InputError> {
    match decode(path, bytes, size)? {
        // Other values come from interpolated masks; half is as good a border as any.
        DynamicImage::ImageLuma8(i) => Ok(i.into_raw().into_iter().map(|x| x >= 128).collect()),
        other => {
            let found = other.color();
            let text =
                format!("has {} bits in {} channels, a mask is 8-bit greyscale", found.bits_per_pixel(), found.channel_count());
            Err(InputError::file(path, text))
        }
    }
}

/// Depths farther than this, or nearer than [`NEAREST`], are counts in another unit [m].
const FARTHEST: f64 = 20.0;

/// No depth camera reads nearer than this [m].
const NEAREST: f64 = 0.02;

/// Refuses cameras whose median depth cannot be in metres.
pub(super) fn check_depth_unit(root: &Table, cameras: &[RecordedCamera], frames: &[RecordedFrame]) -> Result<(), InputError> {
    for (i, (camera, table)) in cameras.iter().zip(root.tables("camera")?).enumerate() {
        let own = frames.iter().filter(|f| f.camera == i);
        median_depth(camera, own).map_err(|(key, text)| table.error(key, text))?;
    }
    Ok(())
}

/// Refuses a camera whose median depth over its frames cannot be in metres: the key that is at fault, and why.
pub(super) fn median_depth<'a>(
    camera: &RecordedCamera,
    frames: impl Iterator<Item = &'a RecordedFrame>,
) -> Result<(), (&'static str, String)> {
    let mut depths: Vec<(f64, RawDepth)> =
        frames.flat_map(|f| f.readings().map(|(_, _, r)| (camera.plain_depth(r), r))).collect();
    if depths.is_empty() {
        return Ok(());
    }
    let middle = depths.len() / 2;
    let (plain, median) = *depths.select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0)).1;
    let depth = plain + camera.depth_offset;
    if (NEAREST..=FARTHEST).contains(&depth) {
        return Ok(());
    }
    // Readings that are right by themselves are spoiled by what is added.
    if (NEAREST..=FARTHEST).contains(&plain) {
        let text = format!(
            "adds {} m to the readings of camera \"{}\", whose median depth is then {depth:.6} m instead of {plain:.6} m; expected \
             {NEAREST} to {FARTHEST} m",
            number(camera.depth_offset),
            camera.name
        );
        return Err(("depth_offset", text));
    }
    let (key, raw, hint) = match median {
        RawDepth::Count(count) => {
            let of = |scale: f64| f64::from(count) * scale + camera.depth_offset;
            let likely = [0.001, 0.0001, 0.00025, 0.01, 0.00001].into_iter().find(|s| (0.1..=10.0).contains(&of(*s)));
            let hint = likely.map_or(String::new(), |s| format!("; depth_scale = {s} would make it {:.3} m", of(s)));
            ("depth_scale", format!("{count} counts"), hint)
        }
        RawDepth::Metres(_) => {
            let millimetres = (0.1..=10.0).contains(&(0.001 * plain));
            let hint = if millimetres { "; are they millimetres? Floats are metres: multiply them by 0.001" } else { "" };
            ("name", "floats, which are metres".to_string(), hint.to_string())
        }
    };
    let text = format!(
        "the median depth of camera \"{}\" is {depth:.6} m ({raw}), expected {NEAREST} to {FARTHEST} m{hint}",
        camera.name
    );
    Err((key, text))
}
