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

use crate::paper::cases::{Case, Figures, Set};
use crate::rows::Measured;
use palpate::{Experiment, Fitted};
use palpate_fit::FieldPosterior;
use palpate_model::plan::Plan;

/// The study.
pub const SET: Set = Set {
    name: "real2sim",
    page: "docs/real2sim.md",
    cases: &CASES,
    aims: acceptance::AIMS,
    more: &[("real2sim-pairs", acceptance::side_by_side)],
    measured: Measured::Fits,
};

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
