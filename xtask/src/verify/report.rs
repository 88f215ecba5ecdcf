//! What `cargo xtask verify` stores in `bench/verify.json`, and the page `docs/verification.md` that is made of it.

use super::STUDIES;
use crate::real::report::Made;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// What a figure has to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Requirement {
    /// A value, up to a part of it.
    Within {
        /// The value.
        value: f64,
        /// The part.
        part: f64,
    },
    /// In a range.
    Between {
        /// From.
        least: f64,
        /// To.
        most: f64,
    },
    /// No less.
    AtLeast(f64),
    /// No more.
    AtMost(f64),
}

/// One figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// What was measured.
    pub what: String,
    /// What it has to be.
    pub requirement: Requirement,
    /// What it is; a file has nothing where it is not a number.
    #[serde(deserialize_with = "number")]
    pub measured: f64,
    /// Its unit; empty for plain numbers.
    pub unit: String,
    /// Where the requirement comes from.
    pub source: String,
}

impl Row {
    /// A figure of a study.
    pub fn new(what: impl Into<String>, requirement: Requirement, measured: f64, unit: &str, source: &str) -> Row {
        Row { what: what.into(), requirement, measured, unit: unit.into(), source: source.into() }
    }

    /// True where the figure is what it has to be; not a number never is.
    pub fn passes(&self) -> bool {
        let x = self.measured;
        match self.requirement {
            Requirement::Within { value, part } => (x - value).abs() <= part * value.abs(),
            Requirement::Between { least, most } => (least..=most).contains(&x),
            Requirement::AtLeast(least) => x >= least,
            Requirement::AtMost(most) => x <= most,
        }
    }

    /// Cells of its line: what, requirement, figure, verdict, source.
    pub fn cells(&self) -> [String; 5] {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        let (wanted, found) = match self.requirement {
            Requirement::Within { value, part } => {
                let off = format!("{:+.2}", 100.0 * (self.measured / value - 1.0)).replace('-', "−");
                (
                    format!("{}{unit} ± {} %", figure(value), figure(100.0 * part)),
                    format!("{}{unit} ({off} %)", figure(self.measured)),
                )
            }
            Requirement::Between { least, most } => {
                (format!("{} to {}{unit}", figure(least), figure(most)), format!("{}{unit}", figure(self.measured)))
            }
            Requirement::AtLeast(least) => (format!("≥ {}{unit}", figure(least)), format!("{}{unit}", figure(self.measured))),
            Requirement::AtMost(most) => (format!("≤ {}{unit}", figure(most)), format!("{}{unit}", figure(self.measured))),
        };
        let verdict = if self.passes() { "pass" } else { "FAIL" };
        [self.what.clone(), wanted, found, verdict.into(), self.source.clone()]
    }
}

/// A number, or none.
fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// Four digits, without the zeros behind.
fn figure(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = 3 - x.abs().log10().floor() as i32;
    if !(-2..=6).contains(&digits) {
        return format!("{x:.2e}").replace('-', "−");
    }
    let text = format!("{x:.*}", digits.max(0) as usize);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.replace('-', "−")
}

/// What one study found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Found {
    /// Day and commit.
    pub made: Made,
    /// Time that it took [s].
    pub seconds: f64,
    /// Its figures.
    pub rows: Vec<Row>,
}

/// All studies by name.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// What is known.
    pub studies: BTreeMap<String, Found>,
}

impl Report {
    /// What is stored in a workspace; nothing where there is no file.
    ///
    /// # Errors
    /// The file is there and is no report.
    pub fn load(root: &Path) -> Result<Report, String> {
        let path = root.join("bench/verify.json");
        if !path.exists() {
            return Ok(Report::default());
        }
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Figures that are not what they have to be.
    pub fn failures(&self) -> Vec<&Row> {
        self.studies.values().flat_map(|s| &s.rows).filter(|r| !r.passes()).collect()
    }

    /// The page.
    pub fn page(&self) -> String {
        let mut page = String::from(
            "# Verification\n\nWhether palpate solves its equations, and whether what comes out is what theory says. This page is written by \
             `cargo xtask verify` from\n`bench/verify.json`; `cargo xtask tidy` compares both. Every row has a requirement that was stated \
             before, the figure that was measured on\nthe CPU backend in f64, and the source of the requirement. The GPU backend is compared \
             with the CPU's by the tests.\n",
        );
        let rows: Vec<&Row> = self.studies.values().flat_map(|s| &s.rows).collect();
        let _ =
            writeln!(page, "\n{} of {} figures meet their requirement.", rows.iter().filter(|r| r.passes()).count(), rows.len());
        for study in STUDIES {
            let Some(found) = self.studies.get(study.name) else { continue };
            let _ = writeln!(page, "\n## {}\n\n{}\n", study.title, study.text);
            page += "| figure | required | measured | | source |\n|---|---|---|---|---|\n";
            for row in &found.rows {
                let _ = writeln!(page, "| {} |", row.cells().join(" | "));
            }
            let Made { date, commit, .. } = &found.made;
            let _ = writeln!(
                page,
                "\n`cargo xtask verify --only {}`, {date}, commit {commit}, {:.0} s.",
                study.name,
                found.seconds.ceil()
            );
        }
        page
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_passes_where_it_is_in_its_range_and_numbers_have_four_digits() {
        let row = |requirement, x| Row::new("x", requirement, x, "m", "theory");
        let within = Requirement::Within { value: -2.0, part: 0.1 };
        assert!(row(within, -2.19).passes() && !row(within, -2.21).passes() && !row(within, f64::NAN).passes());
        assert!(row(Requirement::AtLeast(1.0), 1.0).passes() && !row(Requirement::AtMost(1.0), 1.1).passes());
        assert!(!row(Requirement::Between { least: 1.0, most: 2.0 }, 0.9).passes());
        assert_eq!(row(within, -2.1).cells()[1..4], ["−2 m ± 10 %", "−2.1 m (+5.00 %)", "pass"].map(String::from));
        for (x, text) in [(369.91, "369.9"), (0.012_345, "0.01235"), (1.0, "1"), (1e-9, "1.00e−9"), (1000.0, "1000")] {
            assert_eq!(figure(x), text);
        }
    }
}
