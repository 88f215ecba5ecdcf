//! What `cargo xtask real` stores in `bench/real.json`: tables, each with the day and the commit that measured it.

use super::diagnoses::{self, Answer};
use super::models::{self, Variant};
use crate::table;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A table that can be measured by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Slice {
    /// Each recording's own fit, and both beams with one modulus.
    Recordings,
    /// What one beam says of the other.
    Predictions,
    /// How the load of 52 g acts.
    Loads,
    /// Cells, the band of the cost and gravity across the swing.
    Variants,
    /// Both beams with materials and schemes.
    Models,
    /// What the models lack.
    Diagnoses,
}

/// When a table was measured, and by what.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// Day.
    pub date: String,
    /// Commit, with a + where tracked files differed from it; of tables older than this entry the commit that stored them.
    pub commit: String,
    /// Fingerprint of the files that can move the figures; empty where only the commit is known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub code: String,
}

impl Made {
    /// True if both were made by the same code, whatever its commit is called.
    pub fn is_same(&self, other: &Made) -> bool {
        if self.code.is_empty() || other.code.is_empty() { self.commit == other.commit } else { self.code == other.code }
    }

    /// Today, by the tree as it is.
    ///
    /// # Errors
    /// Git does not answer.
    pub fn now() -> Result<Made, String> {
        let differs = !table::git(&["status", "--porcelain", "--untracked-files=no"])?.is_empty();
        let commit = table::git(&["rev-parse", "--short", "HEAD"])?;
        Ok(Made { date: table::today(), commit: commit + if differs { "+" } else { "" }, code: String::new() })
    }
}

/// Something measured, and the same simulated.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Pair {
    /// By the fit.
    pub simulated: f64,
    /// By the recording.
    pub measured: f64,
}

/// How one fit did.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// The recording, and what was changed.
    pub name: String,
    /// E [Pa].
    pub youngs_modulus: f64,
    /// Of E [Pa]; `None` where E was given.
    pub standard_error: Option<f64>,
    /// Of the marker's swing.
    pub damping_ratio: Option<Pair>,
    /// Of the marker's swing [Hz].
    pub frequency: Option<Pair>,
    /// How far below its place at rest the marker swings [m].
    pub sag: Option<Pair>,
    /// Residual, root mean square [m].
    pub rms: f64,
    /// What noise alone would leave, root mean square [m].
    pub noise: f64,
    /// The marker's distance from its measured places, root mean square, in the frames that were fitted and in all from the first of them to the
    /// end of the recording [m].
    pub marker_rms: Option<[f64; 2]>,
    /// Stiffness-proportional damping and its standard error [s].
    pub stiffness_damping: Option<[f64; 2]>,
    /// Mean sag after three seconds, when the swing has died away [m].
    pub late_sag: Option<Pair>,
}

impl Pair {
    /// Simulated / measured.
    pub fn text(self, scale: f64, digits: usize) -> String {
        format!("{:.digits$} / {:.digits$}", scale * self.simulated, scale * self.measured)
    }

    /// The same with the unit and how far the simulation is off.
    pub fn compared(self, scale: f64, digits: usize, unit: &str) -> String {
        let off = format!("{:+.1}", 100.0 * (self.simulated / self.measured - 1.0)).replace('-', "−");
        format!("{}{unit} ({off} %)", self.text(scale, digits))
    }
}

/// Every table.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Report {
    /// When and by what each was measured.
    pub made: BTreeMap<Slice, Made>,
    /// [`Slice::Recordings`].
    pub recordings: Vec<Row>,
    /// [`Slice::Predictions`].
    pub predictions: Vec<Row>,
    /// [`Slice::Loads`].
    pub loads: Vec<Row>,
    /// [`Slice::Variants`].
    pub variants: Vec<Row>,
    /// [`Slice::Models`].
    pub models: Vec<Variant>,
    /// [`Slice::Diagnoses`].
    pub diagnoses: Vec<Answer>,
}

impl Report {
    /// What is stored in a workspace; nothing where there is no file.
    ///
    /// # Errors
    /// The file is there and is no report.
    pub fn load(root: &Path) -> Result<Report, String> {
        let path = root.join("bench/real.json");
        if !path.exists() {
            return Ok(Report::default());
        }
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Prints a table.
    pub fn print(&self, slice: Slice) {
        match slice {
            Slice::Recordings => print("Fits of measured recordings (simulated / measured)", &self.recordings),
            Slice::Predictions => print("What one beam says of the other", &self.predictions),
            Slice::Loads => print("How the load of 52 g acts", &self.loads),
            Slice::Variants => print("Cantilevers with one thing changed", &self.variants),
            Slice::Models => println!("\nMaterials and schemes\n{}", models::markdown(&self.models)),
            Slice::Diagnoses => println!("\nWhat the models lack\n{}", diagnoses::markdown(&self.diagnoses)),
        }
    }
}

/// Prints rows with all that a fit says.
fn print(title: &str, rows: &[Row]) {
    let both = |p: Option<Pair>, scale: f64, digits: usize, off: bool| {
        p.map_or("–".into(), |p| if off { p.compared(scale, digits, "") } else { p.text(scale, digits) })
    };
    let line = |r: &Row| {
        let error = r.standard_error.map_or("given".into(), |e| format!("± {:.1}", 1e-3 * e));
        vec![
            r.name.clone(),
            format!("{:.1} {error}", 1e-3 * r.youngs_modulus),
            both(r.damping_ratio, 1.0, 3, false),
            both(r.frequency, 1.0, 2, true),
            both(r.sag, 1e3, 2, true),
            format!("{:.2} ({:.2})", 1e3 * r.rms, 1e3 * r.noise),
            r.marker_rms.map_or("–".into(), |[fitted, whole]| format!("{:.2} / {:.2}", 1e3 * fitted, 1e3 * whole)),
            r.stiffness_damping.map_or("–".into(), |[value, error]| format!("{:.1} ± {:.1}", 1e3 * value, 1e3 * error)),
            both(r.late_sag, 1e3, 2, true),
        ]
    };
    let head = [
        "",
        "E [kPa]",
        "damping ratio",
        "frequency [Hz]",
        "sag [mm]",
        "rms (noise) [mm]",
        "tip, fitted / to the end [mm]",
        "stiffness damping [ms]",
        "sag after 3 s [mm]",
    ];
    let rows: Vec<Vec<String>> = std::iter::once(head.map(String::from).to_vec()).chain(rows.iter().map(line)).collect();
    table::print(title, &rows);
}
