//! A linear laboratory: residuals are smooth patterns over a ball's surface and time, one per number, plus noise.

use crate::change::Change;
use crate::laboratory::*;
use crate::linear::least_squares;
use crate::separation::{Separation, Way};
use glam::DVec3;
use palpate_engine::{ResidualRow, Source};
use palpate_model::effects::{Effect, Unstated, find};
use palpate_model::observation::Sensor;
use palpate_model::params::Transform;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub const FRAMES: usize = 24;
const POINTS: usize = 240;
pub const NOISE: f64 = 1e-3;

/// A laboratory with a hidden truth.
pub struct Bench {
    setting: Setting,
    rest: Vec<DVec3>,
    /// Noise and what no number explains `[R]` [m].
    rough: Vec<f64>,
    /// Hidden numbers: pattern's name and size.
    hidden: Vec<(String, f64)>,
    held: Vec<String>,
    /// Kinds that there is no time to fit.
    pub slow: Vec<&'static str>,
    /// True when the time is over as slack is asked for.
    pub no_slack: bool,
    /// True once somebody has asked to stop.
    pub stopped: bool,
    /// True while its own numbers are still to be fitted.
    pub unfitted: bool,
    /// Kind with which a second recording, which there is then, cannot be simulated.
    pub lost: Option<&'static str>,
    /// Simulations that it makes before it answers everything so.
    pub limit: Option<(usize, LabError)>,
    /// Iterations that there is time for.
    pub iterations: usize,
    /// Stiffness beyond which no fit gets anywhere.
    pub marsh: f64,
    /// Size of what a finer computation would change [m].
    pub grid: f64,
    /// Half of the box that places on the body lie in [m].
    pub body: f64,
}

/// A smooth pattern over place and time that a name stands for; a magnet pulls at one spot only.
pub fn pattern(name: &str, p: DVec3, t: f64) -> f64 {
    if name == "magnet" {
        let away = p.distance(DVec3::new(0.03, 0.0, 0.04)) / 0.02;
        return 4.0 * (-away * away).exp() * (20.0 * t).sin();
    }
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    name.bytes().for_each(|b| hash = (hash ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3));
    let mut sum = 0.0;
    for _ in 0..3 {
        let mut next = || {
            hash = hash.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (hash >> 40) as f64 / (1u64 << 24) as f64 * 2.0 - 1.0
        };
        let k = 25.0 * DVec3::new(next(), next(), next());
        sum += (k.dot(p) + 8.0 * next() * t + 6.0 * next()).sin();
    }
    sum
}

/// Patterns' names of a change's numbers.
fn names(change: &Change) -> Vec<String> {
    match change {
        Change::Effect(e) => {
            let name =
                |s: usize| format!("{} {s} {:?}", e.law().kind, if change.free_slots().len() > 9 { &e.values[..] } else { &[] });
            change.free_slots().into_iter().map(name).collect()
        }
        Change::Freed { paths, .. } => paths.clone(),
    }
}

impl Bench {
    /// `correlated`: pixels share their noise in patches of ten.
    pub fn new(seed: u64, hidden: &[(&str, f64)], correlated: bool) -> Bench {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
        // A spiral of ten turns: neighbours in the list are neighbours on the sphere.
        let rest: Vec<DVec3> = (0..POINTS)
            .map(|i| {
                let z = 1.0 - 2.0 * (i as f64 + 0.5) / POINTS as f64;
                let a = i as f64 * 20.0 * std::f64::consts::PI / POINTS as f64;
                0.05 * DVec3::new((1.0 - z * z).sqrt() * a.cos(), (1.0 - z * z).sqrt() * a.sin(), z)
            })
            .collect();
        let mut rough = Vec::new();
        for _ in 0..FRAMES {
            let mut shared = 0.0;
            for i in 0..POINTS {
                if i % 10 == 0 {
                    shared = gauss();
                }
                rough.push(NOISE * if correlated { shared } else { gauss() });
            }
        }
        let held = vec![
            "material.poisson_ratio".to_string(),
            "world.gravity.x".into(),
            "world.gravity.y".into(),
            "world.gravity.z".into(),
        ];
        let setting = Setting {
            center: DVec3::ZERO,
            bounds: (DVec3::splat(-0.05), DVec3::splat(0.05)),
            up: DVec3::Z,
            places: rest.iter().step_by(30).copied().collect(),
            spot: 0.01,
            cameras: 1,
            sight: true,
            markers: 0,
            cells: true,
            held: held.clone(),
            contact: vec![vec![(0.5, 0.8)]],
            still: Vec::new(),
            walls: Vec::new(),
        };
        Bench {
            setting,
            rest,
            rough,
            hidden: hidden.iter().map(|h| (h.0.to_string(), h.1)).collect(),
            held,
            lost: None,
            slow: Vec::new(),
            no_slack: false,
            stopped: false,
            unfitted: false,
            limit: None,
            iterations: usize::MAX,
            marsh: f64::INFINITY,
            grid: 2e-4,
            body: 0.05,
        }
    }

    /// Where the fit of its own numbers starts: a little off.
    pub fn start(&self) -> Model {
        let numbers = self.numbers(&[]).unwrap();
        let values: Vec<f64> = numbers.iter().map(|n| n.start + 5.0 * NOISE).collect();
        Model { changes: Vec::new(), errors: vec![Some(0.1 * NOISE); values.len()], values, numbers }
    }

    /// Counts a simulation, as long as there may be another one.
    fn simulate(&mut self) -> Result<(), LabError> {
        match &mut self.limit {
            Some((0, why)) => Err(why.clone()),
            Some((left, _)) => {
                *left -= 1;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Why there will be no other simulation, if so.
    fn over(&self) -> Option<&LabError> {
        self.limit.as_ref().filter(|(left, _)| *left == 0).map(|(_, why)| why)
    }

    /// Name of the pattern of the first number of an effect.
    pub fn first_pattern(kind: &str) -> String {
        names(&Change::Effect(Effect::absent(find(kind).unwrap()))).remove(0)
    }

    pub fn baseline(&mut self) -> Model {
        let start = self.numbers(&[]).unwrap().iter().map(|n| n.start).collect();
        self.fit(&[Start { changes: Vec::new(), values: start, reach: f64::INFINITY }], 1, 0.0).remove(0).unwrap().model
    }

    fn all_names(&self, changes: &[Change]) -> Vec<String> {
        ["stiffness".to_string(), "damping".to_string()].into_iter().chain(changes.iter().flat_map(names)).collect()
    }

    fn readings(&self, changes: &[Change], values: &[f64], from: usize) -> Readings {
        let names = self.all_names(changes);
        let q = names.len() - from;
        let mut out = Readings { columns: q, ..Readings::default() };
        let mut rows = Vec::new();
        let offsets: Vec<f64> = self.numbers(changes).unwrap().iter().map(|n| n.start).collect();
        for frame in 0..FRAMES {
            let time = frame as f64 / FRAMES as f64;
            for (i, p) in self.rest.iter().enumerate() {
                let d: Vec<f64> = names.iter().map(|n| pattern(n, *p, time)).collect();
                let mut value = self.rough[frame * POINTS + i];
                value += self.hidden.iter().map(|(n, x)| x * pattern(n, *p, time)).sum::<f64>();
                value += d.iter().zip(values).zip(&offsets).map(|((d, v), o)| d * (v - o)).sum::<f64>();
                let row = ResidualRow {
                    frame,
                    source: Source::point(i as u32, Sensor::Camera(0)),
                    value: Some(value),
                    noise: NOISE,
                    weight: 1.0,
                    rest: *p,
                    along_sight: 1.0,
                    by_place: DVec3::X,
                };
                out.cost += 0.5 * (value / NOISE).powi(2) / (FRAMES * POINTS) as f64;
                rows.push(Reading { scene: 0, time, row });
                out.sensitivity.extend(&d[from..]);
            }
        }
        out.rows = std::sync::Arc::new(rows);
        out
    }
}

impl Laboratory for Bench {
    fn setting(&self) -> &Setting {
        &self.setting
    }

    fn numbers(&self, changes: &[Change]) -> Result<Vec<Number>, LabError> {
        let transform = Transform::Linear;
        let number = |path: String, start: f64, bounds: (f64, f64)| Number {
            path,
            unit: "1".into(),
            start,
            bounds,
            scale: 1e-3,
            transform,
            known: None,
        };
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let mut out = vec![number("stiffness".into(), 0.0, free), number("damping".into(), 0.0, free)];
        for c in changes {
            for s in c.free_slots() {
                out.push(match c {
                    Change::Effect(e) => {
                        let p = &e.law().params[s];
                        let on_body = matches!(p.default, Unstated::OnBody);
                        let bounds = if on_body { (-self.body, self.body) } else { (p.lower, p.upper) };
                        number(p.key.into(), e.values[s].unwrap_or(0.0), bounds)
                    }
                    Change::Freed { paths, .. } => number(paths[s].clone(), 0.3, free),
                });
            }
        }
        assert!(self.held.len() == 4);
        Ok(out)
    }

    fn is_fitted(&self) -> bool {
        !self.unfitted
    }

    /// One simulation for each of three steps: a third of the way, two thirds, all of it.
    fn baseline(&mut self, start: Model) -> Result<Baseline, LabError> {
        self.unfitted = false;
        let best = {
            let mut whole = Bench { limit: None, ..Bench::new(0, &[], false) };
            (whole.rough, whole.hidden) = (self.rough.clone(), self.hidden.clone());
            whole.baseline()
        };
        let mut model = start.clone();
        for step in 1..=3 {
            if self.simulate().is_err() {
                return Ok(Baseline { model, cut: Some(format!("the search was stopped after {} iterations", step - 1)) });
            }
            let way = f64::from(step) / 3.0;
            model.values = start.values.iter().zip(&best.values).map(|(a, b)| a + way * (b - a)).collect();
        }
        Ok(Baseline { model, cut: None })
    }

    fn costs(&mut self, tries: &[(Vec<Change>, Vec<f64>)]) -> Vec<f64> {
        let mut one = |(c, v): &(Vec<Change>, Vec<f64>)| match self.simulate() {
            Ok(()) => self.readings(c, v, v.len()).cost,
            Err(_) => f64::INFINITY,
        };
        tries.iter().map(&mut one).collect()
    }

    fn fit(&mut self, tries: &[Start], _: usize, _: f64) -> Vec<Result<Fit, LabError>> {
        let mut one = |Start { changes, values, .. }: &Start| {
            if changes.last().is_some_and(|c| self.slow.contains(&c.kind())) {
                return Err(LabError::NoTime);
            }
            self.simulate()?;
            let r = self.readings(changes, values, 0);
            let columns: Vec<Vec<f64>> =
                (0..r.columns).map(|k| r.sensitivity.iter().skip(k).step_by(r.columns).copied().collect()).collect();
            let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
            let y: Vec<f64> = r.rows.iter().map(|r| r.row.value.unwrap()).collect();
            let stuck = if values[0].abs() > self.marsh { 0.0 } else { 1.0 };
            let step = least_squares(&chosen, &y, 0.0).unwrap();
            let values = values.iter().zip(&step).map(|(v, s)| v + stuck * s).collect::<Vec<f64>>();
            let cost = self.readings(changes, &values, values.len()).cost;
            let errors = vec![None; values.len()];
            Ok(Fit {
                model: Model { changes: changes.clone(), numbers: self.numbers(changes)?, errors, values },
                cost,
                promised: 0.0,
                reach: f64::INFINITY,
                settled: true,
            })
        };
        tries.iter().map(&mut one).collect()
    }

    fn linearise(&mut self, tries: &[(Vec<Change>, Vec<f64>)]) -> Vec<Result<Readings, LabError>> {
        self.linearise_new(tries, 0)
    }

    fn linearise_new(&mut self, tries: &[(Vec<Change>, Vec<f64>)], from: usize) -> Vec<Result<Readings, LabError>> {
        let is_slack = |c: &[Change]| c.last().is_some_and(|c| c.kind() == "slack");
        let mut out = Vec::new();
        // Eight of them take one simulation.
        for chunk in tries.chunks(8) {
            let simulated = self.simulate();
            let one = |(c, v): &(Vec<Change>, Vec<f64>)| match self.no_slack && is_slack(c) {
                true => Err(LabError::NoTime),
                false => Ok(self.readings(c, v, from)),
            };
            match simulated {
                Ok(()) => out.extend(chunk.iter().map(one)),
                Err(why) => out.resize_with(tries.len(), || Err(why.clone())),
            }
        }
        out.truncate(tries.len());
        out
    }

    fn finer(&mut self, _: &[Change], _: &[f64]) -> Result<Vec<Field>, LabError> {
        if self.stopped {
            return Err(LabError::Interrupted);
        }
        self.simulate()?;
        let at = |i: usize| pattern("grid", self.rest[i % POINTS], (i / POINTS) as f64 / FRAMES as f64);
        let change = (0..FRAMES * POINTS).map(|i| Some(self.grid * at(i))).collect();
        Ok(vec![Field::refined("grid", change)])
    }

    fn held_out(&mut self, model: &Model) -> Result<Option<Readings>, LabError> {
        let Some(lost) = self.lost else { return Ok(None) };
        if model.changes.iter().any(|c| c.kind() == lost) {
            return Err(LabError::failed("the step did not converge"));
        }
        self.linearise(&[(model.changes.clone(), model.values.clone())]).pop().transpose()
    }

    fn separations(&mut self, _: &Model, rivals: &[&Model]) -> Vec<Separation> {
        let differences = vec![(2.0 * NOISE, NOISE); rivals.len()];
        vec![Separation { measurement: "from twice the height".into(), way: Way::default(), differences }]
    }

    fn out_of_time(&self) -> bool {
        matches!(self.over(), Some(LabError::NoTime))
    }

    fn iterations_left(&self) -> usize {
        self.iterations
    }

    fn interrupted(&self) -> bool {
        self.stopped || matches!(self.over(), Some(LabError::Interrupted))
    }

    fn say(&mut self, what: &str) {
        println!("{what}");
    }
}
