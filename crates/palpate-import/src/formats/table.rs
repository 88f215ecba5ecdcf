//! What tables of motion capture have in common: rows of cells, numbers in them, and trajectories that are filled row by row.

use crate::capture::Markers;
use crate::error::{ImportError, read_text, refuse};
use glam::DVec3;
use palpate_io::InputError;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A row: its line, from 1, and its cells without blanks around them.
pub type Row = (usize, Vec<String>);

/// The rows of a file, empty ones too: sections end with them.
pub fn rows(path: &Path, delimiter: char) -> Result<Vec<Row>, ImportError> {
    let text = read_text(path)?;
    let cells = |line: &str| -> Vec<String> {
        let mut reader = csv::ReaderBuilder::new().has_headers(false).delimiter(delimiter as u8).from_reader(line.as_bytes());
        let record = reader.records().next().and_then(Result::ok);
        record.map(|r| r.iter().map(|c| c.trim().to_string()).collect()).unwrap_or_default()
    };
    Ok(text.lines().enumerate().map(|(i, line)| (i + 1, cells(line))).collect())
}

/// A row's cell, empty where there is none.
pub fn cell(row: &Row, i: usize) -> &str {
    row.1.get(i).map_or("", String::as_str)
}

/// True for a row without anything in it.
pub fn is_empty(row: &Row) -> bool {
    row.1.iter().all(String::is_empty)
}

/// Trajectories that are being filled.
pub struct Trajectories {
    path: PathBuf,
    markers: Markers,
}

impl Trajectories {
    /// Of names, which must differ.
    pub fn new(path: &Path, names: Vec<String>, line: usize) -> Result<Trajectories, ImportError> {
        let mut known = BTreeSet::new();
        if names.is_empty() {
            return refuse(path, "holds no marker");
        }
        for n in &names {
            if n.is_empty() || !known.insert(n.as_str()) {
                let text = if n.is_empty() { "a marker has no name".to_string() } else { format!("marker \"{n}\" occurs twice") };
                return Err(InputError::line(path, line, text).into());
            }
        }
        Ok(Trajectories { path: path.to_path_buf(), markers: Markers { names, ..Markers::default() } })
    }

    /// Adds the places at a time, as texts x, y, z marker by marker; a marker whose three texts hold nothing was not seen.
    pub fn push(&mut self, line: usize, time: f64, cells: &[[&str; 3]], zeros_are_gaps: bool) -> Result<(), ImportError> {
        let wrong = |text: String| Err(InputError::line(&self.path, line, text).into());
        if self.markers.times.last().is_some_and(|t| time <= *t || time.is_nan()) {
            return wrong(format!("time {time} does not come after the one before it"));
        }
        let mut places = Vec::with_capacity(cells.len());
        for (name, c) in self.markers.names.iter().zip(cells) {
            let gap = |t: &str| t.is_empty() || ["nan", "null", "n/a", "-"].contains(&t.to_ascii_lowercase().as_str());
            let missing = c.iter().filter(|t| gap(t)).count();
            if missing == 3 {
                places.push(None);
                continue;
            }
            let mut p = [0.0; 3];
            for (x, text) in p.iter_mut().zip(c) {
                match text.parse::<f64>() {
                    Ok(value) if value.is_finite() => *x = value,
                    _ if missing > 0 => return wrong(format!("marker \"{name}\" has a part of its coordinates alone")),
                    _ => return wrong(format!("marker \"{name}\": \"{text}\" is not a finite number")),
                }
            }
            places.push((!zeros_are_gaps || p != [0.0; 3]).then_some(DVec3::from_array(p)));
        }
        self.markers.times.push(time);
        self.markers.places.extend(places);
        Ok(())
    }

    /// What was filled in; markers that were never seen go.
    pub fn finish(self, losses: &mut Vec<String>) -> Result<Markers, ImportError> {
        let Markers { names, times, places } = self.markers;
        let n = names.len();
        let seen: Vec<usize> = (0..n).filter(|m| places.iter().skip(*m).step_by(n).any(Option::is_some)).collect();
        if seen.is_empty() {
            return refuse(&self.path, "holds no marker that was seen");
        }
        if seen.len() < n {
            losses.push(format!("{} of {n} markers were never seen", n - seen.len()));
        }
        Ok(Markers {
            places: places.chunks(n).flat_map(|row| seen.iter().map(|m| row[*m])).collect(),
            names: seen.iter().map(|m| names[*m].clone()).collect(),
            times,
        })
    }
}

/// Names without what they all share before a colon (the subject), where they still differ then.
pub fn bare_names(names: &[String]) -> Vec<String> {
    let bare: Vec<String> = names.iter().map(|n| n.rsplit_once(':').map_or(n.as_str(), |(_, b)| b).to_string()).collect();
    let different = bare.iter().collect::<BTreeSet<_>>().len() == bare.len() && bare.iter().all(|b| !b.is_empty());
    if different { bare } else { names.to_vec() }
}
