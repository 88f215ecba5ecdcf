//! Tracked points: C3D files of motion-capture systems, after the C3D user guide (www.c3d.org).
//!
//! Own reading instead of the crate c3dio: that one indexes into damaged files without looking, and allocates what a header word asks
//! for. Here every place is asked for and may be missing, and nothing is larger than the file.

#[cfg(test)]
mod tests;

use super::MarkerSample;
use crate::error::InputError;
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Blocks that a file is divided into [bytes].
const BLOCK: usize = 512;

/// Names and samples of a C3D file, in metres; frame k of the capture (from 0) is at k / rate.
pub(super) fn read_c3d(
    path: &Path,
    bytes: &[u8],
    warnings: &mut Vec<String>,
) -> Result<(Vec<String>, Vec<MarkerSample>), InputError> {
    let capture = Capture::new(bytes).map_err(|e| InputError::file(path, e))?;
    if capture.frames < capture.announced {
        let (frames, announced) = (capture.frames, capture.announced);
        warnings.push(format!("{}: holds {frames} frames, its header announces {announced} (truncated?)", path.display()));
    }
    let samples = capture.samples();
    if samples.is_empty() {
        return Err(InputError::file(path, "holds no marker that was seen"));
    }
    Ok((capture.names, samples))
}

/// How the computer that wrote a file orders its bytes.
#[derive(Clone, Copy)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

/// A file whose numbers may be missing.
#[derive(Clone, Copy)]
struct Words<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl<'a> Words<'a> {
    fn get<const N: usize>(&self, at: usize) -> Option<[u8; N]> {
        self.bytes.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    fn u16(&self, at: usize) -> Option<u16> {
        self.get(at).map(match self.processor {
            Processor::Intel | Processor::Dec => u16::from_le_bytes,
            Processor::Mips => u16::from_be_bytes,
        })
    }

    fn f32(&self, at: usize) -> Option<f32> {
        let b: [u8; 4] = self.get(at)?;
        Some(match self.processor {
            Processor::Intel => f32::from_le_bytes(b),
            Processor::Mips => f32::from_be_bytes(b),
            // Words are swapped, and the exponent counts from two more.
            Processor::Dec => f32::from_le_bytes([b[2], b[3], b[0], b[1]]) / 4.0,
        })
    }
}

/// A parameter's type (−1 text, 1 bytes, 2 integers, 4 floats), dimensions and data.
struct Parameter<'a> {
    kind: i8,
    dimensions: Vec<usize>,
    data: Words<'a>,
}

impl Parameter<'_> {
    /// The only or first number.
    fn number(&self) -> Option<f64> {
        match self.kind {
            1 => self.data.bytes.first().map(|b| f64::from(*b)),
            2 => self.data.u16(0).map(f64::from),
            4 => self.data.f32(0).map(f64::from),
            _ => None,
        }
    }

    /// Text of a dimension, row by row, without the padding.
    fn texts(&self) -> Vec<String> {
        let length = self.dimensions.first().copied().unwrap_or(1).max(1);
        let text = |b: &[u8]| String::from_utf8_lossy(b).trim_matches(|c: char| c.is_whitespace() || c == '\0').to_string();
        if self.kind == -1 { self.data.bytes.chunks(length).map(text).collect() } else { Vec::new() }
    }
}

/// Parameters by `GROUP:NAME`.
type Parameters<'a> = BTreeMap<String, Parameter<'a>>;

/// Reads the parameter section that starts at a byte; what follows a damaged entry is left out.
fn parameters<'a>(file: Words<'a>, start: usize) -> Parameters<'a> {
    let mut groups: BTreeMap<i8, String> = BTreeMap::new();
    let mut found: Vec<(i8, String, Parameter)> = Vec::new();
    let mut at = start + 4;
    while let Some((id, name, body, next)) = entry(file, at) {
        if id < 0 {
            groups.insert(id.saturating_neg(), name);
        } else if let Some(p) = parameter(file, body) {
            found.push((id, name, p));
        }
        let Some(next) = next else { break };
        at = next;
    }
    let group = |id: i8| groups.get(&id).map_or("", String::as_str);
    found.into_iter().map(|(id, name, p)| (format!("{}:{name}", group(id)), p)).collect()
}

/// Group number (negative for the group itself), name, first byte of the body, and first byte of the next entry where there is one.
fn entry(file: Words, at: usize) -> Option<(i8, String, usize, Option<usize>)> {
    let [length, id] = file.get::<2>(at)?.map(|b| b as i8);
    if length == 0 || id == 0 {
        return None;
    }
    // Locked names have a negative length.
    let link = at + 2 + usize::from(length.unsigned_abs());
    let name = String::from_utf8_lossy(file.bytes.get(at + 2..link)?).to_ascii_uppercase();
    let step = file.u16(link)?;
    Some((id, name, link + 2, (step > 0).then_some(link + usize::from(step))))
}

fn parameter(file: Words<'_>, body: usize) -> Option<Parameter<'_>> {
    let [kind, count] = file.get::<2>(body)?;
    let kind = kind as i8;
    let first = body + 2 + usize::from(count);
    let dimensions: Vec<usize> = file.bytes.get(body + 2..first)?.iter().map(|d| usize::from(*d)).collect();
    let size = dimensions.iter().try_fold(usize::from(kind.unsigned_abs()), |a, d| a.checked_mul(*d))?;
    let bytes = file.bytes.get(first..first.checked_add(size)?)?;
    Some(Parameter { kind, dimensions, data: Words { bytes, ..file } })
}

/// What a file holds of tracked points.
struct Capture<'a> {
    names: Vec<String>,
    /// Metres per unit of the file.
    unit: f64,
    /// Frames per second.
    rate: f64,
    frames: usize,
    /// Frames that the file says it holds.
    announced: usize,
    /// Units of the file per count; `None` = coordinates are floats.
    scale: Option<f64>,
    /// Bytes from one frame to the next; analog channels stand between points.
    stride: usize,
    data: Words<'a>,
}

impl<'a> Capture<'a> {
    fn new(bytes: &'a [u8]) -> Result<Capture<'a>, String> {
        let damaged = |what: String| format!("not a readable C3D file: {what}");
        let &[block, 0x50, ..] = bytes else { return Err(damaged("it does not begin like one".into())) };
        if bytes.len() < BLOCK {
            return Err(damaged(format!("{} bytes, its header alone has {BLOCK}", bytes.len())));
        }
        let start = BLOCK * usize::from(block).saturating_sub(1);
        let processor = match bytes.get(start + 3) {
            _ if block < 2 => return Err(damaged(format!("its parameters begin at block {block}, expected 2 or more"))),
            None => return Err(damaged(format!("its parameters begin at block {block}, beyond its end (truncated?)"))),
            Some(84) => Processor::Intel,
            Some(85) => Processor::Dec,
            Some(86) => Processor::Mips,
            Some(other) => return Err(damaged(format!("its processor is of type {other}, expected 84, 85 or 86"))),
        };
        let file = Words { bytes, processor };
        let word = |at: usize| usize::from(file.u16(at).unwrap_or(0));
        let (points, analog, data) = (word(2), word(4), word(16));
        let data = match bytes.get(BLOCK * data.saturating_sub(1)..) {
            Some(rest) if data > usize::from(block) && !rest.is_empty() => Words { bytes: rest, processor },
            Some(rest) if !rest.is_empty() => {
                return Err(damaged(format!("its data begin at block {data}, expected one after block {block}")));
            }
            _ => return Err(damaged(format!("its data begin at block {data}, beyond its end (truncated?)"))),
        };
        let parameters = parameters(file, start);
        let factor = agreed(&parameters, "POINT:SCALE", file.f32(12), true)?;
        let rate = agreed(&parameters, "POINT:RATE", file.f32(20), false)?;
        if !(rate > 0.0 && rate.is_finite()) {
            return Err(format!("POINT:RATE is {rate}, must be > 0 (frames per second)"));
        }
        // The sign tells integers from floats.
        let scale = (factor > 0.0).then_some(factor);
        let stride = (4 * points + analog) * if scale.is_some() { 2 } else { 4 };
        if points == 0 {
            return Err("holds no points".into());
        }
        let wanted = frames(&parameters, word(6), word(8));
        let header = (word(8) + 1).saturating_sub(word(6));
        Ok(Capture {
            unit: unit(&parameters)?,
            names: names(&parameters, points)?,
            rate,
            frames: wanted.min(data.bytes.len() / stride),
            announced: wanted.max(header),
            scale,
            stride,
            data,
        })
    }

    fn samples(&self) -> Vec<MarkerSample> {
        let mut samples = Vec::new();
        for frame in 0..self.frames {
            for marker in 0..self.names.len() {
                let position = self.position(frame, marker).filter(|p| p.is_finite());
                let time = frame as f64 / self.rate;
                samples.extend(position.map(|position| MarkerSample { time, marker, position }));
            }
        }
        samples
    }

    /// Where a marker is [m]; `None` where it was not seen, which a negative fourth word says.
    fn position(&self, frame: usize, marker: usize) -> Option<DVec3> {
        let first = frame * self.stride;
        let words: [Option<f64>; 4] = match self.scale {
            None => std::array::from_fn(|k| self.data.f32(first + 4 * (4 * marker + k)).map(f64::from)),
            Some(scale) => std::array::from_fn(|k| {
                let count = self.data.u16(first + 2 * (4 * marker + k))? as i16;
                Some(f64::from(count) * scale)
            }),
        };
        let [Some(x), Some(y), Some(z), Some(residual)] = words else { return None };
        (residual >= 0.0).then_some(DVec3::new(x, y, z) * self.unit)
    }
}

/// A number that stands in the header and may stand among the parameters as well (there perhaps without its sign).
fn agreed(parameters: &Parameters, name: &str, header: Option<f32>, signed: bool) -> Result<f64, String> {
    let header = f64::from(header.unwrap_or(0.0));
    let Some(stated) = parameters.get(name).and_then(Parameter::number) else { return Ok(header) };
    let same = if signed { (stated.abs() - header.abs()).abs() } else { (stated - header).abs() } <= 1e-5 * stated.abs();
    match (header == 0.0, same) {
        (true, _) => Ok(stated),
        (false, true) => Ok(header),
        (false, false) => Err(format!("{name} is {stated}, its header says {header}")),
    }
}

/// Number of frames: the header counts to 65 535, so that parameters come first.
fn frames(parameters: &Parameters, first: usize, last: usize) -> usize {
    let number = |name: &str| parameters.get(name).and_then(Parameter::number).map(|n| n as usize).filter(|n| *n > 0);
    // Two words each, the lower one first.
    let field = |name: &str| {
        let data = parameters.get(name)?.data;
        Some(usize::from(data.u16(0)?) + (usize::from(data.u16(2)?) << 16))
    };
    let trial = field("TRIAL:ACTUAL_START_FIELD").zip(field("TRIAL:ACTUAL_END_FIELD"));
    let trial = trial.filter(|(a, b)| b >= a).map(|(a, b)| b - a + 1);
    let counted = trial.or(number("POINT:FRAMES")).unwrap_or((last + 1).saturating_sub(first));
    counted.max(number("POINT:LONG_FRAMES").unwrap_or(0))
}

/// Metres per unit of length.
fn unit(parameters: &Parameters) -> Result<f64, String> {
    let unit = parameters.get("POINT:UNITS").map(|p| p.texts().concat()).unwrap_or_default();
    match unit.to_ascii_lowercase().as_str() {
        "mm" => Ok(1e-3),
        "cm" => Ok(1e-2),
        "m" => Ok(1.0),
        _ => Err(format!("POINT:UNITS is \"{unit}\", expected mm, cm or m")),
    }
}

/// One label per point; one that has none is called by its number.
fn names(parameters: &Parameters, points: usize) -> Result<Vec<String>, String> {
    // More than 255 labels continue in LABELS2, LABELS3, …
    let lists = (1..=257).map(|n| if n == 1 { "POINT:LABELS".to_string() } else { format!("POINT:LABELS{n}") });
    let labels: Vec<String> = lists.map_while(|name| parameters.get(&name)).flat_map(Parameter::texts).collect();
    let mut known = BTreeSet::new();
    let mut names = Vec::new();
    for j in 0..points {
        let name = labels.get(j).filter(|l| !l.is_empty()).cloned().unwrap_or_else(|| format!("point{}", j + 1));
        if !known.insert(name.clone()) {
            return Err(format!("POINT:LABELS holds \"{name}\" twice"));
        }
        names.push(name);
    }
    Ok(names)
}
