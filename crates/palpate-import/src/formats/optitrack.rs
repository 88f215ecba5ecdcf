//! CSV files that OptiTrack's Motive exports (format versions 1.2 and later).

use super::Format;
use super::table::{Row, Trajectories, bare_names, cell, is_empty, rows};
use crate::capture::Capture;
use crate::error::{ImportError, refuse, refuse_key};
use crate::options::{Options, Unit};
use crate::place::{Place, head_text};
use crate::{Watch, times};
use glam::DVec3;
use palpate_io::InputError;
use std::path::Path;

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "optitrack",
    what: "CSV of OptiTrack's Motive",
    detect: |place| {
        let file = place.only(&["csv"])?;
        let first = head_text(file).lines().next().unwrap_or_default().to_string();
        (first.contains("Format Version") && first.contains("Take")).then(|| format!("{} has Motive's header", place.name(file)))
    },
    read,
};

fn read(place: &Place, _: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some(path) = place.only(&["csv"]) else { return refuse(&place.path, "is no CSV file, and does not hold a single one") };
    watch.at(0, 1, "motion capture")?;
    let rows = rows(path, ',')?;
    let head = Head::new(path, &rows)?;
    let mut losses = Vec::new();
    let columns = columns(path, &rows, &head, &mut losses)?;
    let names: Vec<String> = columns.iter().map(|c| c.0.clone()).collect();
    let mut t = Trajectories::new(path, bare_names(&names), head.names + 1)?;
    let mut count = 0;
    for row in rows[head.header + 1..].iter().filter(|r| !is_empty(r)) {
        let Some(time) = cell(row, 1).parse().ok().filter(|t: &f64| t.is_finite()) else {
            return Err(InputError::line(path, row.0, format!("\"{}\" is no time", cell(row, 1))).into());
        };
        let cells: Vec<[&str; 3]> = columns.iter().map(|c| c.1.map(|i| cell(row, i))).collect();
        t.push(row.0, time, &cells, false)?;
        count += 1;
    }
    if let Some(announced) = head.value("Total Exported Frames").and_then(|v| v.parse::<usize>().ok())
        && announced != count
    {
        return refuse_key(path, "Total Exported Frames", format!("{announced}, and the file holds {count} (truncated?)"));
    }
    let markers = t.finish(&mut losses)?;
    times::rising(&markers.times, |k| {
        InputError::file(path, format!("time {} is not after the one before it", markers.times[k]))
    })?;
    Ok(Capture {
        title: place.title(),
        unit: head.unit(path)?,
        usual_unit: Some((Unit::Metre, "what Motive exports unless it is told otherwise")),
        up: Some((DVec3::Y, "y, Motive's own".into())),
        markers: Some(markers),
        losses,
        ..Capture::default()
    })
}

/// Which rows are what.
struct Head {
    pairs: Vec<String>,
    kinds: Option<usize>,
    names: usize,
    header: usize,
}

impl Head {
    fn new(path: &Path, rows: &[Row]) -> Result<Head, ImportError> {
        let find = |word: &str| rows.iter().take(16).position(|r| cell(r, 1) == word);
        let header = rows.iter().take(16).position(|r| cell(r, 0) == "Frame" && cell(r, 1).starts_with("Time"));
        // A row goes before it that says which columns are positions.
        let header = header.filter(|h| *h > 0);
        let (Some(names), Some(header)) = (find("Name"), header) else {
            return refuse(
                path,
                "lacks the rows \"Name\" and \"Frame,Time (Seconds)\" of Motive's header; export with the header",
            );
        };
        let head = Head { pairs: rows[0].1.clone(), kinds: find("Type"), names, header };
        match head.value("Coordinate Space") {
            Some(space) if space != "Global" => {
                refuse_key(path, "Coordinate Space", format!("\"{space}\" is not the world: export with global coordinates"))
            }
            _ => Ok(head),
        }
    }

    /// The value behind a name in the first row.
    fn value(&self, name: &str) -> Option<&str> {
        let k = self.pairs.iter().position(|p| p == name)?;
        self.pairs.get(k + 1).map(String::as_str).filter(|v| !v.is_empty())
    }

    fn unit(&self, path: &Path) -> Result<Option<(Unit, String)>, ImportError> {
        let Some(text) = self.value("Length Units") else { return Ok(None) };
        match text.parse() {
            Ok(unit) => Ok(Some((unit, format!("Length Units, {text}")))),
            Err(e) => refuse_key(path, "Length Units", e),
        }
    }
}

/// Names of measured markers and the columns of their x, y and z.
fn columns(path: &Path, rows: &[Row], head: &Head, losses: &mut Vec<String>) -> Result<Vec<(String, [usize; 3])>, ImportError> {
    let (axes, what) = (&rows[head.header], &rows[head.header - 1]);
    let kind = |i: usize| head.kinds.map_or("Marker", |k| cell(&rows[k], i));
    let name = |i: usize| cell(&rows[head.names], i);
    let mut found: Vec<(String, [usize; 3])> = Vec::new();
    let (mut expected, mut unlabelled, mut bodies) = (0, 0, 0);
    for i in 2..axes.1.len() {
        let three = ["X", "Y", "Z"].iter().enumerate().all(|(k, a)| cell(axes, i + k) == *a && name(i + k) == name(i));
        if !three || !cell(what, i).eq_ignore_ascii_case("position") {
            continue;
        }
        match kind(i) {
            "Marker" if name(i).starts_with("Unlabeled") || name(i).is_empty() => unlabelled += 1,
            "Marker" => found.push((name(i).to_string(), [i, i + 1, i + 2])),
            // Where the solver expects a marker of a rigid body, not where it was seen.
            k if k.ends_with("Marker") => expected += 1,
            _ => bodies += 1,
        }
    }
    if unlabelled > 0 {
        losses.push(format!("{unlabelled} trajectories without a label are left out; label them in Motive"));
    }
    if expected + bodies > 0 {
        losses.push(format!(
            "{bodies} bodies and {expected} places where a body's markers were expected are left out: they were not measured"
        ));
    }
    if found.is_empty() {
        return refuse(path, "holds no labelled marker with a position; export with \"Markers\" on");
    }
    Ok(found)
}
