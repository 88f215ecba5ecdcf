//! Depth images and masks: PNG files to counts and flags.

use super::{RecordedCamera, RecordedFrame};
use crate::document::Table;
use crate::error::{InputError, number};
use image::{DynamicImage, ImageError, ImageFormat, ImageReader};
use std::io::{Cursor, ErrorKind};
use std::path::Path;

/// A depth image in counts of the camera's `depth_scale`; 0 = no reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DepthImage {
    /// Pixels per row.
    pub width: usize,
    /// Pixels per column.
    pub height: usize,
    /// Row by row, shape `[height · width]`.
    pub counts: Vec<u16>,
}

fn decode(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<DynamicImage, InputError> {
    let broken = |e: ImageError| {
        let cut = matches!(&e, ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof);
        let why = if cut { " (truncated?)" } else { "" };
        InputError::file(path, format!("not a readable PNG file{why}: {e}"))
    };
    // The size stands in the header: nothing is made room for before it is right.
    let header = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png).into_dimensions().map_err(broken)?;
    let found = (header.0 as usize, header.1 as usize);
    if found != size {
        let text = format!("is {} × {} pixels, its camera has {} × {}", found.0, found.1, size.0, size.1);
        return Err(InputError::file(path, text));
    }
    image::load_from_memory_with_format(bytes, ImageFormat::Png).map_err(broken)
}

/// A 16-bit greyscale PNG of a camera's size (width, height).
pub(super) fn depth(path: &Path, bytes: &[u8], size: (usize, usize)) -> Result<DepthImage, InputError> {
    match decode(path, bytes, size)? {
        DynamicImage::ImageLuma16(i) => Ok(DepthImage { width: size.0, height: size.1, counts: i.into_raw() }),
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
    let mut counts: Vec<u16> = frames.flat_map(|f| f.readings().map(|r| r.2)).collect();
    if counts.is_empty() {
        return Ok(());
    }
    let middle = counts.len() / 2;
    let median = *counts.select_nth_unstable(middle).1;
    let depth = camera.depth(median);
    if (NEAREST..=FARTHEST).contains(&depth) {
        return Ok(());
    }
    // Counts that are right by themselves are spoiled by what is added.
    let plain = depth - camera.depth_offset;
    if (NEAREST..=FARTHEST).contains(&plain) {
        let text = format!(
            "adds {} m to the readings of camera \"{}\", whose median depth is then {depth:.6} m instead of {plain:.6} m; expected \
             {NEAREST} to {FARTHEST} m",
            number(camera.depth_offset),
            camera.name
        );
        return Err(("depth_offset", text));
    }
    let fits = |s: &&f64| (0.1..=10.0).contains(&(f64::from(median) * **s + camera.depth_offset));
    let hint = match [0.001, 0.0001, 0.00025, 0.01, 0.00001].iter().find(fits) {
        Some(s) => format!("; depth_scale = {s} would make it {:.3} m", f64::from(median) * s + camera.depth_offset),
        None => String::new(),
    };
    let text = format!(
        "the median depth of camera \"{}\" is {depth:.6} m ({median} counts), expected {NEAREST} to {FARTHEST} m{hint}",
        camera.name
    );
    Err(("depth_scale", text))
}
