//! Tracked points: `markers.csv`.

use crate::error::{InputError, number as short};
use glam::DVec3;
use palpate_model::observation::MarkerRest;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Tracked points of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedMarkers {
    /// The file they were read from.
    pub file: PathBuf,
    /// Labels in the order in which they first occur.
    pub names: Vec<String>,
    /// One per marker and time, ordered by time.
    pub samples: Vec<MarkerSample>,
    /// Standard deviation of one coordinate [m].
    pub noise_sigma: Option<f64>,
    /// Size of errors that do not average out [m].
    pub noise_systematic: f64,
    /// Where markers sit on the body at rest.
    pub rest: Vec<MarkerRest>,
}

/// One marker at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerSample {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Number of the marker in [`RecordedMarkers::names`].
    pub marker: usize,
    /// World position [m].
    pub position: DVec3,
}

const COLUMNS: [&str; 5] = ["time", "name", "x", "y", "z"];

/// Names and samples of a CSV file.
pub(super) fn read_csv(path: &Path, bytes: &[u8]) -> Result<(Vec<String>, Vec<MarkerSample>), InputError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let broken = |e: csv::Error| {
        let line = e.position().map(|p| p.line() as usize);
        InputError { line, ..InputError::file(path, format!("not a readable CSV file: {e}")) }
    };
    let header: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_string).collect();
    if header != COLUMNS {
        return Err(InputError::line(
            path,
            1,
            format!("columns are \"{}\", expected \"{}\"", header.join(","), COLUMNS.join(",")),
        ));
    }
    let mut names: Vec<String> = Vec::new();
    let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
    let mut samples: Vec<MarkerSample> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        let number = |i: usize| -> Result<f64, InputError> {
            let text = &record[i];
            let wrong = || InputError::line(path, line, format!("{}: \"{text}\" is not a finite number", COLUMNS[i]));
            text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(wrong)
        };
        let time = number(0)?;
        let name = &record[1];
        if name.is_empty() {
            return Err(InputError::line(path, line, "name: is empty"));
        }
        let marker = *numbers.entry(name.to_string()).or_insert_with(|| {
            names.push(name.to_string());
            names.len() - 1
        });
        if let Some(before) = samples.last().filter(|s| s.time > time) {
            let text = format!("time: {} comes after {} in the file; rows are ordered by time", short(time), short(before.time));
            return Err(InputError::line(path, line, text));
        }
        if samples.iter().rev().take_while(|s| s.time == time).any(|s| s.marker == marker) {
            return Err(InputError::line(path, line, format!("name: \"{name}\" occurs twice at time {}", short(time))));
        }
        samples.push(MarkerSample { time, marker, position: DVec3::new(number(2)?, number(3)?, number(4)?) });
    }
    if samples.is_empty() {
        return Err(InputError::file(path, "holds no marker"));
    }
    Ok((names, samples))
}
