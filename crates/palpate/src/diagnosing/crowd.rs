//! Hypotheses side by side on a device: what several of them ask for at the same time is one batch.
//!
//! They share a plan with the effects of all, where those that a hypothesis lacks are absent and so change nothing. A round waits until every
//! hypothesis asks for something or has ended; a batch is ordered by hypothesis. What is computed, and in which company, therefore depends on the
//! hypotheses, never on timing. On the CPU a batch gains nothing, and effects that are absent would cost time: there each has a plan of its own.

use super::hypothesis::{Prepared, lab_error, prepare};
use super::limits::Limits;
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::fitting::demand;
use crate::memory::Demand;
use palpate_diagnose::{Change, LabError};
use palpate_engine::{Evaluate, Evaluation, Failure, FailureKind, ParamBatch, Request, Share, Wanted};
use palpate_model::effects::{Effect, Unstated};
use palpate_model::observation::View;
use palpate_model::params::{Layout, ParamKey};
use palpate_model::plan::Plan;
use palpate_model::plan::join::join;
use palpate_model::scene::Optimizer;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

/// Physics of the scenes of one hypothesis.
pub(super) type Physics = Vec<Box<dyn Evaluate>>;

/// What was asked for, and how it was computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Counts {
    /// Simulations, and what hypotheses asked for at a time.
    pub simulations: usize,
    pub asks: usize,
    /// Batches on the device.
    pub batches: usize,
}

impl Counts {
    fn and(self, more: Counts) -> Counts {
        let Counts { simulations, asks, batches } = more;
        Counts { simulations: self.simulations + simulations, asks: self.asks + asks, batches: self.batches + batches }
    }

    /// In words, if anything was counted.
    pub fn told(&self) -> Option<String> {
        let mean = self.simulations as f64 / self.batches.max(1) as f64;
        (self.batches > 0).then(|| format!("{} simulations in {} batches of {mean:.1}", self.simulations, self.batches))
    }
}

/// Does a job for each of the hypotheses `lines` out of `all`, in order: with physics of the batches of a device where they can have a plan in
/// common, in which Newton's method is no tighter than `newton`; else with none given.
pub(super) fn side_by_side<T: Send>(
    of: (&[Experiment], Backend, &Limits),
    all: &[&[Change]],
    newton: f64,
    lines: &[usize],
    job: impl Fn(usize, Option<Physics>) -> T + Sync,
) -> (Vec<T>, Counts) {
    let group: Vec<usize> = (0..all.len()).collect();
    within(of, all, newton, (&group, lines), &job)
}

/// The same of a group. Where its hypotheses have no plan in common, halves of it may: a device takes so many laws of a kind at once.
fn within<T: Send>(
    of: (&[Experiment], Backend, &Limits),
    all: &[&[Change]],
    newton: f64,
    (group, lines): (&[usize], &[usize]),
    job: &(impl Fn(usize, Option<Physics>) -> T + Sync),
) -> (Vec<T>, Counts) {
    let (base, backend, limits) = of;
    let open: Vec<usize> = lines.iter().copied().filter(|k| group.contains(k)).collect();
    if backend == Backend::Gpu && group.len() > 1 && !open.is_empty() {
        let own: Vec<&[Change]> = group.iter().map(|k| all[*k]).collect();
        let places: Vec<usize> = open.iter().filter_map(|k| group.iter().position(|g| g == k)).collect();
        match Crowd::new(base, backend, limits, &own, newton) {
            Ok(crowd) => return crowd.run(&places, |k, physics| job(group[k], Some(physics))),
            Err(LabError::Failed(_)) => {
                let (a, b) = group.split_at(group.len() / 2);
                let [(mut done, first), (more, second)] = [a, b].map(|half| within(of, all, newton, (half, lines), job));
                done.extend(more);
                return (done, first.and(second));
            }
            // Each of them says by itself why there is no time.
            Err(_) => {}
        }
    }
    (open.par_iter().map(|k| job(*k, None)).collect(), Counts::default())
}

/// Plans that hold several hypotheses.
pub(super) struct Crowd {
    /// One for all scenes that differ in their recordings alone.
    evaluators: Vec<Box<dyn Evaluate>>,
    /// Of every hypothesis and scene: where it sits.
    seats: Vec<Vec<Place>>,
}

/// Where a hypothesis of one scene finds its numbers.
#[derive(Clone, Debug)]
struct Place {
    evaluator: usize,
    view: View,
    /// θ of the plan of all, in which every effect is absent.
    base: Arc<Vec<f64>>,
    /// Places of the hypothesis's own θ in it.
    places: Arc<Vec<usize>>,
}

/// The effects of a hypothesis.
fn effects(changes: &[Change]) -> impl Iterator<Item = &Effect> {
    changes.iter().filter_map(|c| if let Change::Effect(e) = c { Some(e) } else { None })
}

/// True of effects that change nothing at some value of their amplitudes.
fn can_be_absent(e: &Effect) -> bool {
    e.law().params.iter().any(|p| matches!(p.default, Unstated::Absent(_)))
}

/// The effects of several hypotheses, and which of them are those of each, in its order: a law stands once where one is enough.
fn united<'a>(all: &[&'a [Change]]) -> (Vec<&'a Effect>, Vec<Vec<usize>>) {
    let mut union: Vec<&Effect> = Vec::new();
    let places = all.iter().map(|changes| {
        let mut from = 0;
        let place = effects(changes).map(|e| {
            let known = (from..union.len()).find(|k| union[*k].law == e.law);
            let place = known.unwrap_or_else(|| {
                union.push(e);
                union.len() - 1
            });
            from = place + 1;
            place
        });
        place.collect()
    });
    let places = places.collect();
    (union, places)
}

/// Where the keys of a layout are in another one that has more effects: its first `given` are the same, the others have these numbers.
fn placed(own: &Layout, union: &Layout, given: usize, numbers: &[usize]) -> Vec<usize> {
    let key = |key: &ParamKey| match *key {
        ParamKey::Effect { effect, slot, .. } if usize::from(effect) >= given => {
            union.effect_key(given + numbers[usize::from(effect) - given], usize::from(slot))
        }
        other => other,
    };
    own.keys.iter().map(|k| union.index(key(k))).collect()
}

/// θ of a plan without any of its effects from number `given` on.
fn without_effects(plan: &Plan, given: usize) -> Vec<f64> {
    let mut theta = plan.theta.clone();
    for (law, range) in plan.layout.effects().skip(given) {
        for (p, at) in law.params.iter().zip(range) {
            if let Unstated::Absent(value) = p.default {
                theta[at] = value;
            }
        }
    }
    theta
}

impl Crowd {
    /// Of hypotheses, each of them changes of the scenes; Newton's method is no tighter than `newton`.
    ///
    /// # Errors
    /// Why they have no plan in common: each must be computed by itself.
    pub fn new(
        base: &[Experiment],
        backend: Backend,
        limits: &Limits,
        hypotheses: &[&[Change]],
        newton: f64,
    ) -> Result<Crowd, LabError> {
        if let Some(e) = hypotheses.iter().flat_map(|h| effects(h)).find(|e| !can_be_absent(e)) {
            return Err(LabError::failed(format!("{} is never absent", e.law().kind)));
        }
        let (union, numbers) = united(hypotheses);
        let all: Vec<Change> = union.into_iter().cloned().map(Change::Effect).collect();
        let mut whole = prepare(base, &all).map_err(lab_error)?;
        for e in &mut whole.experiments {
            e.plan.solver.tolerance = e.plan.solver.tolerance.max(newton);
        }
        let own: Vec<Prepared> = hypotheses.iter().map(|h| prepare(base, h)).collect::<Result<_, _>>().map_err(lab_error)?;
        let plans: Vec<&Plan> = whole.experiments.iter().map(|e| &e.plan).collect();
        let mut evaluators = Vec::new();
        let mut sits: Vec<Option<(usize, View)>> = vec![None; plans.len()];
        for joint in join(&plans) {
            // As many as there are at most, with the numbers of the one that has most.
            let starts = joint.parts.len() * hypotheses.len();
            let asked = own.iter().map(|p| demand(&p.free, joint.parts[0].0, Optimizer::GaussNewton, 1));
            let asked = asked.max_by_key(|d| d.places.len()).unwrap_or(Demand::forward(starts));
            let members = backend.members(&joint.plan, &Demand { starts, ..asked }, 0).map_err(|e| limits.error(e))?;
            for (scene, view) in joint.parts {
                sits[scene] = Some((evaluators.len(), view));
            }
            evaluators.push(backend.evaluator_until(&joint.plan, members, limits.stop()).map_err(|e| limits.error(e))?);
        }
        let given = |s: usize| base[s].plan.layout.effects().count();
        let bases: Vec<Arc<Vec<f64>>> = plans.iter().enumerate().map(|(s, p)| Arc::new(without_effects(p, given(s)))).collect();
        let seat = |own: &Prepared, numbers: &[usize], s: usize| {
            let (evaluator, view) = sits[s].clone()?;
            let places = placed(&own.experiments[s].plan.layout, &plans[s].layout, given(s), numbers);
            Some(Place { evaluator, view, base: bases[s].clone(), places: Arc::new(places) })
        };
        let scenes = 0..plans.len();
        let seats = own.iter().zip(&numbers).map(|(own, n)| scenes.clone().filter_map(|s| seat(own, n, s)).collect()).collect();
        Ok(Crowd { evaluators, seats })
    }

    /// Does a job for each of these hypotheses, by number, on threads of their own.
    pub fn run<T: Send>(mut self, lines: &[usize], job: impl Fn(usize, Physics) -> T + Sync) -> (Vec<T>, Counts) {
        std::thread::scope(|scope| {
            let (tell, inbox) = channel();
            let mut answers = Vec::new();
            let mut threads = Vec::new();
            for (line, hypothesis) in lines.iter().copied().enumerate() {
                let (answer, heard) = channel();
                let table = Arc::new(Table { line, tell: tell.clone(), heard: heard.into() });
                let seats = self.seats[hypothesis].iter().cloned();
                let physics = seats.map(|place| Box::new(Seat { place, table: table.clone() }) as Box<dyn Evaluate>).collect();
                answers.push(answer);
                let job = &job;
                let tell = tell.clone();
                threads.push(scope.spawn(move || {
                    // Also where the job panics nobody waits for it.
                    let _leaves = Leaves { line, tell };
                    job(hypothesis, physics)
                }));
            }
            drop(tell);
            let counts = serve(&mut self.evaluators, &inbox, &answers);
            let done = threads.into_iter().map(|t| t.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            (done.collect(), counts)
        })
    }
}

/// What a hypothesis asks for.
struct Ask {
    evaluator: usize,
    batch: ParamBatch,
    request: Request,
}

enum Message {
    Asks(Box<Ask>),
    Leaves,
}

/// Tells that a hypothesis has ended.
struct Leaves {
    line: usize,
    tell: Sender<(usize, Message)>,
}

impl Drop for Leaves {
    fn drop(&mut self) {
        // Whoever serves may be gone before.
        let _ = self.tell.send((self.line, Message::Leaves));
    }
}

/// Answers all asks until everybody has left.
fn serve(
    evaluators: &mut [Box<dyn Evaluate>],
    inbox: &Receiver<(usize, Message)>,
    answers: &[Sender<Vec<Evaluation>>],
) -> Counts {
    let mut counts = Counts::default();
    let mut left = vec![false; answers.len()];
    let mut asked: Vec<Option<Box<Ask>>> = answers.iter().map(|_| None).collect();
    loop {
        while (0..answers.len()).any(|k| !left[k] && asked[k].is_none()) {
            match inbox.recv() {
                Ok((k, Message::Asks(ask))) => asked[k] = Some(ask),
                Ok((k, Message::Leaves)) => left[k] = true,
                Err(_) => return counts,
            }
        }
        let alike = |a: &Ask, b: &Ask| {
            let kind = |a: &Ask| (a.evaluator, a.request.gradient.any(), a.request.sensitivities.is_empty());
            kind(a) == kind(b)
        };
        let Some(first) = asked.iter().flatten().next() else { return counts };
        let together: Vec<usize> = (0..asked.len()).filter(|k| asked[*k].as_ref().is_some_and(|a| alike(a, first))).collect();
        let batch: Vec<Box<Ask>> = together.iter().filter_map(|k| asked[*k].take()).collect();
        counts.asks += batch.len();
        counts.batches += 1;
        counts.simulations += batch.iter().map(|a| a.batch.members()).sum::<usize>();
        let mut found = one_batch(&mut *evaluators[batch[0].evaluator], &batch).into_iter();
        for (k, ask) in together.into_iter().zip(&batch) {
            // Who does not listen any more has left.
            let _ = answers[k].send(found.by_ref().take(ask.batch.members()).collect());
        }
    }
}

/// Computes what several ask for at once.
fn one_batch(evaluator: &mut dyn Evaluate, asks: &[Box<Ask>]) -> Vec<Evaluation> {
    let all = || asks.iter().map(|a| &a.batch);
    let rows: Vec<Vec<f64>> = all().flat_map(|b| (0..b.members()).map(|m| b.row(m).to_vec())).collect();
    let batch = ParamBatch::from_rows(&rows).seeing(all().flat_map(|b| b.views.iter().cloned()).collect());
    let own: Vec<Vec<usize>> = all().flat_map(|b| b.own.iter().cloned()).collect();
    // Every member has its own; the request only says how many they are at most.
    let most = own.iter().max_by_key(|o| o.len()).cloned().unwrap_or_default();
    let request = Request { gradient: asks[0].request.gradient.clone(), sensitivities: most };
    evaluator.evaluate(&if own.is_empty() { batch } else { batch.along(own) }, &request)
}

/// The way of one hypothesis to whoever serves.
struct Table {
    line: usize,
    tell: Sender<(usize, Message)>,
    heard: std::sync::Mutex<Receiver<Vec<Evaluation>>>,
}

/// A scene of a hypothesis, as its fit sees it.
struct Seat {
    place: Place,
    table: Arc<Table>,
}

impl Evaluate for Seat {
    fn parameters(&self) -> usize {
        self.place.places.len()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let (members, places) = (theta.members(), &self.place.places);
        let row = |b: usize| {
            let mut row = (*self.place.base).clone();
            places.iter().zip(theta.row(b)).for_each(|(p, v)| row[*p] = *v);
            row
        };
        let views = if theta.views.is_empty() { vec![self.place.view.clone(); members] } else { theta.views.clone() };
        let batch = ParamBatch::from_rows(&(0..members).map(row).collect::<Vec<_>>()).seeing(views);
        let own: Vec<usize> = request.sensitivities.iter().map(|p| places[*p]).collect();
        let batch = if own.is_empty() { batch } else { batch.along(vec![own.clone(); members]) };
        let gradient = if request.gradient.any() { Wanted::All } else { Wanted::Nothing };
        let ask = Ask { evaluator: self.place.evaluator, batch, request: Request { gradient, sensitivities: own } };
        let gone = || vec![Evaluation::failed(Failure::new(FailureKind::Stopped, 0.0, "nobody computes any more")); members];
        if self.table.tell.send((self.table.line, Message::Asks(Box::new(ask)))).is_err() {
            return gone();
        }
        let heard = self.table.heard.lock().unwrap_or_else(std::sync::PoisonError::into_inner).recv();
        let Ok(mut found) = heard else { return gone() };
        let mask = request.gradient.mask(places.len());
        for e in found.iter_mut().filter(|e| !e.gradient.is_empty()) {
            e.gradient = places.iter().zip(&mask).map(|(p, wanted)| if *wanted { e.gradient[*p] } else { 0.0 }).collect();
        }
        found
    }

    fn share(&self) -> Option<Share> {
        // Scenes of one evaluator; only those of one hypothesis ever meet.
        Some(Share { of: self.place.evaluator, view: self.place.view.clone() })
    }
}

#[cfg(test)]
#[path = "crowd_tests.rs"]
mod tests;
