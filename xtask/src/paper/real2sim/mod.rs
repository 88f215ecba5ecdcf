//! Acceptance of what came with Hahn et al., Real2Sim (SIGGRAPH Asia 2019): fields with priors on a synthetic bar of two parts (their figures 12 and
//! 13) and a measured cantilever of two materials, the design of a disk, numerical coarsening, and the measured beams. `bench/real2sim.jsonl`
//! holds a row a case and commit.

pub(crate) mod acceptance;
mod bar;
mod beams;
mod coarsening;
mod disk;
mod hanging;
mod many;

use crate::real::report::Made;
use crate::rows::{self, Measured};
use crate::table;
use palpate::{Experiment, Fitted};
use palpate_fit::FieldPosterior;
use palpate_model::plan::Plan;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Name under which `cargo xtask paper --only` runs all cases; a case alone is `real2sim-NAME`.
pub const NAME: &str = "real2sim";

/// The page that has the table of aims, and one of bodies of cells and of tetrahedra side by side.
pub const PAGE: &str = "docs/real2sim.md";
/// Name of the latter.
pub const PAIRS: &str = "real2sim-pairs";

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
type Figures = BTreeMap<String, f64>;

/// All rows of a workspace.
///
/// # Errors
/// A line is no row.
pub fn stored(root: &Path) -> Result<Vec<Row>, String> {
    rows::load(&root.join("bench").join(format!("{NAME}.jsonl")))
}

/// A case, from the folder of measured recordings and one to work in.
type Case = fn(&Path, &Path) -> Result<Figures, String>;

const CASES: [(&str, Case); 24] = [
    ("bar-two-clamps", |_, folder| bar::run(folder, bar::Held::Both, "matern")),
    ("bar-two-clamps-parts", |_, folder| bar::run(folder, bar::Held::Both, "edge-preserving")),
    ("bar-one-clamp", |_, folder| bar::run(folder, bar::Held::One, "matern")),
    ("hanging-matern", |data, _| hanging::run(data, "matern", beams::Made::Cells)),
    ("hanging-parts", |data, _| hanging::run(data, "edge-preserving", beams::Made::Cells)),
    ("hanging-tet10", |data, _| hanging::run(data, "edge-preserving", beams::Made::Tetrahedra)),
    ("ten-thousand-cells", |_, folder| many::run(folder)),
    ("disk-homogeneous", |_, folder| disk::run(folder, disk::Free::Homogeneous)),
    ("disk-curve-5", |_, folder| disk::run(folder, disk::Free::Curve(4))),
    ("disk-curve-17", |_, folder| disk::run(folder, disk::Free::Curve(16))),
    ("disk-modulus", |_, folder| disk::run(folder, disk::Free::Modulus)),
    ("disk-density", |_, folder| disk::run(folder, disk::Free::Density)),
    ("coarsening-15mm", |data, folder| coarsening::run(data, folder, 0.015)),
    ("coarsening-20mm", |data, folder| coarsening::run(data, folder, 0.02)),
    ("coarsening-30mm", |data, folder| coarsening::run(data, folder, 0.03)),
    ("beams-cells", |data, _| beams::alone(data, beams::Made::Cells)),
    ("beams-tet10", |data, _| beams::alone(data, beams::Made::Tetrahedra)),
    ("beams-rayleigh", |data, _| beams::together(data, beams::Made::Cells, beams::Law::Rayleigh)),
    ("beams-viscosity", |data, _| beams::together(data, beams::Made::Cells, beams::Law::Viscosity)),
    ("beams-structural", |data, _| beams::together(data, beams::Made::Cells, beams::Law::Structural)),
    ("beams-viscosity-tet10", |data, _| beams::together(data, beams::Made::Tetrahedra, beams::Law::Viscosity)),
    ("beams-poisson", |data, _| beams::poisson(data)),
    ("moldstar-cells", |data, _| beams::moldstar(data, beams::Made::Cells)),
    ("moldstar-tet10", |data, _| beams::moldstar(data, beams::Made::Tetrahedra)),
];

/// True where a table's name asks for these cases.
pub fn is_asked(only: &str) -> bool {
    only.starts_with(NAME)
}

/// Runs the cases that a name asks for and this code has not run yet, appends a row each, and prints the last row of every case.
///
/// # Errors
/// No case has the name, one cannot be run, or a file cannot be read or written.
pub fn run(only: &str) -> Result<(), String> {
    let wanted = only.strip_prefix(NAME).unwrap_or("").trim_start_matches('-');
    if !CASES.iter().any(|c| c.0.starts_with(wanted)) {
        let names = CASES.map(|c| format!("{NAME}-{}", c.0)).join(", ");
        return Err(format!("nothing begins with {only}; there are {NAME}, {names}"));
    }
    let path = rows::path(NAME);
    let made = rows::measured(Measured::Fits)?;
    let data = std::env::var("PALPATE_DATA").unwrap_or_else(|_| table::root().join("../shared/data").display().to_string());
    for (name, case) in CASES.iter().filter(|c| c.0.starts_with(wanted)) {
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
    report()
}

/// Prints the last row of every case, and writes the table of the page.
///
/// # Errors
/// A file cannot be read or written.
pub fn report() -> Result<(), String> {
    let all = stored(&table::root())?;
    print(&all);
    table::replace(PAGE, NAME, &acceptance::markdown(&all))?;
    table::replace(PAGE, PAIRS, &acceptance::side_by_side(&all))
}

/// The last row of every case.
fn print(all: &[Row]) {
    for (name, _) in CASES {
        let Some(row) = all.iter().rev().find(|r| r.case == name) else { continue };
        let head = vec!["figure".to_string(), "value".to_string()];
        let figures = row.figures.iter().map(|(name, x)| vec![name.clone(), format!("{x:.4}")]);
        let rows: Vec<Vec<String>> = std::iter::once(head).chain(figures).collect();
        table::print(&format!("{name} ({}, {}, {:.0} s)", row.made.date, row.made.commit, row.seconds), &rows);
    }
}

/// The posterior of a fit's only field.
fn posterior(fitted: &Fitted) -> Result<&FieldPosterior, String> {
    let why = || format!("the fit has no posterior: {}; {}", fitted.verdict, fitted.warnings.join("; "));
    fitted.result.fields.first().and_then(|f| f.posterior.as_ref()).ok_or_else(why)
}

/// E of every cell as found [Pa], and its volume [m³].
fn moduli(plan: &Plan, fitted: &Fitted) -> (Vec<f64>, Vec<f64>) {
    let theta = &fitted.result.theta[0];
    let base = theta[plan.layout.index(palpate_model::params::ParamKey::YoungsModulus)];
    let places = plan.layout.resolve("field.0");
    let e = plan.fields[0].factors(&theta[places]).iter().map(|f| base * f).collect();
    (e, palpate_model::space::neighbours::Neighbours::of_elements(&plan.body).volume)
}

/// What is common to all cases.
fn common(experiment: &Experiment, fitted: &Fitted) -> Result<Figures, String> {
    let p = posterior(fitted)?;
    let (rms, noise, points) = fitted.residual();
    let run = &fitted.result.runs[fitted.result.best];
    let mut out = Figures::new();
    let mut say = |name: &str, x: f64| {
        out.insert(name.into(), x);
    };
    say("cells", experiment.plan().body.elements() as f64);
    say("residual [mm]", 1e3 * rms);
    say("residual of noise [mm]", 1e3 * noise);
    say("points", points as f64);
    say("length [m]", p.hyper.length);
    say("deviation", p.hyper.deviation);
    say("evidence of one value", p.one_value().unwrap_or(f64::NAN));
    say("effective", p.effective);
    say("residuals as one", p.temper);
    say("undetermined share", p.undetermined_share);
    say("evaluations", run.evaluations as f64);
    say("products", run.products as f64);
    say("seconds of the fit", fitted.result.seconds);
    println!("{}", fitted.verdict);
    fitted.warnings.iter().for_each(|w| println!("  {w}"));
    for t in &p.tried {
        println!("  length {:.4} m, deviation {:.2}: evidence {:+.2}", t.hyper.length, t.hyper.deviation, t.evidence);
    }
    Ok(out)
}

/// Mean over volumes of those that are chosen; NaN without any.
fn mean(of: &[f64], volume: &[f64], chosen: impl Fn(usize) -> bool) -> f64 {
    let (sum, all) = (0..of.len()).filter(|k| chosen(*k)).fold((0.0, 0.0), |(s, v), k| (s + volume[k] * of[k], v + volume[k]));
    sum / all
}
