//! Sequences of files with a point cloud each: PLY.

use super::Format;
use crate::Watch;
use crate::budget::Budget;
use crate::capture::{Capture, Cloud};
use crate::error::{ImportError, read as read_bytes, refuse};
use crate::options::Options;
use crate::place::Place;
use crate::times::of_files;
use palpate_io::cloud::decode_cloud;
use std::path::PathBuf;

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "ply",
    what: "sequence of PLY point clouds",
    detect: |place| {
        let n = place.with_ending(&["ply"]).count();
        (n > 0).then(|| format!("{n} PLY files"))
    },
    read: |place, o, watch| read_sequence(place, "ply", o, watch),
};

/// Reads the files with an ending, one cloud each; points that are not finite are what a sensor did not see.
pub fn read_sequence(place: &Place, ending: &str, o: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let files: Vec<PathBuf> = place.with_ending(&[ending]).cloned().collect();
    if files.is_empty() {
        return refuse(&place.path, format!("holds no .{ending} file"));
    }
    let times = of_files(place, &files, o.fps, None)?;
    let mut capture = Capture { title: place.title(), ..Capture::default() };
    let (mut lost, mut viewpoints, mut budget) = (0, Vec::new(), Budget::new());
    for (k, file) in files.iter().enumerate() {
        watch.at(k, files.len(), "point clouds")?;
        let read = decode_cloud(file, &read_bytes(file)?)?;
        let (mut points, viewpoint) = (read.points, read.viewpoint);
        let all = points.len();
        points.retain(|p| p.is_finite());
        budget.take(&place.path, &points)?;
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
