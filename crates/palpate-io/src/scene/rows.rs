//! Tables of numbers beside a scene: CSV files with a fixed header.

use crate::error::InputError;
use crate::input::read_bytes;
use std::path::Path;

/// Rows of a file with exactly these columns, all numbers finite, each with its line.
pub(super) fn rows<const N: usize>(path: &Path, columns: [&str; N]) -> Result<Vec<(usize, [f64; N])>, InputError> {
    let bytes = read_bytes(path)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&bytes[..]);
    let broken = |e: csv::Error| {
        let line = e.position().map(|p| p.line() as usize);
        InputError { line, ..InputError::file(path, format!("not a readable CSV file: {e}")) }
    };
    let header: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_string).collect();
    if header != columns {
        return Err(InputError::line(path, 1, format!("columns are {}, expected {}", header.join(","), columns.join(","))));
    }
    let mut all = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, |p| p.line() as usize);
        let mut v = [0.0; N];
        for (i, field) in record.iter().enumerate() {
            v[i] = (field.parse().ok().filter(|x: &f64| x.is_finite()))
                .ok_or_else(|| InputError::line(path, line, format!("{}: \"{field}\" is not a finite number", columns[i])))?;
        }
        all.push((line, v));
    }
    Ok(all)
}
