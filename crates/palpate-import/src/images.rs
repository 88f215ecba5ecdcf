//! Files of one depth image each.

use crate::arrays::{Array, Numbers, read_arrays};
use crate::capture::Pixels;
use crate::error::{ImportError, read, refuse};
use crate::place::has_ending;
use image::{DynamicImage, ImageFormat};
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult};

/// Endings of files that may be depth images.
pub const ENDINGS: [&str; 7] = ["png", "tif", "tiff", "npy", "raw", "bin", "exr"];

/// Reads a depth image: its size (columns, rows) and pixels. Raw files have no header: they are of the `size` given.
///
/// # Errors
/// The file is no depth image, or not of that size.
pub fn read_depth(path: &Path, size: Option<[usize; 2]>) -> Result<([usize; 2], Pixels), ImportError> {
    let (found, pixels) = decode(path, size)?;
    if found[0] == 0 || found[1] == 0 || found[0].max(found[1]) > 65536 {
        return refuse(path, format!("is {} × {} pixels; an image has 1 to 65536 a side", found[0], found[1]));
    }
    match size {
        Some(s) if s != found => {
            refuse(path, format!("is {} × {} pixels, the intrinsics are for {} × {}", found[0], found[1], s[0], s[1]))
        }
        _ => Ok((found, pixels)),
    }
}

fn decode(path: &Path, size: Option<[usize; 2]>) -> Result<([usize; 2], Pixels), ImportError> {
    if has_ending(path, &["exr"]) {
        return refuse(path, "OpenEXR is not read; write depth as 16-bit PNG, 32-bit TIFF or .npy");
    }
    if has_ending(path, &["npy"]) {
        let arrays = read_arrays(path)?;
        let [a @ Array { .. }] = &arrays[..] else { return refuse(path, "holds several arrays, an image is one") };
        let [rows, columns] = a.shape[..] else {
            return refuse(path, format!("has shape {}, an image has (rows, columns)", a.shape_text()));
        };
        return Ok(([columns, rows], pixels(path, a.numbers.clone())?));
    }
    let bytes = read(path)?;
    if has_ending(path, &["raw", "bin"]) {
        let Some([w, h]) = size else {
            return refuse(path, "has no header: its size must come from intrinsics with width and height");
        };
        return match bytes.len() {
            n if n == 2 * w * h => {
                let counts = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
                Ok(([w, h], Pixels::Counts(counts)))
            }
            n if n == 4 * w * h => {
                let lengths = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
                Ok(([w, h], Pixels::Lengths(lengths)))
            }
            n => refuse(path, format!("has {n} bytes; {w} × {h} pixels of 16 or 32 bits are {} or {}", 2 * w * h, 4 * w * h)),
        };
    }
    if has_ending(path, &["tif", "tiff"]) { read_tiff(path, &bytes) } else { read_png(path, &bytes) }
}

/// Numbers of an array as pixels.
pub fn pixels(path: &Path, numbers: Numbers) -> Result<Pixels, ImportError> {
    match numbers {
        Numbers::Counts(c) => Ok(Pixels::Counts(c)),
        Numbers::Real(r) => Ok(Pixels::Lengths(r.into_iter().map(|x| x as f32).collect())),
        Numbers::Whole(w) => match w.iter().find(|x| !(0..=65535).contains(*x)) {
            None => Ok(Pixels::Counts(w.into_iter().map(|x| x as u16).collect())),
            Some(x) => refuse(path, format!("holds the count {x}; a depth image has 0 to 65535")),
        },
    }
}

fn read_png(path: &Path, bytes: &[u8]) -> Result<([usize; 2], Pixels), ImportError> {
    let image = match image::load_from_memory_with_format(bytes, ImageFormat::Png) {
        Ok(i) => i,
        Err(e) => return refuse(path, format!("not a readable PNG file (truncated?): {e}")),
    };
    let size = [image.width() as usize, image.height() as usize];
    match image {
        DynamicImage::ImageLuma16(i) => Ok((size, Pixels::Counts(i.into_raw()))),
        other => {
            let c = other.color();
            let text = format!(
                "has {} bits in {} channels: a picture of depth, not depth; export 16-bit greyscale PNG, 32-bit TIFF, .npy or .raw",
                c.bits_per_pixel(),
                c.channel_count()
            );
            refuse(path, text)
        }
    }
}

fn read_tiff(path: &Path, bytes: &[u8]) -> Result<([usize; 2], Pixels), ImportError> {
    let decoded = (|| {
        let mut decoder = Decoder::new(std::io::Cursor::new(bytes))?;
        let (w, h) = decoder.dimensions()?;
        Ok::<_, tiff::TiffError>(([w as usize, h as usize], decoder.read_image()?))
    })();
    let (size, data) = match decoded {
        Ok(d) => d,
        Err(e) => return refuse(path, format!("not a readable TIFF file: {e}")),
    };
    let pixels = match data {
        DecodingResult::U16(c) => Pixels::Counts(c),
        DecodingResult::F32(l) => Pixels::Lengths(l),
        DecodingResult::F64(l) => Pixels::Lengths(l.into_iter().map(|x| x as f32).collect()),
        _ => return refuse(path, "is no TIFF of 16-bit whole numbers or 32-bit floats"),
    };
    if pixels.count() != size[0] * size[1] {
        return refuse(path, "has several channels: a picture of depth, not depth");
    }
    Ok((size, pixels))
}

/// Reads a mask: an 8-bit PNG, half and more = the object.
///
/// # Errors
/// The file is no greyscale PNG of this size.
pub fn read_mask(path: &Path, size: [usize; 2]) -> Result<Vec<bool>, ImportError> {
    let image = match image::load_from_memory_with_format(&read(path)?, ImageFormat::Png) {
        Ok(i) => i,
        Err(e) => return refuse(path, format!("not a readable PNG file: {e}")),
    };
    let found = [image.width() as usize, image.height() as usize];
    if found != size {
        return refuse(path, format!("is {} × {} pixels, the depth images are {} × {}", found[0], found[1], size[0], size[1]));
    }
    match image {
        DynamicImage::ImageLuma8(i) => {
            let raw = i.into_raw();
            // Masks of zeros and ones are as common as those of 0 and 255.
            let border = if raw.iter().all(|x| *x <= 1) { 1 } else { 128 };
            Ok(raw.into_iter().map(|x| x >= border).collect())
        }
        other => refuse(path, format!("has {} channels; a mask is 8-bit greyscale", other.color().channel_count())),
    }
}
