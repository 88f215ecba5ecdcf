//! The laboratory over experiments: fits and linearises hypotheses, several side by side.

use super::DiagnoseOptions;
use super::checkpoint::Checkpoint;
use super::hypothesis::{Prepared, held, lab_error, prepare};
use super::laps::{Lap, Laps, fit};
use super::limits::Limits;
use super::others::{contact_times, held_out, still_frames};
use super::refined::{GRID, STEP, difference, finer, halved};
use super::separate::separations;
use super::systematic::systematic;
use super::walls::walls;
use super::world::strange;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::fingerprint;
use crate::interrupt::Interrupt;
use palpate_cpu::CpuBackend;
use palpate_diagnose::{
    Change, Field, Fit, LabError, Laboratory, Model, Number, Reading, Readings, Regions, Separation, Setting, Start, Strange,
};
use palpate_engine::Rollout;
use palpate_fit::{FitScene, Problem, Sample, Want};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};
use std::time::Instant;

/// Most bytes of tangents of one simulation that computes the sensitivities of several hypotheses.
const MEMORY: usize = 1 << 29;
/// Newton's tolerance over the relative decrease of the cost that a fit is after: forces that are off by 1e-6 move costs by less than 1e-4.
pub(super) const NEWTON: f64 = 5e-3;
/// Simulations with sensitivities that an iteration of a fit costs: that at its end, and costs along the way.
const ITERATION: f64 = 3.0;
/// Bytes of one tangent per node: displacement and velocity, before and after a step.
const TANGENT: usize = 2 * 2 * 24;

/// A set of changes with values of all free numbers.
type Try = (Vec<Change>, Vec<f64>);

pub(super) struct Lab<'a> {
    base: Vec<Experiment>,
    held_out: Option<&'a Experiment>,
    backend: Backend,
    setting: Setting,
    deadline: Option<Instant>,
    interrupt: Interrupt,
    /// Why the device failed, if it did: the end of the search, as if it had been interrupted.
    broken: OnceLock<String>,
    checkpoint: Checkpoint,
    laps: Laps,
    finer: Option<Vec<Experiment>>,
    /// Refinements whose time is set aside of the search's.
    set_aside: Vec<&'static str>,
    /// Time that one thread takes for a hypothesis with its sensitivities [s]; 0 before the first one.
    seconds: f64,
    say: &'a mut (dyn FnMut(&str) + Send),
}

impl<'a> Lab<'a> {
    pub fn new(
        base: &[Experiment],
        held_out: Option<&'a Experiment>,
        options: &DiagnoseOptions,
        deadline: Option<Instant>,
        say: &'a mut (dyn FnMut(&str) + Send),
    ) -> Result<Lab<'a>, Error> {
        let first = &base[0];
        let body = &first.plan.body;
        let points: Vec<_> = body.patches.iter().map(|p| p.point).collect();
        let regions = Regions::new(&points, 4);
        let nearest = |c: &glam::DVec3| points.iter().copied().min_by(|a, b| a.distance(*c).total_cmp(&b.distance(*c)));
        let backend = options.backend;
        let (contact, (still, walls)) = rayon::join(
            || base.iter().map(|e| contact_times(e, backend)).collect::<Result<_, _>>(),
            || (base.iter().map(|e| still_frames(e, backend)).collect::<Result<_, _>>(), walls(base).unwrap_or_default()),
        );
        let most = |f: fn(&Experiment) -> usize| base.iter().map(f).max().unwrap_or(0);
        let setting = Setting {
            center: body.center,
            bounds: first.shape().bounds(),
            up: first.up(),
            places: regions.centers.iter().filter_map(nearest).collect(),
            spot: 0.5 * body.length,
            cameras: most(|e| e.plan.observation.cameras.len()),
            markers: most(|e| e.plan.observation.marker_count()),
            held: held(base),
            contact: contact?,
            still: still?,
            walls,
        };
        let checkpoint = Checkpoint::open(options.checkpoints.as_ref().map(|(f, r)| (f.as_path(), *r)))?;
        Ok(Lab {
            base: base.to_vec(),
            held_out,
            backend: options.backend,
            setting,
            deadline,
            interrupt: options.interrupt.clone(),
            broken: OnceLock::new(),
            checkpoint,
            laps: Laps::default(),
            finer: None,
            set_aside: Vec::new(),
            seconds: 0.0,
            say,
        })
    }

    /// Keeps as much of the search's time for the refinement of the answer as that of the baseline took, up to a quarter of what is left.
    fn set_aside(&mut self, what: &'static str, began: Instant) {
        if !self.set_aside.contains(&what) {
            self.set_aside.push(what);
            let quarter = |d: Instant| d.saturating_duration_since(Instant::now()) / 4;
            self.deadline = self.deadline.map(|d| d - began.elapsed().min(quarter(d)));
        }
    }

    /// Why the device failed, if it did.
    pub fn broken(&self) -> Option<String> {
        self.broken.get().cloned()
    }

    fn limits(&self) -> Limits<'_> {
        Limits { interrupt: &self.interrupt, broken: &self.broken, deadline: self.deadline }
    }

    fn key(&self, start: &Start, effort: (usize, f64)) -> String {
        let prints: Vec<String> = self.base.iter().map(|e| fingerprint(&e.plan)).collect();
        let theta: Vec<&[f64]> = self.base.iter().map(|e| e.plan.theta.as_slice()).collect();
        format!("{prints:?} {theta:?} {start:?} {effort:?}")
    }
}

/// The problem of fitting one hypothesis from a start, with its numbers; Newton's method in it is no tighter than `newton`.
pub(super) fn problem(
    base: &[Experiment],
    backend: Backend,
    limits: Limits,
    (changes, start): (&[Change], &[f64]),
    newton: f64,
    before: Option<&Lap>,
) -> Result<(Problem<'static>, Vec<Number>), LabError> {
    let mut ready = prepare(base, changes).map_err(lab_error)?;
    let numbers = ready.numbers();
    for ((f, v), n) in ready.free.iter_mut().zip(start).zip(&numbers) {
        // Numbers fitted as logarithms start above zero, where a scene leaves them at zero.
        let low = if f.transform == palpate_model::params::Transform::Log { f.bounds.0.max(1e-2 * n.scale) } else { f.bounds.0 };
        let v = v.clamp(low, f.bounds.1);
        f.start = (v, v);
        // The longest step of an iteration counts in typical sizes: a number that starts far above its own may change by as much as it is.
        f.typical = f.typical.max(v.abs());
    }
    for (f, typical) in ready.free.iter_mut().zip(before.iter().flat_map(|lap| &lap.typical)) {
        f.typical = *typical;
    }
    let mut scenes = Vec::new();
    for e in &mut ready.experiments {
        e.plan.solver.tolerance = e.plan.solver.tolerance.max(newton);
        scenes.push(FitScene {
            name: e.scene.path.display().to_string(),
            fingerprint: String::new(),
            base: e.plan.theta.clone(),
            evaluate: backend.evaluator_until(&e.plan, 1, limits.interrupt.at_once()).map_err(lab_error)?,
        });
    }
    Ok((Problem::new(scenes, ready.free).map_err(LabError::failed)?, numbers))
}

/// Cost of one hypothesis at these values.
fn cost(base: &[Experiment], backend: Backend, limits: Limits, (changes, values): &Try) -> Result<f64, LabError> {
    limits.check()?;
    let (mut problem, _) = problem(base, backend, limits, (changes, values), NEWTON * 1e-3, None)?;
    let values = problem.free().iter().map(|f| f.start.0).collect();
    let Some(sample) = problem.evaluate_values(&[values], Want::Cost).into_iter().next() else { return Ok(f64::INFINITY) };
    match sample {
        Sample { broken: true, failure, .. } => Err(limits.break_off(failure.unwrap_or_default())),
        Sample { stopped: true, .. } => Err(LabError::Interrupted),
        s => Ok(s.cost),
    }
}

/// Residuals of every scene, with derivatives by the numbers from `from` on. Always the reference backend: statistics want its precision.
pub(super) fn linearise(ready: &Prepared, values: &[f64], from: usize) -> Result<Readings, LabError> {
    linearise_some(ready, values, from, |_| true)
}

/// The same, with zeros for derivatives by numbers (counted from `from`) that are not wanted: they cost nothing.
fn linearise_some(ready: &Prepared, values: &[f64], from: usize, wanted: impl Fn(usize) -> bool) -> Result<Readings, LabError> {
    let columns = ready.free.len() - from;
    let mut out = Readings { columns, ..Readings::default() };
    let (mut rows, mut residuals) = (Vec::new(), 0.0);
    for (scene, e) in ready.experiments.iter().enumerate() {
        let free = ready.free[from..].iter().enumerate().filter(|(k, _)| wanted(*k));
        let slots = free.flat_map(|(k, f)| f.slots.iter().filter(|s| s.scene == scene).map(move |s| (k, s.place, s.factor)));
        let one = along(e, scene, &ready.theta(scene, values), &slots.collect::<Vec<_>>(), columns)?;
        let n = one.rows.len().max(1) as f64;
        out.cost += n * one.cost;
        residuals += n;
        rows.extend_from_slice(&one.rows);
        out.sensitivity.extend(one.sensitivity);
    }
    out.cost /= f64::max(residuals, 1.0);
    out.rows = Arc::new(rows);
    Ok(out)
}

/// Residuals of one experiment, with derivatives by `columns` numbers: each direction is a number's column, a place in θ, and the factor by
/// which the number acts there.
pub(super) fn along(
    e: &Experiment,
    scene: usize,
    theta: &[f64],
    directions: &[(usize, usize, f64)],
    columns: usize,
) -> Result<Readings, LabError> {
    let places: Vec<usize> = directions.iter().map(|d| d.1).collect();
    let mut rollout = Rollout::new(CpuBackend, &e.plan, 1).map_err(|e| lab_error(e.into()))?;
    let l = rollout.linearise(theta, &places).map_err(|e| lab_error(e.into()))?;
    let mut out = Readings { columns, cost: l.evaluation.cost, ..Readings::default() };
    let mut rows = Vec::new();
    for (i, row) in l.rows.residuals.iter().enumerate() {
        rows.push(Reading { scene, time: e.plan.observation.frames[row.frame].time, row: *row });
        let at = out.sensitivity.len();
        out.sensitivity.resize(at + columns, 0.0);
        for ((k, _, factor), d) in directions.iter().zip(&l.rows.sensitivity[i * places.len()..]) {
            out.sensitivity[at + k] += factor * d;
        }
    }
    out.rows = Arc::new(rows);
    Ok(out)
}

/// Several hypotheses that differ in their last change only, in one simulation: what is absent changes nothing.
fn together(base: &[Experiment], tries: &[Try], from: usize) -> Result<Vec<Readings>, LabError> {
    let (common, values) = (&tries[0].0[..tries[0].0.len() - 1], &tries[0].1[..from]);
    let mut changes = common.to_vec();
    let mut all = values.to_vec();
    let mut counts = Vec::new();
    // An effect that is absent does not depend on where it would act: only amplitudes have derivatives.
    let mut wanted: Vec<bool> = Vec::new();
    for (c, v) in tries {
        wanted.extend(c.last().into_iter().flat_map(Change::amplitudes));
        changes.extend(c.last().cloned());
        all.extend(&v[from..]);
        counts.push(v.len() - from);
    }
    let ready = prepare(base, &changes).map_err(lab_error)?;
    if ready.free.len() != all.len() {
        return Err(LabError::failed("hypotheses share a number"));
    }
    let r = linearise_some(&ready, &all, from, |k| wanted.get(k).copied().unwrap_or(true))?;
    let mut at = 0;
    let part = |n: usize| {
        let sensitivity = r.sensitivity.chunks(r.columns.max(1)).flat_map(|row| row[at..at + n].to_vec()).collect();
        at += n;
        Readings { rows: r.rows.clone(), cost: r.cost, columns: n, sensitivity }
    };
    Ok(counts.into_iter().map(part).collect())
}

/// As [`together`]; where one of them cannot be computed, halves show which.
fn many(base: &[Experiment], tries: &[Try], from: usize, limits: Limits) -> Vec<Result<Readings, LabError>> {
    if let Err(e) = limits.check() {
        return tries.iter().map(|_| Err(e.clone())).collect();
    }
    match together(base, tries, from) {
        Ok(all) => all.into_iter().map(Ok).collect(),
        Err(e) if tries.len() == 1 => vec![Err(e)],
        Err(_) => {
            let (a, b) = tries.split_at(tries.len() / 2);
            [many(base, a, from, limits), many(base, b, from, limits)].concat()
        }
    }
}

impl Laboratory for Lab<'_> {
    fn setting(&self) -> &Setting {
        &self.setting
    }

    fn numbers(&self, changes: &[Change]) -> Result<Vec<Number>, LabError> {
        Ok(prepare(&self.base, changes).map_err(lab_error)?.numbers())
    }

    fn costs(&mut self, tries: &[Try]) -> Vec<f64> {
        let (base, backend) = (&self.base, self.backend);
        let limits = self.limits();
        tries.par_iter().map(|t| cost(base, backend, limits, t).unwrap_or(f64::INFINITY)).collect()
    }

    fn fit(&mut self, tries: &[Start], iterations: usize, tolerance: f64) -> Vec<Result<Fit, LabError>> {
        let effort = (iterations, tolerance);
        let known: Vec<Option<Result<(Fit, Lap), LabError>>> = tries
            .iter()
            .map(|start| {
                let done = self.checkpoint.find(&self.key(start, effort))?;
                let (values, errors) = (done.values.clone(), done.errors.clone());
                let (cost, promised, reach, settled) = (done.cost, done.promised, done.reach, done.settled);
                let model = |numbers| Model { changes: start.changes.clone(), numbers, values, errors };
                let lap = Lap::from_document(&done.lap, reach);
                Some(self.numbers(&start.changes).map(|n| (Fit { model: model(n), cost, promised, reach, settled }, lap)))
            })
            .collect();
        let (base, backend, laps) = (&self.base, self.backend, &self.laps);
        let limits = self.limits();
        let answers: Vec<Result<(Fit, Lap), LabError>> = tries
            .par_iter()
            .zip(known)
            .map(|(t, known)| known.unwrap_or_else(|| fit(base, backend, limits, t, effort, laps.before(t))))
            .collect();
        // What the deadline cut short is not kept: with more time the fit would go on.
        let in_time = !self.out_of_time();
        for (t, a) in tries.iter().zip(&answers) {
            let Ok((f, lap)) = a else { continue };
            self.laps.keep(f, lap);
            if in_time {
                let key = self.key(t, effort);
                self.checkpoint.keep(key, f, lap);
            }
        }
        answers.into_iter().map(|a| a.map(|(f, _)| f)).collect()
    }

    fn linearise(&mut self, tries: &[Try]) -> Vec<Result<Readings, LabError>> {
        let base = &self.base;
        let one = |(c, v): &Try| linearise(&prepare(base, c).map_err(lab_error)?, v, 0);
        let began = Instant::now();
        let all = tries.par_iter().map(one).collect();
        let threads = rayon::current_num_threads().min(tries.len()) as f64;
        self.seconds = threads * began.elapsed().as_secs_f64() / tries.len().max(1) as f64;
        all
    }

    fn linearise_new(&mut self, tries: &[Try], from: usize) -> Vec<Result<Readings, LabError>> {
        let base = &self.base;
        let limits = self.limits();
        // As few simulations as there are threads, where tangents leave room: each costs its steps and one factorisation per step.
        let nodes = base.iter().map(|e| e.plan.body.nodes.len()).max().unwrap_or(1);
        let most = (MEMORY / (TANGENT * nodes)).max(1);
        let together = tries.len().div_ceil(rayon::current_num_threads()).clamp(1, most);
        tries.par_chunks(together).flat_map_iter(|chunk| many(base, chunk, from, limits)).collect()
    }

    fn finer(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
        if self.limits().is_over() {
            return Err(LabError::Interrupted);
        }
        let began = Instant::now();
        let ready = prepare(&self.base, changes).map_err(lab_error)?;
        let none = ready.free.len();
        let coarse = linearise(&ready, values, none)?;
        if self.finer.is_none() {
            self.finer = Some(self.base.iter().map(finer).collect::<Result<_, Error>>().map_err(lab_error)?);
        }
        let fine = prepare(self.finer.as_deref().unwrap_or(&[]), changes).map_err(lab_error)?;
        let mut short = prepare(&self.base, changes).map_err(lab_error)?;
        short.experiments = short.experiments.into_iter().map(halved).collect();
        let change = |name, ready: &Prepared, factor| -> Result<Field, LabError> {
            Ok(difference(name, &linearise(ready, values, none)?, &coarse, factor))
        };
        let (grid, step) = rayon::join(|| change("grid", &fine, GRID), || change("step", &short, STEP));
        let is_static = self.base.iter().all(|e| e.plan.clock.steps == 0);
        self.set_aside("recordings", began);
        Ok(if is_static { vec![grid?] } else { vec![grid?, step?] })
    }

    fn systematic(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
        systematic(&self.base, changes, values)
    }

    fn held_out(&mut self, model: &Model) -> Result<Option<Readings>, LabError> {
        self.held_out.map(|e| held_out(e, &self.base, self.backend, self.limits(), model)).transpose()
    }

    fn held_out_finer(&mut self, model: &Model, coarse: &Readings) -> Result<Vec<Field>, LabError> {
        let Some(e) = self.held_out else { return Ok(Vec::new()) };
        let (base, backend, began) = (&self.base, self.backend, Instant::now());
        let mut fields = Vec::new();
        for (name, e, factor) in [("grid", finer(e).map_err(lab_error)?, GRID), ("step", halved(e.clone()), STEP)] {
            fields.push(difference(name, &held_out(&e, base, backend, self.limits(), model)?, coarse, factor));
        }
        self.set_aside("held out", began);
        Ok(fields)
    }

    fn separations(&mut self, named: &Model, rivals: &[&Model]) -> Vec<Separation> {
        // What else may be missing comes first.
        let quarter = |d: Instant| Instant::now() + d.saturating_duration_since(Instant::now()) / 4;
        let limits = Limits { deadline: self.deadline.map(quarter), ..self.limits() };
        let models: Vec<&Model> = std::iter::once(&named).chain(rivals).copied().collect();
        separations(&self.base, self.backend, &models, &|| limits.check().is_ok())
    }

    fn strange(&self, model: &Model) -> Vec<Strange> {
        prepare(&self.base, &model.changes).map_or_else(|_| Vec::new(), |ready| strange(&ready, &model.values, &model.errors))
    }

    fn iterations_left(&self) -> usize {
        let Some(deadline) = self.deadline else { return usize::MAX };
        let left = deadline.saturating_duration_since(Instant::now()).as_secs_f64() * rayon::current_num_threads() as f64;
        (left / (ITERATION * self.seconds).max(1e-6)) as usize
    }

    fn out_of_time(&self) -> bool {
        self.deadline.is_some_and(|d| Instant::now() > d)
    }

    fn interrupted(&self) -> bool {
        self.limits().is_over()
    }

    fn say(&mut self, what: &str) {
        (self.say)(what);
    }
}
