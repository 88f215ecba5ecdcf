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
use crate::fitting::{self, FitOptions, Fitted, fingerprint};
use palpate_cpu::CpuBackend;
use palpate_diagnose::{
    Baseline, Change, Field, Fit, LabError, Laboratory, Model, Number, Reading, Readings, Regions, Separation, Setting, Start,
    Strange,
};
use palpate_engine::Rollout;
use palpate_fit::{FitScene, FreeParameter, Problem, Sample, Status, Want};
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most bytes of tangents of one simulation that computes the sensitivities of several hypotheses.
const MEMORY: usize = 1 << 29;
/// Newton's tolerance over the relative decrease of the cost that a fit is after: forces that are off by 1e-6 move costs by less than 1e-4.
pub(super) const NEWTON: f64 = 5e-3;
/// Simulations with sensitivities that an iteration of a fit costs: that at its end, and costs along the way.
const ITERATION: f64 = 3.0;
/// Bytes of one tangent per node: displacement and velocity, before and after a step.
const TANGENT: usize = 2 * 2 * 24;

/// Relative decrease of the cost at which the baseline has arrived: what its numbers move by after that is projected out of everything.
const BASELINE: f64 = 1e-6;
/// What the looks at the baseline take over what those at the starting model took, where its fit is cut short.
const AGAIN: f64 = 1.25;
/// Reasons of a fit that was cut short that are told: how far it came, and how far away the optimum is.
const REASONS: usize = 2;
/// Shares of the time left that are taken for the look at the starting model, for what bodies touch, and for what finer computations change.
const LOOKED: f64 = 1.0 / 3.0;
const SETTLED: f64 = 0.2;
const REFINED: f64 = 0.5;
/// Hypotheses that a thread computes together at first; twice as many each time, as long as they take no more than this share of the time left.
const FIRST: usize = 1;
const WAVE: f64 = 0.5;
/// What a last look may take after somebody asked to stop: the half of what he is told that it takes.
const GRACE: Duration = Duration::from_secs(1);

/// A set of changes with values of all free numbers.
type Try = (Vec<Change>, Vec<f64>);

pub(super) struct Lab<'a> {
    base: Vec<Experiment>,
    held_out: Option<&'a Experiment>,
    backend: Backend,
    setting: Setting,
    limits: Limits,
    /// When it was opened: the look at the starting model began.
    opened: Duration,
    /// Time kept for the answer, and for the refinement of what it names.
    answer: Duration,
    refinement: Duration,
    /// Of which refinements that is.
    set_aside: Vec<&'static str>,
    journal: Option<(PathBuf, bool)>,
    /// True where the scenes' own numbers are still to be fitted.
    open: bool,
    fitted: Option<Fitted>,
    /// Why the fit of the baseline has no result.
    fault: Option<Error>,
    checkpoint: Checkpoint,
    laps: Laps,
    finer: Option<Vec<Experiment>>,
    /// Time that one thread takes for a hypothesis with its sensitivities [s]; 0 before the first one.
    seconds: f64,
    say: &'a mut (dyn FnMut(&str) + Send),
}

impl<'a> Lab<'a> {
    /// A laboratory over these experiments, whose own numbers are to be fitted where they leave any free.
    pub fn new(
        experiments: &[Experiment],
        held_out: Option<&'a Experiment>,
        options: &DiagnoseOptions,
        say: &'a mut (dyn FnMut(&str) + Send),
    ) -> Result<Lab<'a>, Error> {
        let first = &experiments[0];
        let body = &first.plan.body;
        let points: Vec<_> = body.patches.iter().map(|p| p.point).collect();
        let regions = Regions::new(&points, 4);
        let nearest = |c: &glam::DVec3| points.iter().copied().min_by(|a, b| a.distance(*c).total_cmp(&b.distance(*c)));
        let most = |f: fn(&Experiment) -> usize| experiments.iter().map(f).max().unwrap_or(0);
        let setting = Setting {
            center: body.center,
            bounds: first.shape().bounds(),
            up: first.up(),
            places: regions.centers.iter().filter_map(nearest).collect(),
            spot: 0.5 * body.length,
            cameras: most(|e| e.plan.observation.cameras.len()),
            markers: most(|e| e.plan.observation.marker_count()),
            held: held(experiments),
            contact: Vec::new(),
            still: Vec::new(),
            walls: Vec::new(),
        };
        let is_free = |e: &Experiment| e.scene().fit.as_ref().is_some_and(|f| !f.parameters.is_empty());
        let limits = Limits::new(&options.interrupt, &options.clock, options.budget);
        let folder = options.checkpoints.as_ref();
        let mut lab = Lab {
            base: experiments.to_vec(),
            held_out,
            backend: options.backend,
            setting,
            opened: limits.elapsed(),
            limits,
            answer: Duration::ZERO,
            refinement: Duration::ZERO,
            set_aside: Vec::new(),
            journal: folder.map(|(folder, resume)| (folder.join("journal.jsonl"), *resume)),
            open: experiments.iter().any(is_free),
            fitted: None,
            fault: None,
            checkpoint: Checkpoint::open(folder.map(|(f, r)| (f.as_path(), *r)))?,
            laps: Laps::default(),
            finer: None,
            seconds: 0.0,
            say,
        };
        if !lab.open {
            lab.settle()?;
        }
        Ok(lab)
    }

    /// The model that a diagnosis starts from: the scenes' own values where a fit may start there.
    pub fn start(&self) -> Result<Model, Error> {
        let ready = prepare(&self.base, &[])?;
        let numbers = ready.numbers();
        let from = |((f, own), n): ((&FreeParameter, f64), &Number)| {
            if self.open && !(f.start.0..=f.start.1).contains(&own) { n.start } else { own }
        };
        let values: Vec<f64> = ready.free.iter().zip(ready.own_values()).zip(&numbers).map(from).collect();
        Ok(Model { changes: Vec::new(), errors: vec![None; values.len()], values, numbers })
    }

    /// Finds out when bodies touch something or rest, and what else they may touch; without time for it none of that is known.
    fn settle(&mut self) -> Result<(), Error> {
        let (base, backend) = (&self.base, self.backend);
        let limits = self.search().share(SETTLED);
        let stop = limits.stop();
        let (contact, (still, walls)) = rayon::join(
            || base.iter().map(|e| contact_times(e, backend, &stop)).collect::<Result<Vec<_>, _>>(),
            || (base.iter().map(|e| still_frames(e, backend, &stop)).collect::<Result<Vec<_>, _>>(), walls(base, &limits)),
        );
        self.setting.walls = walls.unwrap_or_default();
        if stop.is_over() {
            return Ok(());
        }
        (self.setting.contact, self.setting.still) = (contact?, still?);
        Ok(())
    }

    /// Keeps as much of the search's time for the refinement of the answer as that of the baseline took, up to a quarter of what is left.
    fn set_aside(&mut self, what: &'static str, began: Instant) {
        if !self.set_aside.contains(&what) {
            self.set_aside.push(what);
            let quarter = self.search().left().unwrap_or_default() / 4;
            self.refinement += began.elapsed().min(quarter);
        }
    }

    /// What the diagnosis leaves: the experiments with their baseline's values, its fit, and the reason why that has no result.
    pub fn finish(self) -> (Vec<Experiment>, Option<Fitted>, Option<Error>) {
        (self.base, self.fitted, self.fault)
    }

    /// Why the device failed, if it did.
    pub fn broken(&self) -> Option<String> {
        self.limits.broken()
    }

    /// Until the answer must be written.
    fn whole(&self) -> Limits {
        self.limits.less(self.answer)
    }

    /// Until what was found must be refined.
    fn search(&self) -> Limits {
        self.whole().less(self.refinement)
    }

    /// Until fits of so many hypotheses must be judged.
    fn fits(&self, count: usize) -> Limits {
        let all = self.search();
        let judging = Duration::from_secs_f64(self.seconds * count as f64 / rayon::current_num_threads() as f64);
        let most = all.left().unwrap_or_default() / 4;
        all.less(judging.min(most))
    }

    /// The baseline's fit, as far as it comes in the time that leaves the looks at its result.
    fn fit_baseline(&mut self) -> Result<Fitted, Error> {
        let whole = self.whole();
        let looks = (self.limits.elapsed() - self.opened).mul_f64(AGAIN);
        let most = whole.left().unwrap_or_default() / 2;
        let fitted = fitting::fit(
            &self.base,
            FitOptions {
                backend: self.backend,
                tolerance: Some(BASELINE),
                interrupt: whole.less(looks.min(most)).interrupt(),
                hurried: true,
                journal: self.journal.take(),
                ..FitOptions::default()
            },
        )?;
        match &fitted.result.broken {
            Some(why) => Err(Error::Failed(format!("the baseline's fit: {why}"))),
            None => Ok(fitted),
        }
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
    limits: &Limits,
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
            evaluate: backend.evaluator_until(&e.plan, 1, limits.stop()).map_err(lab_error)?,
        });
    }
    Ok((Problem::new(scenes, ready.free).map_err(LabError::failed)?, numbers))
}

/// Cost of one hypothesis at these values.
fn cost(base: &[Experiment], backend: Backend, limits: &Limits, (changes, values): &Try) -> Result<f64, LabError> {
    limits.check()?;
    let (mut problem, _) = problem(base, backend, limits, (changes, values), NEWTON * 1e-3, None)?;
    let values = problem.free().iter().map(|f| f.start.0).collect();
    let Some(sample) = problem.evaluate_values(&[values], Want::Cost).into_iter().next() else { return Ok(f64::INFINITY) };
    match sample {
        Sample { broken: true, failure, .. } => Err(limits.break_off(failure.unwrap_or_default())),
        Sample { stopped: true, .. } => Err(limits.stopped()),
        s => Ok(s.cost),
    }
}

/// Residuals of every scene, with derivatives by the numbers from `from` on. Always the reference backend: statistics want its precision.
pub(super) fn linearise(ready: &Prepared, values: &[f64], from: usize, limits: &Limits) -> Result<Readings, LabError> {
    linearise_some(ready, values, from, |_| true, limits)
}

/// The same, with zeros for derivatives by numbers (counted from `from`) that are not wanted: they cost nothing.
fn linearise_some(
    ready: &Prepared,
    values: &[f64],
    from: usize,
    wanted: impl Fn(usize) -> bool,
    limits: &Limits,
) -> Result<Readings, LabError> {
    let columns = ready.free.len() - from;
    let mut out = Readings { columns, ..Readings::default() };
    let (mut rows, mut residuals) = (Vec::new(), 0.0);
    for (scene, e) in ready.experiments.iter().enumerate() {
        let free = ready.free[from..].iter().enumerate().filter(|(k, _)| wanted(*k));
        let slots = free.flat_map(|(k, f)| f.slots.iter().filter(|s| s.scene == scene).map(move |s| (k, s.place, s.factor)));
        let one = along(e, scene, &ready.theta(scene, values), &slots.collect::<Vec<_>>(), columns, limits)?;
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
    limits: &Limits,
) -> Result<Readings, LabError> {
    limits.check()?;
    let places: Vec<usize> = directions.iter().map(|d| d.1).collect();
    let mut rollout = Rollout::new(CpuBackend, &e.plan, 1).map_err(|e| limits.error(e))?.stopped_by(limits.stop());
    let l = rollout.linearise(theta, &places).map_err(|e| limits.error(e))?;
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
fn together(base: &[Experiment], tries: &[Try], from: usize, limits: &Limits) -> Result<Vec<Readings>, LabError> {
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
    let r = linearise_some(&ready, &all, from, |k| wanted.get(k).copied().unwrap_or(true), limits)?;
    let mut at = 0;
    let part = |n: usize| {
        let sensitivity = r.sensitivity.chunks(r.columns.max(1)).flat_map(|row| row[at..at + n].to_vec()).collect();
        at += n;
        Readings { rows: r.rows.clone(), cost: r.cost, columns: n, sensitivity }
    };
    Ok(counts.into_iter().map(part).collect())
}

/// As [`together`]; where one of them cannot be computed, halves show which.
fn many(base: &[Experiment], tries: &[Try], from: usize, limits: &Limits) -> Vec<Result<Readings, LabError>> {
    match together(base, tries, from, limits) {
        Ok(all) => all.into_iter().map(Ok).collect(),
        Err(e) if tries.len() == 1 || !matches!(e, LabError::Failed(_)) => vec![Err(e); tries.len()],
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

    fn is_fitted(&self) -> bool {
        !self.open
    }

    fn baseline(&mut self, start: Model) -> Result<Baseline, LabError> {
        self.say("baseline fit");
        self.open = false;
        let fitted = match self.fit_baseline() {
            Ok(fitted) => fitted,
            Err(Error::Interrupted) => {
                return Ok(Baseline { model: start, cut: Some("it was stopped before its first evaluation".into()) });
            }
            Err(e) => {
                let told = LabError::failed(e.to_string());
                self.fault = Some(e);
                return Err(told);
            }
        };
        for (e, theta) in self.base.iter_mut().zip(&fitted.result.theta) {
            e.plan.theta.clone_from(theta);
        }
        let cut = fitted.result.runs.iter().any(|r| r.status == Status::Interrupted);
        let cut = cut.then(|| fitted.verdict.reasons.iter().take(REASONS).cloned().collect::<Vec<_>>().join("; "));
        let ready = prepare(&self.base, &[]).map_err(lab_error)?;
        let error = |n: &Number| {
            let parameters = fitted.free.iter().zip(&fitted.result.parameters);
            parameters.filter(|(f, _)| f.label() == n.path).find_map(|(_, p)| p.standard_error)
        };
        let numbers = ready.numbers();
        let errors = numbers.iter().map(error).collect();
        let model = Model { changes: Vec::new(), values: ready.own_values(), errors, numbers };
        self.fitted = Some(fitted);
        if cut.is_none() {
            self.settle().map_err(lab_error)?;
        }
        Ok(Baseline { model, cut })
    }

    fn last_look(&mut self, model: &Model) -> Result<Readings, LabError> {
        let whole = self.whole();
        let limits = if whole.is_over() { whole.grace(GRACE) } else { whole };
        if limits.left().is_some_and(|left| left.as_secs_f64() < self.seconds) {
            return Err(self.limits.stopped());
        }
        let ready = prepare(&self.base, &model.changes).map_err(lab_error)?;
        linearise(&ready, &model.values, 0, &limits).map_err(|e| match e {
            LabError::NoTime => self.limits.stopped(),
            e => e,
        })
    }

    fn seconds(&self) -> f64 {
        self.limits.elapsed().as_secs_f64()
    }

    fn keep_back(&mut self, seconds: f64) {
        self.answer = self.answer.max(Duration::from_secs_f64(seconds.max(0.0)));
    }

    fn costs(&mut self, tries: &[Try]) -> Vec<f64> {
        let (base, backend) = (&self.base, self.backend);
        let limits = &self.search();
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
        let limits = &self.fits(tries.len());
        let answers: Vec<Result<(Fit, Lap), LabError>> = tries
            .par_iter()
            .zip(known)
            .map(|(t, known)| known.unwrap_or_else(|| fit(base, backend, limits, t, effort, laps.before(t))))
            .collect();
        // What the deadline cut short is not kept: with more time the fit would go on.
        let in_time = !limits.is_late();
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
        let (base, limits) = (&self.base, &self.whole());
        let one = |(c, v): &Try| linearise(&prepare(base, c).map_err(lab_error)?, v, 0, limits);
        let began = Instant::now();
        let all: Vec<Result<Readings, LabError>> = tries.par_iter().map(one).collect();
        // What was cut short took less than it takes.
        if all.iter().any(Result::is_ok) && limits.check().is_ok() {
            let threads = rayon::current_num_threads().min(tries.len()) as f64;
            self.seconds = threads * began.elapsed().as_secs_f64() / tries.len().max(1) as f64;
        }
        all
    }

    fn linearise_new(&mut self, tries: &[Try], from: usize) -> Vec<Result<Readings, LabError>> {
        let (base, limits) = (&self.base, &self.search());
        // Before the baseline is fitted it must not take the time of that, but for the first ones: there must be some.
        let planned = if self.open { limits.share(LOOKED) } else { limits.clone() };
        let threads = rayon::current_num_threads();
        // As few simulations as there are threads, where tangents leave room: each costs its steps and one factorisation per step. A few
        // hypotheses come first, so that a search that is stopped has something, and knows what more of them take.
        let nodes = base.iter().map(|e| e.plan.body.nodes.len()).max().unwrap_or(1);
        let most = (MEMORY / (TANGENT * nodes)).max(1);
        let read = tries.iter().take_while(|t| t.0.last().is_some_and(Change::is_read)).count();
        let (mut out, mut together) = (Vec::with_capacity(tries.len()), FIRST.max(read.div_ceil(threads)));
        while out.len() < tries.len() {
            let open = &tries[out.len()..];
            let each = together.min(open.len().div_ceil(threads)).clamp(1, most);
            let wave = &open[..open.len().min(each * threads)];
            let began = limits.elapsed();
            out.par_extend(wave.par_chunks(each).flat_map_iter(|chunk| many(base, chunk, from, limits)));
            if let Err(e) = limits.check() {
                out.resize_with(tries.len(), || Err(e.clone()));
                break;
            }
            together = 2 * each;
            if let Some(left) = planned.left() {
                // More of them at once take no longer for each; what is cut short is lost.
                let fits = WAVE * left.as_secs_f64() / (limits.elapsed() - began).as_secs_f64().max(1e-9) * each as f64;
                together = together.min((fits as usize).max(1));
                if fits < WAVE {
                    out.resize_with(tries.len(), || Err(LabError::NoTime));
                }
            }
        }
        out
    }

    fn finer(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
        let whole = self.whole();
        whole.check()?;
        // The first one is the baseline's, after which there is a search.
        let limits = if self.finer.is_none() { whole.share(REFINED) } else { whole };
        let began = Instant::now();
        let ready = prepare(&self.base, changes).map_err(lab_error)?;
        let none = ready.free.len();
        let coarse = linearise(&ready, values, none, &limits)?;
        if self.finer.is_none() {
            self.finer = Some(self.base.iter().map(finer).collect::<Result<_, Error>>().map_err(lab_error)?);
        }
        let fine = prepare(self.finer.as_deref().unwrap_or(&[]), changes).map_err(lab_error)?;
        let mut short = prepare(&self.base, changes).map_err(lab_error)?;
        short.experiments = short.experiments.into_iter().map(halved).collect();
        let change = |name, ready: &Prepared, factor| -> Result<Field, LabError> {
            Ok(difference(name, &linearise(ready, values, none, &limits)?, &coarse, factor))
        };
        let (grid, step) = rayon::join(|| change("grid", &fine, GRID), || change("step", &short, STEP));
        let is_static = self.base.iter().all(|e| e.plan.clock.steps == 0);
        self.set_aside("recordings", began);
        Ok(if is_static { vec![grid?] } else { vec![grid?, step?] })
    }

    fn systematic(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
        systematic(&self.base, changes, values, &self.whole())
    }

    fn held_out(&mut self, model: &Model) -> Result<Option<Readings>, LabError> {
        self.held_out.map(|e| held_out(e, &self.base, self.backend, &self.whole(), model)).transpose()
    }

    fn held_out_finer(&mut self, model: &Model, coarse: &Readings) -> Result<Vec<Field>, LabError> {
        let Some(e) = self.held_out else { return Ok(Vec::new()) };
        let (base, backend, began, limits) = (&self.base, self.backend, Instant::now(), self.whole());
        let mut fields = Vec::new();
        for (name, e, factor) in [("grid", finer(e).map_err(lab_error)?, GRID), ("step", halved(e.clone()), STEP)] {
            fields.push(difference(name, &held_out(&e, base, backend, &limits, model)?, coarse, factor));
        }
        self.set_aside("held out", began);
        Ok(fields)
    }

    fn separations(&mut self, named: &Model, rivals: &[&Model]) -> Vec<Separation> {
        // What else may be missing comes first.
        let limits = self.search().share(0.25);
        let models: Vec<&Model> = std::iter::once(&named).chain(rivals).copied().collect();
        separations(&self.base, self.backend, &models, &limits.stop())
    }

    fn strange(&self, model: &Model) -> Vec<Strange> {
        prepare(&self.base, &model.changes).map_or_else(|_| Vec::new(), |ready| strange(&ready, &model.values, &model.errors))
    }

    fn iterations_left(&self) -> usize {
        let Some(left) = self.search().left() else { return usize::MAX };
        (left.as_secs_f64() * rayon::current_num_threads() as f64 / (ITERATION * self.seconds).max(1e-6)) as usize
    }

    fn out_of_time(&self) -> bool {
        self.search().is_late()
    }

    fn interrupted(&self) -> bool {
        self.limits.is_over()
    }

    fn say(&mut self, what: &str) {
        (self.say)(what);
    }
}
