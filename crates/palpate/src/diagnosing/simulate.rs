//! Simulations of hypotheses: costs, residuals and their sensitivities. Every one of them looks at the limits on its way.

use super::crowd::Physics;
use super::hypothesis::{Prepared, lab_error, prepare};
use super::laps::Lap;
use super::limits::Limits;
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::fitting::demand;
use crate::memory::{Demand, members_on_cpu};
use palpate_cpu::CpuBackend;
use palpate_diagnose::{Change, LabError, Number, Reading, Readings};
use palpate_engine::Rollout;
use palpate_fit::{FitScene, Problem, Sample, Want};
use palpate_model::plan::join::Joint;
use palpate_model::scene::Optimizer;
use rayon::prelude::*;
use std::sync::Arc;

/// Most bytes of tangents of one simulation that computes the sensitivities of several hypotheses.
const MEMORY: usize = 1 << 29;
/// Newton's tolerance over the relative decrease of the cost that a fit is after: forces that are off by 1e-6 move costs by less than 1e-4.
pub(super) const NEWTON: f64 = 5e-3;
/// Bytes of one tangent per node: displacement and velocity, before and after a step.
const TANGENT: usize = 2 * 2 * 24;
/// Hypotheses that a thread computes together at first; twice as many each time, as long as they take no more than this share of the time left.
const FIRST: usize = 1;
const WAVE: f64 = 0.5;

/// A set of changes with values of all free numbers.
pub(super) type Try = (Vec<Change>, Vec<f64>);

/// Physics of its own for a hypothesis.
pub(super) fn own_physics(ready: &Prepared, backend: Backend, limits: &Limits) -> Result<Physics, LabError> {
    let plans: Vec<_> = ready.experiments.iter().map(|e| &e.plan).collect();
    // Recordings of one body run side by side, as far as they fit.
    let members = |joint: &Joint| {
        let demand = demand(&ready.free, joint.parts[0].0, Optimizer::GaussNewton, 1);
        backend.members(&joint.plan, &Demand { starts: joint.parts.len(), ..demand }, 0)
    };
    backend.evaluators_until(&plans, members, &limits.stop()).map_err(|e| limits.error(e))
}

/// The problem of fitting one hypothesis from a start, with its numbers; its physics is `physics`, or its own, in which Newton's method is no
/// tighter than `newton`.
pub(super) fn problem(
    base: &[Experiment],
    (backend, physics): (Backend, Option<Physics>),
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
    for e in &mut ready.experiments {
        e.plan.solver.tolerance = e.plan.solver.tolerance.max(newton);
    }
    let physics = physics.map_or_else(|| own_physics(&ready, backend, limits), Ok)?;
    let mut scenes = Vec::new();
    for (e, evaluate) in ready.experiments.iter().zip(physics) {
        scenes.push(FitScene {
            name: e.scene.path.display().to_string(),
            fingerprint: String::new(),
            base: e.plan.theta.clone(),
            evaluate,
        });
    }
    Ok((Problem::new(scenes, ready.free).map_err(LabError::failed)?, numbers))
}

/// Newton's tolerance of [`cost`].
pub(super) const NEWTON_OF_COST: f64 = NEWTON * 1e-3;

/// Cost of one hypothesis at these values.
pub(super) fn cost(
    base: &[Experiment],
    physics: (Backend, Option<Physics>),
    limits: &Limits,
    (changes, values): &Try,
) -> Result<f64, LabError> {
    limits.check()?;
    let (mut problem, _) = problem(base, physics, limits, (changes, values), NEWTON_OF_COST, None)?;
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
    members_on_cpu(&e.plan, &Demand::tangents(&places), 0).map_err(lab_error)?;
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
        Err(e) if tries.len() == 1 => vec![Err(limits.alone(e))],
        Err(e) if !matches!(e, LabError::Failed(_)) => vec![Err(e); tries.len()],
        Err(_) => {
            let (a, b) = tries.split_at(tries.len() / 2);
            [many(base, a, from, limits), many(base, b, from, limits)].concat()
        }
    }
}

/// Sensitivities of hypotheses by the numbers from `from` on, a few of them first, so that a search that is stopped has something, and knows what
/// more of them take; what does not fit into the planned time has none.
pub(super) fn in_waves(
    base: &[Experiment],
    tries: &[Try],
    from: usize,
    limits: &Limits,
    planned: &Limits,
) -> Vec<Result<Readings, LabError>> {
    let threads = rayon::current_num_threads();
    // As few simulations as there are threads, where tangents leave room: each costs its steps and one factorisation per step.
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
