//! `[[load]]` and `[[attach]]`: forces on points of the body, and places that points are drawn to, from files.

use super::moving;
use crate::document::{Source, Table};
use crate::error::{InputError, number};
use crate::npy::{Array, read_array, read_indices};
use crate::recording::sequence::{check_times, check_vectors};
use crate::recording::{read_points, read_times};
use glam::DVec3;
use palpate_model::effects::driven::{Drive, Points};
use palpate_model::effects::{self, Effect, attachment, file_load};
use palpate_model::mechanics::series::Series;
use palpate_model::scene::ObservationSpec;
use std::path::PathBuf;
use std::sync::Arc;

/// Where a table's files and the scene's recording are.
struct Reader<'a> {
    source: &'a Source,
    t: Table<'a>,
    observation: Option<&'a ObservationSpec>,
}

/// Loads become effects, appended to `effects`.
pub(super) fn loads(
    source: &Source,
    root: &Table,
    observation: Option<&ObservationSpec>,
    effects: &mut Vec<Effect>,
) -> Result<(), InputError> {
    for t in root.tables("load")? {
        let jet = t.optional_choice("kind", &[("file", false), ("jet", true)])?;
        if jet.ok_or_else(|| t.missing("kind", "\"file\" or \"jet\""))? {
            effects.push(moving::jet(&t)?);
            continue;
        }
        if let Some(key) = moving::JET_KEYS.into_iter().find(|k| t.has(k)) {
            return Err(t.error(key, "belongs to kind = \"jet\""));
        }
        let r = Reader { source, t, observation };
        effects.push(r.load()?);
    }
    Ok(())
}

/// Attachments become effects, appended to `effects`.
pub(super) fn attachments(
    source: &Source,
    root: &Table,
    observation: Option<&ObservationSpec>,
    effects: &mut Vec<Effect>,
) -> Result<(), InputError> {
    for t in root.tables("attach")? {
        let r = Reader { source, t, observation };
        effects.push(r.attachment()?);
    }
    Ok(())
}

impl Reader<'_> {
    fn load(&self) -> Result<Effect, InputError> {
        let t = &self.t;
        let points = match (t.has("index"), t.has("places")) {
            (true, true) => return Err(t.error("places", "index and places exclude each other; give one")),
            (true, false) => Points::Nodes(self.indices("index")?.unwrap_or_default()),
            (false, _) => {
                let wanted =
                    "places of the body at rest, [[x, y, z], …] or an array of shape (n, 3) (m), or `index` (numbers of nodes)";
                Points::Places(self.rows("places")?.ok_or_else(|| t.missing("places", wanted))?, None)
            }
        };
        if points.is_empty() {
            return Err(t.error(if t.has("index") { "index" } else { "places" }, "names no point"));
        }
        let n = points.len();
        let (key, vectors) = match (t.has("forces"), t.has("total")) {
            (true, true) => return Err(t.error("total", "forces and total exclude each other; give one")),
            (true, false) => ("forces", self.of_points("forces", n)?),
            (false, true) => {
                let rows = self.rows("total")?.unwrap_or_default();
                // One force a time, shared by the points.
                ("total", rows.iter().flat_map(|f| std::iter::repeat_n(*f / n as f64, n)).collect())
            }
            (false, false) => {
                let wanted = "an array of shape (T, n, 3) or (n, 3) (N), or `total` (T, 3), which the points share";
                return Err(t.missing("forces", wanted));
            }
        };
        if let Some(k) = vectors.iter().position(|v| v.is_nan()) {
            return Err(
                t.error(key, format!("the force on point {} of row {} is NaN; a load is known at all times", k % n, k / n))
            );
        }
        let series = self.series(key, n, vectors)?;
        let factor = t.optional_f64("factor")?.unwrap_or(1.0);
        self.effect(file_load::KIND, vec![Some(factor)], Drive { points, series: Arc::new(series), tracked: Vec::new() })
    }

    fn attachment(&self) -> Result<Effect, InputError> {
        let t = &self.t;
        let stiffness = t.f64_where("stiffness", |x| x > 0.0 && x <= 1e12, "is not allowed: must lie in (0, 1e12] (N/m)")?;
        let stiffness =
            stiffness.ok_or_else(|| t.missing("stiffness", "a number > 0 (N/m): force of a point over its distance"))?;
        let offset = t.optional_vec3("offset")?.unwrap_or_default();
        let values = [stiffness, offset.x, offset.y, offset.z].map(Some).to_vec();
        let drive = match t
            .optional_str("track")?
            .ok_or_else(|| t.missing("track", "\"recording\", or an array of shape (T, n, 3) (m)"))?
        {
            "recording" => self.recorded()?,
            _ => {
                if t.has("points") {
                    return Err(t.error("points", "are numbers of the recording's points; with a track of its own give `places`"));
                }
                let wanted = "where the points of the track lie at rest, [[x, y, z], …] or an array of shape (n, 3) (m)";
                let places = self.rows("places")?.ok_or_else(|| t.missing("places", wanted))?;
                if places.is_empty() {
                    return Err(t.error("places", "names no point"));
                }
                let vectors = self.of_points("track", places.len())?;
                let series = Arc::new(self.series("track", places.len(), vectors)?);
                Drive { points: Points::Places(places, None), series, tracked: Vec::new() }
            }
        };
        self.effect(attachment::KIND, values, drive)
    }

    /// Some of the recording's tracked points, at its own times.
    fn recorded(&self) -> Result<Drive, InputError> {
        let t = &self.t;
        for key in ["places", "times", "rate", "start"] {
            if t.has(key) {
                return Err(t.error(key, "belongs to a track from a file; the recording has its own places and times"));
            }
        }
        let file = self.recording("track")?;
        let lacks = || t.error("track", format!("{} has no [points]", file.display()));
        let points = read_points(&file)?.ok_or_else(lacks)?;
        let count = points.track.count();
        let tracked = self.indices("points")?.unwrap_or_else(|| (0..count as u32).collect());
        if tracked.is_empty() {
            return Err(t.error("points", "names no point"));
        }
        if let Some((k, n)) = tracked.iter().enumerate().find(|(_, n)| **n as usize >= count) {
            return Err(
                t.error("points", format!("{n} (number {k}) is no point: {} has {count}, numbered from 0", file.display()))
            );
        }
        let rows = points.track.vectors.chunks_exact(count);
        let vectors = rows.flat_map(|row| tracked.iter().map(|n| row[*n as usize])).collect();
        let places = tracked.iter().map(|n| points.rest[*n as usize]).collect();
        let series = Arc::new(Series { count: tracked.len(), times: points.track.times.clone(), vectors });
        Ok(Drive { points: Points::Places(places, points.tolerance), series, tracked })
    }

    fn effect(&self, kind: &str, values: Vec<Option<f64>>, drive: Drive) -> Result<Effect, InputError> {
        let law = effects::find(kind).expect("the law is in the table");
        for (p, v) in effects::ALL[law].params.iter().zip(values.iter().flatten()) {
            if !(p.lower..=p.upper).contains(v) {
                let text = format!("{} is not allowed: must lie in [{}, {}]", number(*v), number(p.lower), number(p.upper));
                return Err(self.t.error(p.key, text));
            }
        }
        Ok(Effect { values, drive: Some(Arc::new(drive)), ..Effect::absent(law) })
    }

    /// The file of the scene's recording; `key` needs it.
    fn recording(&self, key: &str) -> Result<PathBuf, InputError> {
        let Some(spec) = self.observation else {
            return Err(self.t.error(key, "needs the recording of an [observation], which the scene lacks"));
        };
        let file = if spec.recording.is_dir() { spec.recording.join(&spec.file) } else { spec.recording.clone() };
        if file.exists() {
            Ok(file)
        } else {
            Err(self.t.error(key, format!("needs the recording {}, which is not there", file.display())))
        }
    }

    /// File and name of the array that a text means: `"file.npy"`, or `"file.npz:name"`.
    fn place<'t>(&self, key: &str, text: &'t str) -> Result<(PathBuf, Option<&'t str>), InputError> {
        let (file, name) = match text.split_once(".npz:") {
            Some((stem, name)) => (format!("{stem}.npz"), Some(name)),
            None => (text.to_string(), None),
        };
        let lower = file.to_ascii_lowercase();
        if !lower.ends_with(".npy") && !lower.ends_with(".npz") {
            return Err(self.t.error(key, format!("\"{text}\" is neither an .npy file nor \"file.npz:array\"")));
        }
        let path = self.source.folder().join(file);
        if path.exists() { Ok((path, name)) } else { Err(self.t.error(key, format!("there is no file {}", path.display()))) }
    }

    fn array(&self, key: &str, text: &str) -> Result<Array, InputError> {
        let (path, name) = self.place(key, text)?;
        read_array(&path, name)
    }

    /// Numbers from 0 on: a list, or a file.
    fn indices(&self, key: &str) -> Result<Option<Vec<u32>>, InputError> {
        let t = &self.t;
        if t.is_str(key) {
            let (path, name) = self.place(key, t.optional_str(key)?.unwrap_or_default())?;
            return read_indices(&path, name).map(Some);
        }
        let Some(list) = t.optional_list(key)? else { return Ok(None) };
        let index = |x: &f64| {
            let is_one = x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(x);
            is_one.then_some(*x as u32).ok_or_else(|| t.error(key, format!("{} is no number from 0 on", number(*x))))
        };
        list.iter().map(index).collect::<Result<_, _>>().map(Some)
    }

    /// Vectors of one axis: rows in the scene, or a file of shape (n, 3). All are numbers.
    fn rows(&self, key: &str) -> Result<Option<Vec<DVec3>>, InputError> {
        let t = &self.t;
        if !t.is_str(key) {
            return t.optional_points(key);
        }
        let array = self.array(key, t.optional_str(key)?.unwrap_or_default())?;
        let [_, 3] = array.shape[..] else {
            return Err(t.error(key, format!("has shape {}, expected (n, 3)", array.shape_text())));
        };
        let rows: Vec<DVec3> = array.values.chunks_exact(3).map(DVec3::from_slice).collect();
        match rows.iter().position(|v| !v.is_finite()) {
            Some(k) => Err(t.error(key, format!("row {k} is {}, which is not finite", rows[k]))),
            None => Ok(Some(rows)),
        }
    }

    /// Vectors of n points at one time or several, from a file of shape (n, 3) or (T, n, 3); NaN where a point has none.
    fn of_points(&self, key: &str, n: usize) -> Result<Vec<DVec3>, InputError> {
        let t = &self.t;
        if !t.is_str(key) {
            let rows = t.optional_points(key)?.unwrap_or_default();
            if rows.len() != n {
                return Err(t.error(
                    key,
                    format!("has {} vectors for {n} points; several times are an array of shape (T, n, 3)", rows.len()),
                ));
            }
            return Ok(rows);
        }
        let array = self.array(key, t.optional_str(key)?.unwrap_or_default())?;
        let fits = match array.shape[..] {
            [count, 3] => count == n,
            [times, count, 3] => times > 0 && count == n,
            _ => false,
        };
        if !fits {
            let found = array.shape_text();
            return Err(
                t.error(key, format!("has shape {found}, expected (T, {n}, 3) or ({n}, 3): one vector for each of {n} points"))
            );
        }
        let vectors: Vec<DVec3> = array.values.chunks_exact(3).map(DVec3::from_slice).collect();
        check_vectors(vectors.iter().copied()).map_err(|e| t.error(key, e))?;
        Ok(vectors)
    }

    /// Vectors with their times: stated ones, or those of the recording's frames.
    fn series(&self, key: &str, count: usize, vectors: Vec<DVec3>) -> Result<Series, InputError> {
        let t = &self.t;
        let rows = vectors.len() / count;
        if t.has("rate") && t.has("times") {
            return Err(t.error("rate", "rate and times exclude each other; give one"));
        }
        if t.has("start") && !t.has("rate") {
            return Err(t.error("start", "goes with `rate`; `times` say when rows are"));
        }
        if rows == 1 && !t.has("rate") && !t.has("times") {
            return Ok(Series::constant(vectors));
        }
        let times = if let Some(rate) = t.f64_where("rate", |x| x > 0.0, "is not allowed: must be > 0 (1/s)")? {
            let start = t.optional_f64("start")?.unwrap_or(0.0);
            (0..rows).map(|k| start + k as f64 / rate).collect()
        } else if t.is_str("times") {
            let array = self.array("times", t.optional_str("times")?.unwrap_or_default())?;
            if array.shape.len() != 1 {
                return Err(t.error("times", format!("has shape {}, expected ({rows},)", array.shape_text())));
            }
            array.values
        } else if let Some(list) = t.optional_list("times")? {
            list
        } else {
            return self.times_of_recording(key, rows).map(|times| Series { count, times, vectors });
        };
        check_times(&times, rows).map_err(|e| t.error(if t.has("rate") { "rate" } else { "times" }, e))?;
        Ok(Series { count, times, vectors })
    }

    /// When the recording's frames are, all of them; a row belongs to each.
    fn times_of_recording(&self, key: &str, rows: usize) -> Result<Vec<f64>, InputError> {
        let t = &self.t;
        if self.observation.is_none() {
            return Err(t.missing(
                "times",
                &format!("{rows} times (s), or `rate` (1/s); without an [observation] nothing says when rows are"),
            ));
        }
        let file = self.recording("times")?;
        let kinds = self.observation.map_or(&[][..], |o| &o.costs[..]);
        let none = || t.missing("times", &format!("{rows} times (s); those of the recording's images do not count rows"));
        let times = read_times(&file, kinds)?.ok_or_else(none)?;
        if times.len() != rows {
            let (place, frames) = (file.display(), times.len());
            return Err(
                t.error(key, format!("has {rows} rows, and {place} has {frames} frames; give one row a frame, or `times`"))
            );
        }
        Ok(times)
    }
}
