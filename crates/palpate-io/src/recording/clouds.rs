//! Point clouds as they are: `[[cloud]]` tables, whose points are readings of the surface like pixels of depth images.

use super::sequence::Reader;
use super::{RecordedCamera, noise};
use crate::cloud::{ENDINGS, ending, read_cloud};
use crate::document::{Source, Table};
use crate::error::{InputError, number};
use crate::keys::suggest;
use glam::DVec3;
use std::path::PathBuf;

/// Points of the surface at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedCloud {
    /// The file they were read from; its ending says how they are written.
    pub file: PathBuf,
    /// Time on the recording's clock [s].
    pub time: f64,
    /// From where they were seen.
    pub from: SeenFrom,
    /// World points [m], all finite; none where nothing was seen.
    pub points: Vec<DVec3>,
    /// Standard deviation of one distance [m]; `None` = not stated, here or by the camera.
    pub noise_sigma: Option<f64>,
    /// Size of errors that do not average out [m].
    pub noise_systematic: f64,
}

/// From where a cloud was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SeenFrom {
    /// From where this camera stands, by its number in [`super::Recording::cameras`].
    Camera(usize),
    /// From this place in the world [m].
    Origin(DVec3),
    /// Nobody says: there are no lines of sight.
    Unknown,
}

/// Sensors are no nearer than this to what they see [m], as for depth images.
const NEAREST: f64 = 0.02;

/// Sensors are no farther than this, and no body is larger [m].
const FARTHEST: f64 = 20.0;

/// Fewer points in the image of a cloud's camera than this share are a wrong pose.
const IN_VIEW: f64 = 0.1;

/// Fewer than this are in the camera's axes, where nearly all would be seen from there.
const MOSTLY_OUT: f64 = 0.5;

/// Fewer than this are worth a word.
const MOSTLY_IN_VIEW: f64 = 0.9;

pub(super) fn clouds(
    source: &Source,
    root: &Table,
    cameras: &[RecordedCamera],
    warnings: &mut Vec<String>,
) -> Result<Vec<RecordedCloud>, InputError> {
    let mut all: Vec<RecordedCloud> = Vec::new();
    let (mut last, mut empty, mut blind) = (None, 0usize, 0usize);
    let tables = root.tables("cloud")?;
    for table in &tables {
        let read = read(source, table, cameras)?;
        check_unit(table, &read, cameras)?;
        warnings.extend(check_view(table, &read, cameras)?);
        if let (true, [only]) = (table.has("time"), &read[..]) {
            if let Some(before) = last.filter(|b| *b > only.time) {
                let text =
                    format!("{} comes after {} in the file; clouds are ordered by time", number(only.time), number(before));
                return Err(table.error("time", text));
            }
            last = Some(only.time);
        }
        for c in &read {
            let twice = |o: &&RecordedCloud| o.time == c.time && o.from == c.from;
            let same_file = |o: &RecordedCloud| c.from != SeenFrom::Unknown || o.file == c.file;
            if all.iter().find(twice).is_some_and(same_file) {
                let text = format!("{} occurs twice at {} s", who(c.from, cameras), number(c.time));
                return Err(table.error("time", text));
            }
        }
        empty += read.iter().filter(|c| c.points.is_empty()).count();
        blind += usize::from(read.iter().any(|c| c.from == SeenFrom::Unknown));
        all.extend(read);
    }
    if let (false, Some(t)) = (all.iter().any(|c| !c.points.is_empty()), tables.first()) {
        return Err(t.error("file", "holds not a single finite point, and neither do the other clouds"));
    }
    let path = source.path.display();
    if empty > 0 {
        warnings.push(format!("{path}: {empty} of {} clouds hold no finite point and are of no use", all.len()));
    }
    if blind > 0 {
        warnings.push(format!(
            "{path}: {blind} of {} [[cloud]] have neither camera nor origin: without lines of sight nobody knows which side of the body a \
             point is of, so that thin parts may be matched with the wrong one",
            tables.len()
        ));
    }
    all.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(all)
}

/// What saw a cloud, in words.
fn who(from: SeenFrom, cameras: &[RecordedCamera]) -> String {
    match from {
        SeenFrom::Camera(c) => format!("a cloud of camera \"{}\"", cameras[c].name),
        SeenFrom::Origin(o) => format!("a cloud from [{}, {}, {}]", number(o.x), number(o.y), number(o.z)),
        SeenFrom::Unknown => "a file".into(),
    }
}

/// The clouds of a table, ordered by time.
fn read(source: &Source, table: &Table, cameras: &[RecordedCamera]) -> Result<Vec<RecordedCloud>, InputError> {
    let r = Reader::new(source, table.clone(), &["ply", "pcd", "npy", "npz"])?;
    let one_file = ENDINGS.contains(&ending(&r.file).as_str());
    let (mut stacks, mut times, mut viewpoint) = (Vec::new(), Vec::new(), None);
    if one_file {
        for key in ["array", "times", "rate", "start"] {
            if table.has(key) {
                return Err(table.error(key, "goes with arrays (.npy, .npz); a file of one cloud has a `time`"));
            }
        }
        let found = read_cloud(&r.file)?;
        times.push(time(table)?.or(found.time).ok_or_else(|| table.missing("time", "a number (s)"))?);
        viewpoint = found.viewpoint.map(|v| r.transform.transform_point3(r.unit * v));
        stacks.push(found.points);
    } else {
        let array = r.main_array("points")?;
        let (frames, count) = match array.shape[..] {
            [count, 3] => (None, count),
            [frames, count, 3] => (Some(frames), count),
            _ => {
                let text = format!("has shape {}, expected (points, 3) or (frames, points, 3)", array.shape_text());
                return Err(table.error("file", text));
            }
        };
        let points: Vec<DVec3> = array.values.chunks_exact(3).map(DVec3::from_slice).collect();
        match frames {
            None => {
                times.push(time(table)?.ok_or_else(|| table.missing("time", "a number (s), since the array is one cloud"))?);
                stacks.push(points);
            }
            Some(n) => {
                if table.has("time") {
                    return Err(table.error("time", format!("is one time for {n} clouds; give `times` or `rate`")));
                }
                times = r.times(n)?;
                stacks = (0..n).map(|k| points[k * count..(k + 1) * count].to_vec()).collect();
            }
        }
    }
    let from = from(table, cameras)?.or(viewpoint.map(SeenFrom::Origin)).unwrap_or(SeenFrom::Unknown);
    let of_camera = |pick: fn(&RecordedCamera) -> Option<f64>| match from {
        SeenFrom::Camera(c) => pick(&cameras[c]),
        _ => None,
    };
    let noise_sigma = noise(table, "noise_sigma")?.or(of_camera(|c| c.noise_sigma));
    let noise_systematic = noise(table, "noise_systematic")?.or(of_camera(|c| Some(c.noise_systematic))).unwrap_or(0.0);
    let world = |p: &DVec3| r.transform.transform_point3(r.unit * *p);
    let cloud = |(time, points): (f64, Vec<DVec3>)| RecordedCloud {
        file: r.file.clone(),
        time,
        from,
        points: points.iter().filter(|p| p.is_finite()).map(world).collect(),
        noise_sigma,
        noise_systematic,
    };
    Ok(times.into_iter().zip(stacks).map(cloud).collect())
}

fn time(table: &Table) -> Result<Option<f64>, InputError> {
    table.optional_f64("time")
}

fn from(table: &Table, cameras: &[RecordedCamera]) -> Result<Option<SeenFrom>, InputError> {
    let origin = table.optional_vec3("origin")?.map(SeenFrom::Origin);
    let Some(name) = table.optional_str("camera")? else { return Ok(origin) };
    if origin.is_some() {
        return Err(table.error("origin", "a cloud was seen by a `camera` or from an `origin`, not both"));
    }
    let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
    match names.iter().position(|n| *n == name) {
        Some(c) => Ok(Some(SeenFrom::Camera(c))),
        None => Err(table.error("camera", format!("no [[camera]] is named \"{name}\"; {}", suggest(name, &names)))),
    }
}

/// The middle of some numbers.
fn median(mut all: Vec<f64>) -> Option<f64> {
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Refuses clouds that cannot be in metres: by their distance from what saw them, else by how far they reach.
fn check_unit(table: &Table, clouds: &[RecordedCloud], cameras: &[RecordedCamera]) -> Result<(), InputError> {
    let Some(first) = clouds.first() else { return Ok(()) };
    let all = || clouds.iter().flat_map(|c| c.points.iter().copied());
    let center = match first.from {
        SeenFrom::Camera(c) => Some(cameras[c].position()),
        SeenFrom::Origin(o) => Some(o),
        SeenFrom::Unknown => None,
    };
    let (size, what, nearest) = match center {
        Some(c) => (median(all().map(|p| p.distance(c)).collect()), "lie from where they were seen", NEAREST),
        None => {
            // Strays reach anywhere: half of the points, about their middle.
            let middle = [0, 1, 2].map(|a| median(all().map(|p| p[a]).collect()).unwrap_or(0.0));
            (median(all().map(|p| p.distance(middle.into())).collect()), "lie from their middle", 0.0)
        }
    };
    let Some(size) = size.filter(|s| !(nearest..=FARTHEST).contains(s)) else { return Ok(()) };
    let fits = |f: &&(f64, &str)| (0.05..=10.0).contains(&(size * f.0));
    let hint = match [(0.001, "mm"), (0.01, "cm")].iter().find(fits) {
        Some((f, unit)) => format!("; are they in another unit? unit = \"{unit}\" would make it about {:.3} m", size * f),
        None => "; check unit, transform and where they were seen from".to_string(),
    };
    let text = format!("its points {what} by {size:.4} m (the median), expected {nearest} to {FARTHEST} m{hint}");
    Err(table.error("file", text))
}

/// Refuses clouds that their camera cannot have seen, with a word where many points lie outside of its image.
fn check_view(table: &Table, clouds: &[RecordedCloud], cameras: &[RecordedCamera]) -> Result<Option<String>, InputError> {
    let Some(SeenFrom::Camera(c)) = clouds.first().map(|c| c.from) else { return Ok(None) };
    let camera = &cameras[c];
    let share = |place: &dyn Fn(DVec3) -> DVec3| {
        let all = || clouds.iter().flat_map(|c| &c.points);
        let inside = all().filter(|p| camera.holds(place(**p))).count();
        inside as f64 / all().count().max(1) as f64
    };
    if clouds.iter().all(|c| c.points.is_empty()) {
        return Ok(None);
    }
    let seen = share(&|p| p);
    if seen >= MOSTLY_IN_VIEW {
        return Ok(None);
    }
    let text = format!("only {:.0} % of its points lie in the image of camera \"{}\"", 100.0 * seen, camera.name);
    let turned = share(&|p| camera.world_from_camera.transform_point3(p)) >= MOSTLY_IN_VIEW;
    if seen >= if turned { MOSTLY_OUT } else { IN_VIEW } {
        return Ok(Some(table.error("camera", text).to_string()));
    }
    let hint = if turned {
        "; they seem to be in the camera's axes, and its world_from_camera as `transform` puts them into the world"
    } else {
        "; clouds are in world axes, `transform` turns others"
    };
    Err(table.error("camera", text + hint))
}
