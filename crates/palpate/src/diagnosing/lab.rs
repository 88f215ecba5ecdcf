//! The laboratory over experiments: fits and linearises hypotheses, several side by side.

use super::DiagnoseOptions;
use super::checkpoint::Checkpoint;
use super::crowd::{Counts, side_by_side};
use super::hypothesis::{Prepared, held, lab_error, prepare};
use super::laps::{Lap, Laps, fit};
use super::limits::Limits;
use super::others::{contact_times, held_out, still_frames};
use super::refined::{FINER, GRID, STEP, difference, finer, halved};
use super::separate::separations;
use super::simulate::{NEWTON, NEWTON_OF_COST, Try, cost, in_waves, linearise};
use super::systematic::systematic;
use super::walls::walls;
use super::world::strange;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{self, FitOptions, Fitted, fingerprint};
use palpate_diagnose::{
    Baseline, Change, Field, Fit, LabError, Laboratory, Model, Number, Readings, Regions, Separation, Setting, Start, Strange,
};
use palpate_fit::{FreeParameter, Status};
use rayon::prelude::*;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Simulations with sensitivities that an iteration of a fit costs: that at its end, and costs along the way.
const ITERATION: f64 = 3.0;
/// Relative decrease of the cost at which the baseline has arrived: what its numbers move by after that is projected out of everything.
const BASELINE: f64 = 1e-6;
/// What the looks at the baseline take over what those at the starting model took, where its fit is cut short.
const AGAIN: f64 = 1.25;
/// Reasons of a fit that was cut short that are told: how far it came, and how far away the optimum is.
const REASONS: usize = 2;
/// Shares of the time left that are taken for a look at candidates, for what bodies touch, and for what finer computations change.
const LOOKED: f64 = 1.0 / 3.0;
const SETTLED: f64 = 0.2;
const REFINED: f64 = 0.5;
/// What a last look may take after somebody asked to stop: the half of what he is told that it takes.
const GRACE: Duration = Duration::from_secs(1);

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
            cameras: most(|e| e.plan.observation.camera_count()),
            sight: experiments.iter().any(|e| e.plan.observation.has_sight()),
            markers: most(|e| e.plan.observation.marker_count()),
            cells: experiments.iter().all(|e| e.plan.body.cut.is_some()),
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

    /// Tells how hypotheses ran side by side, if they did.
    fn crowded(&mut self, counts: Counts) {
        counts.told().iter().for_each(|told| self.say(told));
    }

    fn key(&self, start: &Start, effort: (usize, f64)) -> String {
        let prints: Vec<String> = self.base.iter().map(|e| fingerprint(&e.plan)).collect();
        let theta: Vec<&[f64]> = self.base.iter().map(|e| e.plan.theta.as_slice()).collect();
        format!("{prints:?} {theta:?} {start:?} {effort:?}")
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
        let lines: Vec<usize> = (0..tries.len()).collect();
        let all: Vec<&[Change]> = tries.iter().map(|t| t.0.as_slice()).collect();
        let one = |k: usize, physics| cost(base, (backend, physics), limits, &tries[k]).unwrap_or(f64::INFINITY);
        let (costs, counts) = side_by_side((base, backend, limits), &all, NEWTON_OF_COST, &lines, one);
        self.crowded(counts);
        costs
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
        // The plan has those that are known as well: bits do not depend on where a search was taken up again.
        let all: Vec<&[Change]> = tries.iter().map(|t| t.changes.as_slice()).collect();
        let open: Vec<usize> = (0..tries.len()).filter(|k| known[*k].is_none()).collect();
        let one = |k: usize, physics| fit(base, (backend, physics), limits, &tries[k], effort, laps.before(&tries[k]));
        let (found, counts) = side_by_side((base, backend, limits), &all, NEWTON * tolerance, &open, one);
        let mut found = found.into_iter();
        let answer = |known: Option<_>| known.or_else(|| found.next()).unwrap_or(Err(LabError::Interrupted));
        let answers: Vec<Result<(Fit, Lap), LabError>> = known.into_iter().map(answer).collect();
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
        self.crowded(counts);
        answers.into_iter().map(|a| a.map(|(f, _)| f)).collect()
    }

    fn linearise(&mut self, tries: &[Try]) -> Vec<Result<Readings, LabError>> {
        let (base, limits) = (&self.base, &self.whole());
        let one = |(c, v): &Try| linearise(&prepare(base, c).map_err(lab_error)?, v, 0, limits).map_err(|e| limits.alone(e));
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
        // A look must not take the time of the fits that follow it.
        let limits = self.search();
        in_waves(&self.base, tries, from, &limits, &limits.share(LOOKED))
    }

    fn finer(&mut self, changes: &[Change], values: &[f64]) -> Result<Vec<Field>, LabError> {
        let whole = self.whole();
        whole.check()?;
        // The first one is the baseline's, after which there is a search.
        let limits = if self.finer.is_none() { whole.share(REFINED) } else { whole };
        // As many times as long as there are more nodes, at the least: what cannot come to its end leaves its time to others.
        let least = self.seconds * (1.0 + FINER.powi(3));
        if limits.left().is_some_and(|left| left.as_secs_f64() < least) {
            return Err(LabError::NoTime);
        }
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
        let is_static = self.base.iter().all(|e| !e.plan.clock.moves());
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
        separations(&self.base, self.backend, &models, &limits)
    }

    fn strange(&self, model: &Model, corrected: &[f64]) -> Vec<Strange> {
        prepare(&self.base, &model.changes).map_or_else(|_| Vec::new(), |ready| strange(&ready, model, corrected))
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
