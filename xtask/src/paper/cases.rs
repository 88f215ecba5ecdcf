//! A study made of cases: each runs for minutes, prints its figures and appends a row, and is not run again by the same code. A page says what was
//! promised of them ([`super::acceptance`]).

use super::acceptance::{Aim, markdown};
use crate::real::report::Made;
use crate::rows::{self, Measured};
use crate::table;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// What one case came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// When, and by what.
    #[serde(flatten)]
    pub made: Made,
    /// Name of the case.
    pub case: String,
    /// Its figures by name.
    pub figures: BTreeMap<String, f64>,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Figures of one case.
pub type Figures = BTreeMap<String, f64>;

/// A case, from the folder of measured recordings and one to work in.
pub type Case = fn(&Path, &Path) -> Result<Figures, String>;

/// A table of a page, in Markdown, from all rows.
pub type Table = fn(&[Row]) -> String;

/// A study.
pub struct Set {
    /// Name under which `cargo xtask paper --only` runs all cases, and of its rows in `bench`; a case alone is `NAME-CASE`.
    pub name: &'static str,
    /// The page that has the table of aims.
    pub page: &'static str,
    /// Cases by name.
    pub cases: &'static [(&'static str, Case)],
    /// What was promised.
    pub aims: &'static [Aim],
    /// Further tables of the page by name.
    pub more: &'static [(&'static str, Table)],
    /// What moves the figures.
    pub measured: Measured,
}

impl Set {
    /// All rows of a workspace.
    ///
    /// # Errors
    /// A line is no row.
    pub fn stored(&self, root: &Path) -> Result<Vec<Row>, String> {
        rows::load(&root.join("bench").join(format!("{}.jsonl", self.name)))
    }

    /// True where a table's name asks for these cases.
    pub fn is_asked(&self, only: &str) -> bool {
        only.starts_with(self.name)
    }

    /// Runs the cases that a name asks for and this code has not run yet, appends a row each, and prints the last row of every case.
    ///
    /// # Errors
    /// No case has the name, one cannot be run, or a file cannot be read or written.
    pub fn run(&self, only: &str) -> Result<(), String> {
        let wanted = only.strip_prefix(self.name).unwrap_or("").trim_start_matches('-');
        if !self.cases.iter().any(|c| c.0.starts_with(wanted)) {
            let names: Vec<String> = self.cases.iter().map(|c| format!("{}-{}", self.name, c.0)).collect();
            return Err(format!("nothing begins with {only}; there are {}, {}", self.name, names.join(", ")));
        }
        let path = rows::path(self.name);
        let made = rows::measured(self.measured)?;
        let data = std::env::var("PALPATE_DATA").unwrap_or_else(|_| table::root().join("../shared/data").display().to_string());
        for (name, case) in self.cases.iter().filter(|c| c.0.starts_with(wanted)) {
            let known: Vec<Row> = rows::load(&path)?;
            if known.iter().any(|r| r.case == *name && r.made.is_same(&made)) {
                continue;
            }
            let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
            let clock = Instant::now();
            let mut figures = case(Path::new(&data), folder.path()).map_err(|e| format!("{name}: {e}"))?;
            // What could not be found is left out: JSON has no word for it.
            figures.retain(|_, x| x.is_finite());
            let row = Row { made: made.clone(), case: (*name).into(), figures, seconds: clock.elapsed().as_secs_f64() };
            rows::append(&path, &row)?;
        }
        self.report()
    }

    /// Prints the last row of every case, and writes the tables of the page.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn report(&self) -> Result<(), String> {
        let all = self.stored(&table::root())?;
        self.print(&all);
        for (name, text) in self.tables(&all) {
            table::replace(self.page, name, &text)?;
        }
        Ok(())
    }

    /// The tables of the page by name.
    pub fn tables(&self, all: &[Row]) -> Vec<(&'static str, String)> {
        let more = self.more.iter().map(|(name, of)| (*name, of(all)));
        std::iter::once((self.name, markdown(self.aims, all))).chain(more).collect()
    }

    /// The last row of every case.
    fn print(&self, all: &[Row]) {
        for (name, _) in self.cases {
            let Some(row) = all.iter().rev().find(|r| r.case == *name) else { continue };
            let head = vec!["figure".to_string(), "value".to_string()];
            let figures = row.figures.iter().map(|(name, x)| vec![name.clone(), format!("{x:.4}")]);
            let rows: Vec<Vec<String>> = std::iter::once(head).chain(figures).collect();
            table::print(&format!("{name} ({}, {}, {:.0} s)", row.made.date, row.made.commit, row.seconds), &rows);
        }
    }
}
