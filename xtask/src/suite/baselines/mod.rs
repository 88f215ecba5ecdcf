//! What a diagnosis is measured against, in the same rows: a plain fit that takes its model for true ([`plain`]), a free force field
//! ([`field`]), and a Gaussian-process discrepancy ([`process`]). The last two work on the linearised fit: residuals and sensitivities at the
//! fitted numbers, averaged over regions of the body in each frame.

mod dense;
pub mod field;
mod kernel;
pub mod process;

use super::answer::{Answer, Block};
use super::regions::Bins;
use palpate::{Backend, Error, Experiment, FitOptions, fit};
use palpate_cpu::CpuBackend;
use palpate_engine::{ResidualRow, Rollout, Stream};
use palpate_model::scene::Scene;
use palpate_model::shape::shape_of;
use std::collections::BTreeMap;

/// Fewest points of a depth image in a cell: fewer come and go at silhouettes.
const FEWEST: usize = 4;
/// Probability of an alarm by chance at which a baseline says that something is missing; the same as the diagnosis'.
const RATE: f64 = 0.01;

/// Readings of a sensor in a region of the body in one frame, averaged.
#[derive(Clone, Debug)]
pub struct Cell {
    /// What was read.
    pub stream: Stream,
    /// Mean place on the rest shape [m].
    pub place: glam::DVec3,
    /// Time [s].
    pub time: f64,
    /// Mean residual [m].
    pub residual: f64,
    /// Standard deviation of that by noise alone [m].
    pub noise: f64,
    /// Mean sensitivities `[Q]`.
    pub columns: Vec<f64>,
}

/// A fit, linearised.
pub struct Linear {
    /// Cells.
    pub cells: Vec<Cell>,
    /// How many of the columns belong to the free numbers, which come first; each is by its number's relative change, or by one where that is 0.
    pub free: usize,
    /// Place of Young's modulus among them.
    modulus: Option<usize>,
    /// Its fitted value [Pa].
    fitted: Option<f64>,
    /// Paths and fitted values of the free numbers.
    values: Vec<(String, f64)>,
    /// Root mean square of single residuals and of their noise [m].
    distance: [f64; 2],
}

/// Fits an experiment and linearises it there, with columns of `more` numbers of a scene that has something added where it is absent.
///
/// # Errors
/// It cannot be fitted or simulated.
pub fn linearise(e: &Experiment, add: impl FnOnce(&mut Scene) -> Vec<String>) -> Result<Linear, Error> {
    let fitted = fit(std::slice::from_ref(e), FitOptions { backend: Backend::Cpu, ..FitOptions::default() })?;
    let mut scene = e.scene().clone();
    let more = add(&mut scene);
    let changed = Experiment::new(scene, String::new(), Vec::new())?;
    let (plan, old) = (changed.plan(), e.plan());
    let mut theta = plan.theta.clone();
    for (key, v) in old.layout.keys.iter().zip(&fitted.result.theta[0]) {
        if let Some(k) = plan.layout.keys.iter().position(|k| k == key) {
            theta[k] = *v;
        }
    }
    let free: Vec<usize> = fitted.result.parameters.iter().flat_map(|p| plan.layout.resolve(&p.path)).collect();
    let mut places = free.clone();
    places.extend(more.iter().flat_map(|path| plan.layout.resolve(path)));
    let l = Rollout::new(CpuBackend, plan, 1)?.linearise(&theta, &places)?;
    let scale: Vec<f64> = places.iter().map(|k| if theta[*k] == 0.0 { 1.0 } else { theta[*k].abs() }).collect();
    let start = e.scene().time.start;
    let bins = Bins::new(shape_of(&e.scene().object).bounds(), (start, e.end_time()));
    let time = |r: &ResidualRow| plan.observation.frames[r.frame].time;
    let modulus = fitted.result.parameters.iter().position(|p| p.path == "material.youngs_modulus");
    let matched: Vec<&ResidualRow> = l.rows.residuals.iter().filter(|r| r.value.is_some()).collect();
    let mean_square = |f: &dyn Fn(&ResidualRow) -> f64| {
        (matched.iter().map(|r| f(r).powi(2)).sum::<f64>() / matched.len().max(1) as f64).sqrt()
    };
    Ok(Linear {
        cells: gather(&l.rows.residuals, &l.rows.sensitivity, &scale, &bins, time),
        free: free.len(),
        modulus,
        fitted: modulus.map(|k| fitted.result.parameters[k].value),
        values: fitted.result.parameters.iter().map(|p| (p.path.clone(), p.value)).collect(),
        distance: [mean_square(&|r| r.value.unwrap_or(0.0)), mean_square(&|r| r.noise)],
    })
}

fn gather(rows: &[ResidualRow], columns: &[f64], scale: &[f64], bins: &Bins, time: impl Fn(&ResidualRow) -> f64) -> Vec<Cell> {
    let q = scale.len();
    let mut all: BTreeMap<(Stream, usize, usize), Vec<usize>> = BTreeMap::new();
    for (k, r) in rows.iter().enumerate().filter(|(_, r)| r.value.is_some() && r.weight > 0.0) {
        // A marker is a place of its own.
        let region = if r.source.is_depth() { bins.region(r.rest) } else { 1000 + r.source.item as usize };
        all.entry((r.source.stream(), region, r.frame)).or_default().push(k);
    }
    let of = |(stream, members): (Stream, Vec<usize>)| {
        let n = members.len() as f64;
        let mean = |f: &dyn Fn(usize) -> f64| members.iter().map(|k| f(*k)).sum::<f64>() / n;
        Cell {
            stream,
            place: members.iter().map(|k| rows[*k].rest).sum::<glam::DVec3>() / n,
            time: time(&rows[members[0]]),
            residual: mean(&|k| rows[k].value.unwrap_or(0.0)),
            noise: rows[members[0]].noise / n.sqrt(),
            columns: (0..q).map(|c| scale[c] * mean(&|k| columns[k * q + c])).collect(),
        }
    };
    let enough =
        |(_, members): &((Stream, usize, usize), Vec<usize>)| !rows[members[0]].source.is_depth() || members.len() >= FEWEST;
    all.into_iter().filter(enough).map(|((stream, ..), members)| of((stream, members))).collect()
}

impl Linear {
    /// Columns `[Q][M]` and residuals `[M]`, both in standard deviations of the cells.
    fn in_noise(&self) -> (Vec<Vec<f64>>, Vec<f64>) {
        let q = self.cells.first().map_or(0, |c| c.columns.len());
        let column = |k: usize| self.cells.iter().map(|c| c.columns[k] / c.noise).collect();
        ((0..q).map(column).collect(), self.cells.iter().map(|c| c.residual / c.noise).collect())
    }

    /// The answer of a model whose free numbers move by `change` (as the columns count), and which calls cells missing.
    fn answer(&self, case: &str, p_value: f64, change: &[f64], missing: &[bool]) -> Answer {
        let sees = p_value < RATE;
        let after = self.modulus.zip(self.fitted).map(|(k, v)| v * (1.0 + change.get(k).copied().unwrap_or(0.0)));
        let block = |(c, m): (&Cell, &bool)| Block { place: c.place.to_array(), time: [c.time; 2], missing: sees && *m };
        Answer {
            case: case.into(),
            verdict: if sees { "unexplained" } else { "adequate" }.into(),
            map: self.cells.iter().zip(missing).map(block).collect(),
            modulus: [self.fitted, if sees { after } else { self.fitted }],
            parameters: self.values.clone(),
            distance: Some([self.distance[0], self.distance[0], self.distance[1]]),
            ..Answer::default()
        }
    }
}

/// A fit that takes its model for true.
///
/// # Errors
/// It cannot be fitted.
pub fn plain(case: &str, e: &Experiment) -> Result<Answer, Error> {
    let l = linearise(e, |_| Vec::new())?;
    Ok(l.answer(case, 1.0, &[], &vec![false; l.cells.len()]))
}
