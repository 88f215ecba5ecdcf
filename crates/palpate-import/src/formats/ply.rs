//! Sequences of PLY files with a point cloud each.

use super::Format;
use crate::Watch;
use crate::capture::{Capture, Cloud};
use crate::error::{ImportError, read as read_bytes, refuse};
use crate::options::Options;
use crate::place::Place;
use crate::times::of_files;
use glam::DVec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "ply",
    what: "sequence of PLY point clouds",
    detect: |place| {
        let n = place.with_ending(&["ply"]).count();
        (n > 0).then(|| format!("{n} PLY files"))
    },
    read: |place, o, watch| read_sequence(place, "ply", o, watch, |f| Ok((points(f)?, None))),
};

/// Points of a file, and where they were seen from.
pub type Points = (Vec<DVec3>, Option<DVec3>);

/// Reads the files with an ending, one cloud each; points that are not finite are what a sensor did not see.
pub fn read_sequence(
    place: &Place,
    ending: &str,
    o: &Options,
    watch: &mut Watch,
    one: impl Fn(&Path) -> Result<Points, ImportError>,
) -> Result<Capture, ImportError> {
    let files: Vec<PathBuf> = place.with_ending(&[ending]).cloned().collect();
    if files.is_empty() {
        return refuse(&place.path, format!("holds no .{ending} file"));
    }
    let times = of_files(place, &files, o.fps, None)?;
    let mut capture = Capture { title: place.title(), ..Capture::default() };
    let (mut lost, mut viewpoints) = (0, Vec::new());
    for (k, file) in files.iter().enumerate() {
        watch.at(k, files.len(), "point clouds")?;
        let (mut points, viewpoint) = one(file)?;
        let all = points.len();
        points.retain(|p| p.is_finite());
        if all > 0 && points.is_empty() {
            return refuse(file, format!("none of its {all} points is finite"));
        }
        lost += all - points.len();
        viewpoints.extend(viewpoint);
        capture.clouds.push(Cloud { time: times.seconds[k], file: file.clone(), points });
    }
    if lost > 0 {
        capture.facts.push(format!("{lost} points are not finite: what the sensor did not see"));
    }
    if viewpoints.len() == files.len() && viewpoints.windows(2).all(|w| w[0] == w[1]) {
        capture.viewpoint = viewpoints.first().copied();
    }
    capture.guesses.extend(times.guess);
    capture.facts.push(times.fact);
    Ok(capture)
}

fn number(p: Option<&Property>) -> Option<f64> {
    match p? {
        Property::Float(x) => Some(f64::from(*x)),
        Property::Double(x) => Some(*x),
        Property::Int(x) => Some(f64::from(*x)),
        Property::UInt(x) => Some(f64::from(*x)),
        Property::Short(x) => Some(f64::from(*x)),
        Property::UShort(x) => Some(f64::from(*x)),
        Property::Char(x) => Some(f64::from(*x)),
        Property::UChar(x) => Some(f64::from(*x)),
        _ => None,
    }
}

fn points(file: &Path) -> Result<Vec<DVec3>, ImportError> {
    let bytes = read_bytes(file)?;
    let ply = match Parser::<DefaultElement>::new().read_ply(&mut Cursor::new(bytes)) {
        Ok(p) => p,
        Err(e) => return refuse(file, format!("not a readable PLY file: {e}")),
    };
    let Some(vertices) = ply.payload.get("vertex") else { return refuse(file, "has no element \"vertex\"") };
    let mut points = Vec::with_capacity(vertices.len());
    for (i, v) in vertices.iter().enumerate() {
        let [x, y, z] = ["x", "y", "z"].map(|k| number(v.get(k)));
        match (x, y, z) {
            (Some(x), Some(y), Some(z)) => points.push(DVec3::new(x, y, z)),
            _ => return refuse(file, format!("vertex {} lacks x, y or z", i + 1)),
        }
    }
    Ok(points)
}
