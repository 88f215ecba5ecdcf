//! TSV files that Qualisys' QTM exports, and the same with commas.

use super::Format;
use super::table::{Row, Trajectories, cell, is_empty, rows};
use crate::Watch;
use crate::capture::Capture;
use crate::error::{ImportError, refuse, refuse_key};
use crate::options::{Options, Unit};
use crate::place::{Place, head_text};
use glam::DVec3;
use palpate_io::InputError;

const ENDINGS: [&str; 3] = ["tsv", "csv", "txt"];

/// See the file's head.
pub const FORMAT: Format = Format {
    name: "qualisys",
    what: "TSV or CSV of Qualisys' QTM",
    detect: |place| {
        let file = place.only(&ENDINGS)?;
        let text = head_text(file);
        let begins = text.starts_with("NO_OF_FRAMES") || text.starts_with("FILE_VERSION");
        begins.then(|| format!("{} has QTM's header", place.name(file)))
    },
    read,
};

fn read(place: &Place, _: &Options, watch: &mut Watch) -> Result<Capture, ImportError> {
    let Some(path) = place.only(&ENDINGS) else {
        return refuse(&place.path, "is no TSV or CSV file, and does not hold a single one");
    };
    watch.at(0, 1, "motion capture")?;
    let first = head_text(path).lines().next().unwrap_or_default().to_string();
    let rows = rows(path, if first.contains('\t') { '\t' } else { ',' })?;
    let is_data = |r: &Row| cell(r, 0).parse::<f64>().is_ok() || cell(r, 0).is_empty() && r.1.len() > 3;
    let Some(begin) = rows.iter().position(|r| !is_empty(r) && is_data(r)) else {
        return refuse(path, "holds no row of numbers");
    };
    let head = &rows[..begin];
    let row = |key: &str| head.iter().find(|r| cell(r, 0) == key);
    let number = |key: &str| -> Result<Option<f64>, ImportError> {
        let Some(r) = row(key) else { return Ok(None) };
        match cell(r, 1).parse().ok().filter(|x: &f64| x.is_finite()) {
            Some(x) => Ok(Some(x)),
            None => refuse_key(path, key, format!("\"{}\" is not a finite number", cell(r, 1))),
        }
    };
    if let Some(kind) = row("DATA_INCLUDED").map(|r| cell(r, 1)).filter(|k| *k != "3D") {
        return refuse_key(path, "DATA_INCLUDED", format!("{kind}; markers' trajectories are 3D"));
    }
    let Some(rate) = number("FREQUENCY")?.filter(|f| *f > 0.0) else {
        return refuse_key(path, "FREQUENCY", "is missing or not > 0: frames per second");
    };
    let Some(names) = row("MARKER_NAMES") else { return refuse_key(path, "MARKER_NAMES", "is missing") };
    let mut labels: Vec<String> = names.1[1..].to_vec();
    while labels.last().is_some_and(String::is_empty) {
        labels.pop();
    }
    let n = labels.len();
    if let Some(announced) = number("NO_OF_MARKERS")?.filter(|x| *x != n as f64) {
        return refuse_key(path, "NO_OF_MARKERS", format!("{announced}, and {n} have a name"));
    }
    // A row of column heads tells whether frame and time go before.
    let columns = rows[begin].1.iter().rposition(|c| !c.is_empty()).map_or(0, |k| k + 1);
    let heads = head.last().map_or(0, |r| ["Frame", "Time"].iter().filter(|w| r.1.iter().take(2).any(|c| c == *w)).count());
    let extra = if heads > 0 { heads } else { columns.saturating_sub(3 * n).min(2) };
    let timed = extra == 2 || heads == 1 && cell(&head[head.len() - 1], 0) == "Time";
    let mut t = Trajectories::new(path, labels, names.0)?;
    let mut count = 0;
    for row in rows[begin..].iter().filter(|r| !is_empty(r)) {
        if row.1[extra.min(row.1.len())..].iter().skip(3 * n).any(|c| !c.is_empty()) {
            let text = format!("has {} numbers, {n} markers have {}", row.1.len() - extra, 3 * n);
            return Err(InputError::line(path, row.0, text).into());
        }
        let time = if timed { cell(row, extra - 1).parse().unwrap_or(f64::NAN) } else { count as f64 / rate };
        if !time.is_finite() {
            return Err(InputError::line(path, row.0, format!("\"{}\" is no time", cell(row, extra - 1))).into());
        }
        let cells: Vec<[&str; 3]> = (0..n).map(|m| [0, 1, 2].map(|k| cell(row, extra + 3 * m + k))).collect();
        t.push(row.0, time, &cells, true)?;
        count += 1;
    }
    if let Some(announced) = number("NO_OF_FRAMES")?.filter(|x| *x != count as f64) {
        return refuse_key(path, "NO_OF_FRAMES", format!("{announced}, and the file holds {count} (truncated?)"));
    }
    let mut losses = Vec::new();
    let markers = t.finish(&mut losses)?;
    Ok(Capture {
        title: place.title(),
        usual_unit: Some((Unit::Millimetre, "what QTM exports")),
        up: Some((DVec3::Z, "z, QTM's own".into())),
        markers: Some(markers),
        facts: vec![format!("{rate} frames a second; places of three zeros are gaps")],
        losses,
        ..Capture::default()
    })
}
