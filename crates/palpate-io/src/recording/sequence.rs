//! Things that are seen again and again, in arrays of NumPy: tracked points (`[points]`) and node displacements (`[displacements]`).

use super::{inside, noise};
use crate::cloud::ending;
use crate::document::{Source, Table};
use crate::error::{InputError, number};
use crate::npy::{Array, is_archive, read_array};
use crate::rigid::rigid;
use glam::{DAffine3, DVec3};
use std::path::PathBuf;

/// Vectors of N things at T times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sequence {
    /// The file they were read from.
    pub file: PathBuf,
    /// Times on the recording's clock [s], rising `[T]`.
    pub times: Vec<f64>,
    /// World vectors [m] `[T, N]`, time by time; NaN where a thing was not seen.
    pub vectors: Vec<DVec3>,
    /// Standard deviation of one coordinate [m].
    pub noise_sigma: Option<f64>,
    /// Size of errors that do not average out [m].
    pub noise_systematic: f64,
}

impl Sequence {
    /// Number of things N.
    pub fn count(&self) -> usize {
        self.vectors.len().checked_div(self.times.len()).unwrap_or(0)
    }

    /// Things seen at a time of the sequence, with their vectors [m].
    pub fn seen(&self, time: usize) -> impl Iterator<Item = (usize, DVec3)> {
        let n = self.count();
        self.vectors[time * n..(time + 1) * n].iter().copied().enumerate().filter(|(_, v)| !v.is_nan())
    }

    /// Readings in all.
    pub fn readings(&self) -> usize {
        self.vectors.iter().filter(|v| !v.is_nan()).count()
    }
}

/// Tracked points of the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedPoints {
    /// Their positions.
    pub track: Sequence,
    /// Where they lie at rest [m] `[N]`.
    pub rest: Vec<DVec3>,
    /// How far rest places may lie from the rest surface [m]; `None` = two cells.
    pub tolerance: Option<f64>,
}

/// Displacements of the simulation's nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedDisplacements {
    /// The displacements.
    pub track: Sequence,
    /// Rest places of the nodes [m] `[N]`, to compare with those of the scene; empty where the recording does not say.
    pub nodes: Vec<DVec3>,
}

/// A table whose arrays are read.
pub(super) struct Reader<'a> {
    source: &'a Source,
    table: Table<'a>,
    pub(super) file: PathBuf,
    /// Metres of a unit, and what follows.
    pub(super) unit: f64,
    pub(super) transform: DAffine3,
}

pub(super) fn points(source: &Source, root: &Table) -> Result<Option<RecordedPoints>, InputError> {
    let Some(table) = root.optional_table("points")? else { return Ok(None) };
    let r = Reader::new(source, table, &["npy", "npz"])?;
    let track = r.sequence("points", |p| r.transform.transform_point3(p))?;
    let rest = r.rest(&track)?;
    let tolerance = r.table.f64_where("tolerance", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    Ok(Some(RecordedPoints { track, rest, tolerance }))
}

pub(super) fn displacements(source: &Source, root: &Table) -> Result<Option<RecordedDisplacements>, InputError> {
    let Some(table) = root.optional_table("displacements")? else { return Ok(None) };
    let r = Reader::new(source, table, &["npy", "npz"])?;
    let track = r.sequence("displacements", |u| r.transform.transform_vector3(u))?;
    let nodes = match r.table.optional_str("nodes")? {
        None => Vec::new(),
        Some(text) => r.places("nodes", text, track.count())?,
    };
    Ok(Some(RecordedDisplacements { track, nodes }))
}

impl<'a> Reader<'a> {
    /// Of a table whose `file` has one of these endings.
    pub(super) fn new(source: &'a Source, table: Table<'a>, endings: &[&str]) -> Result<Reader<'a>, InputError> {
        let allowed = endings.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ");
        let file =
            inside(source, &table, "file")?.ok_or_else(|| table.missing("file", &format!("a file; allowed: {allowed}")))?;
        if !endings.contains(&ending(&file).as_str()) {
            return Err(table.error("file", format!("\"{}\" is none of {allowed}", file.display())));
        }
        let units = [("m", 1.0), ("cm", 0.01), ("mm", 0.001)];
        let unit = table.optional_choice("unit", &units)?.unwrap_or(1.0);
        let transform = match table.optional_matrix4("transform")? {
            None => DAffine3::IDENTITY,
            Some(m) => rigid(m).map_err(|e| table.error("transform", e))?,
        };
        Ok(Reader { source, table, file, unit, transform })
    }

    /// The array that a key names: `"file.npy"`, `"file.npz:name"`, or the name of one in the table's own archive.
    fn array(&self, key: &str, text: &str) -> Result<Array, InputError> {
        let (name, file) = match text.split_once(".npz:") {
            Some((stem, name)) => (Some(name), format!("{stem}.npz")),
            None if text.to_ascii_lowercase().ends_with(".npy") => (None, text.to_string()),
            None if is_archive(&self.file) => return read_array(&self.file, Some(text)),
            None => {
                let text =
                    format!("\"{text}\" is neither an .npy file, nor \"file.npz:array\", nor an array of an .npz in `file`");
                return Err(self.table.error(key, text));
            }
        };
        read_array(&super::inside_text(self.source, &self.table, key, &file)?, name)
    }

    /// The array that the table is about; `usual` is its name where none is given.
    pub(super) fn main_array(&self, usual: &str) -> Result<Array, InputError> {
        let named = self.table.optional_str("array")?;
        if is_archive(&self.file) {
            read_array(&self.file, Some(named.unwrap_or(usual)))
        } else if named.is_some() {
            Err(self.table.error("array", "names an array of an .npz file, and `file` is an .npy file"))
        } else {
            read_array(&self.file, None)
        }
    }

    fn sequence(&self, usual: &str, place: impl Fn(DVec3) -> DVec3) -> Result<Sequence, InputError> {
        let t = &self.table;
        let array = self.main_array(usual)?;
        let [frames, count, 3] = array.shape[..] else {
            let text = format!("has shape {}, expected (frames, points, 3)", array.shape_text());
            return Err(t.error("file", text));
        };
        if frames * count == 0 {
            return Err(t.error("file", format!("has shape {}: nothing is in it", array.shape_text())));
        }
        let vectors = self.vectors("file", &array, place)?;
        if vectors.iter().all(|v| v.is_nan()) {
            return Err(t.error("file", "holds not a single reading: all is NaN"));
        }
        Ok(Sequence {
            file: self.file.clone(),
            times: self.times(frames)?,
            vectors,
            noise_sigma: noise(t, "noise_sigma")?,
            noise_systematic: noise(t, "noise_systematic")?.unwrap_or(0.0),
        })
    }

    /// World vectors of an array whose last axis has three coordinates; NaN where all three are.
    fn vectors(&self, key: &str, array: &Array, place: impl Fn(DVec3) -> DVec3) -> Result<Vec<DVec3>, InputError> {
        let all = || array.values.chunks_exact(3).map(DVec3::from_slice);
        check_vectors(all()).map_err(|e| self.table.error(key, e))?;
        Ok(all().map(|v| if v.is_nan() { DVec3::NAN } else { place(self.unit * v) }).collect())
    }

    /// `times` (numbers, or an array by name), or `rate` with `start`.
    pub(super) fn times(&self, frames: usize) -> Result<Vec<f64>, InputError> {
        let t = &self.table;
        if t.has("rate") == t.has("times") {
            return Err(t.missing("times", "numbers (s) or an array, or `rate` (1/s) instead"));
        }
        if let Some(rate) = t.f64_where("rate", |x| x > 0.0, "is not allowed: must be > 0 (1/s)")? {
            let start = t.optional_f64("start")?.unwrap_or(0.0);
            return Ok((0..frames).map(|k| start + k as f64 / rate).collect());
        }
        if t.has("start") {
            return Err(t.error("start", "goes with `rate`; `times` say when frames are"));
        }
        let times = match t.optional_str("times") {
            Ok(Some(text)) => {
                let array = self.array("times", text)?;
                if array.shape.len() != 1 {
                    return Err(t.error("times", format!("has shape {}, expected ({frames},)", array.shape_text())));
                }
                array.values
            }
            _ => t.optional_numbers("times", frames)?.unwrap_or_default(),
        };
        check_times(&times, frames).map_err(|e| t.error("times", e))?;
        Ok(times)
    }

    /// Rest places: a row of the track, or an array.
    fn rest(&self, track: &Sequence) -> Result<Vec<DVec3>, InputError> {
        let t = &self.table;
        let n = track.count();
        if let Ok(Some(text)) = t.optional_str("rest") {
            return self.places("rest", text, n);
        }
        let row = t.optional_count("rest", 0..=track.times.len() as u64 - 1)?;
        let row = row.ok_or_else(|| t.missing("rest", "the number of a frame at rest, or an array of rest places"))? as usize;
        let places = &track.vectors[row * n..(row + 1) * n];
        let unseen = places.iter().filter(|p| p.is_nan()).count();
        if unseen > 0 {
            let text = format!("{unseen} of {n} points were not seen in frame {row}; give their rest places as an array");
            return Err(t.error("rest", text));
        }
        Ok(places.to_vec())
    }

    /// Places of all N things: an array that a key names.
    fn places(&self, key: &str, text: &str, count: usize) -> Result<Vec<DVec3>, InputError> {
        let array = self.array(key, text)?;
        if array.shape != [count, 3] {
            let found = array.shape_text();
            return Err(self.table.error(key, format!("\"{text}\" has shape {found}, expected ({count}, 3)")));
        }
        let places = self.vectors(key, &array, |p| self.transform.transform_point3(p))?;
        match places.iter().filter(|p| p.is_nan()).count() {
            0 => Ok(places),
            n => Err(self.table.error(key, format!("{n} of {count} places are NaN"))),
        }
    }
}

/// Refuses infinite numbers, and vectors that were seen in part.
pub(crate) fn check_vectors(all: impl Iterator<Item = DVec3> + Clone) -> Result<(), String> {
    let infinite = all.clone().flat_map(|v| v.to_array()).filter(|x| x.is_infinite()).count();
    if infinite > 0 {
        return Err(format!("{infinite} of {} numbers are infinite; NaN marks what was not seen", 3 * all.count()));
    }
    let partly = |v: &DVec3| v.is_nan() && !(v.x.is_nan() && v.y.is_nan() && v.z.is_nan());
    let broken = all.clone().filter(partly).count();
    all.clone().position(|v| partly(&v)).map_or(Ok(()), |first| {
        Err(format!("{broken} vectors are NaN in part only, the first is number {first}; what was not seen is NaN in x, y and z"))
    })
}

/// Refuses times that do not rise, or are not one a frame.
pub(crate) fn check_times(times: &[f64], frames: usize) -> Result<(), String> {
    if times.len() != frames {
        return Err(format!("holds {} times for {frames} frames", times.len()));
    }
    let wrong = (0..frames).find(|k| !times[*k].is_finite() || (*k > 0 && times[*k] <= times[k - 1]));
    wrong.map_or(Ok(()), |k| Err(format!("{} of frame {k} is not finite, or not after the one before", number(times[k]))))
}

#[cfg(test)]
#[path = "sequence_tests.rs"]
mod tests;
