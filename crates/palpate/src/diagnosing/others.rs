//! Other data and other looks: a second recording of the same body, times of contact, frames at rest.

use super::hypothesis::{Prepared, is_own, lab_error, prepare};
use super::limits::Limits;
use super::simulate::along;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use glam::DVec3;
use palpate_diagnose::{Change, LabError, Model, Readings};
use palpate_engine::Stop;
use palpate_fit::{FitError, FitScene, Hooks, Problem, Settings};
use palpate_model::observation::ReadingKind;
use palpate_model::params::ParamKey;
use palpate_model::scene::Optimizer;
use std::ops::ControlFlow;

/// Times [s] between which a simulation touches a plane, with its own values.
pub(super) fn contact_times(e: &Experiment, backend: Backend, stop: &Stop) -> Result<Vec<(f64, f64)>, Error> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    if e.plan.planes.is_empty() {
        return Ok(out);
    }
    let theta = &e.plan.theta;
    let physics = palpate_model::plan::Physics::new(&e.plan.layout, theta);
    let planes: Vec<(DVec3, f64)> =
        e.plan.planes.iter().zip(&physics.planes).map(|(site, p)| (site.normal(p[1], p[2])[0], p[0])).collect();
    let (surface, _) = e.surface(0.5 * e.plan.body.length);
    let step = e.plan.clock.step;
    // Where contact forces begin to act.
    let reach = 0.05 * e.plan.body.length;
    backend.visit_until(&e.plan, theta, stop.clone(), |_, s, _| {
        let x = surface.deform(&s.displacement);
        let time = physics.start + s.time;
        if planes.iter().any(|(n, d)| x.iter().any(|x| n.dot(*x) - d < reach)) {
            match out.last_mut() {
                Some(last) if time - last.1 < 1.5 * step => last.1 = time,
                _ => out.push((time, time)),
            }
        }
        ControlFlow::Continue(())
    })?;
    Ok(out)
}

/// Frames until the next of which no point of the simulated body moves by more than a tenth of the noise of a depth reading.
pub(super) fn still_frames(e: &Experiment, backend: Backend, stop: &Stop) -> Result<Vec<usize>, Error> {
    let o = &e.plan.observation;
    let times: Vec<f64> = o.frames.iter().map(|f| f.time).collect();
    if times.len() < 3 || o.cameras.is_empty() {
        return Ok(Vec::new());
    }
    let start = palpate_model::plan::Physics::new(&e.plan.layout, &e.plan.theta).start;
    let mut ways = vec![0.0; times.len() - 1];
    let mut last: Option<(f64, Vec<DVec3>)> = None;
    backend.visit_until(&e.plan, &e.plan.theta, stop.clone(), |_, s, _| {
        let now = start + s.time;
        if let Some((before, u)) = &last {
            let way = u.iter().zip(&s.displacement).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            let within = |w: &[f64]| w[0] < now && w[1] > *before;
            ways.iter_mut().zip(times.windows(2)).filter(|(_, w)| within(w)).for_each(|(sum, _)| *sum += way);
        }
        last = Some((now, s.displacement));
        ControlFlow::Continue(())
    })?;
    Ok((0..ways.len()).filter(|f| ways[*f] < 0.1 * o.noise(ReadingKind::Depth)).collect())
}

/// Residuals of a recording that no fit has seen: what describes the body comes from the model, what belongs to the recording (how the
/// motion starts) keeps its scene's values, or is fitted where that scene or the model leaves it free.
pub(super) fn held_out(
    e: &Experiment,
    base: &[Experiment],
    backend: Backend,
    limits: &Limits,
    model: &Model,
) -> Result<Readings, LabError> {
    let trained = prepare(base, &model.changes).map_err(lab_error)?;
    let is_own = |path: &str| is_own(path, base.iter().chain([e]));
    // A label of another scene's number means nothing here.
    let changes: Vec<Change> = model
        .changes
        .iter()
        .map(|c| match c {
            Change::Freed { name, sentence, paths } => {
                let mut own: Vec<String> = paths.iter().map(|p| p.split(" [scene").next().unwrap_or(p).to_string()).collect();
                own.dedup();
                let free = |p: &String| e.scene.fit.iter().flat_map(|f| &f.parameters).any(|x| x.path == *p);
                own.retain(|p| !free(p));
                Change::Freed { name, sentence, paths: own }
            }
            effect => effect.clone(),
        })
        .collect();
    let mut ready: Prepared = prepare(std::slice::from_ref(e), &changes).map_err(lab_error)?;
    let mut values: Vec<f64> = ready.numbers().iter().map(|n| n.start).collect();
    let mut open = Vec::new();
    // Of every number of the model where it acts here.
    let mut directions: Vec<(usize, usize, f64)> = Vec::new();
    for (k, n) in ready.names.iter().enumerate() {
        let shared = trained.names.iter().position(|t| t.path == n.path).filter(|_| !is_own(&n.path));
        match shared {
            Some(t) => {
                values[k] = model.values[t];
                directions.extend(ready.free[k].slots.iter().map(|s| (t, s.place, s.factor)));
            }
            None => open.push(k),
        }
    }
    // Numbers of the body that the held-out scene does not name.
    for (t, n) in trained.names.iter().enumerate() {
        let experiment = &mut ready.experiments[0];
        let place = |k: &ParamKey| super::hypothesis::path_of(experiment, *k) == n.path;
        if !is_own(&n.path)
            && !ready.names.iter().any(|m| m.path == n.path)
            && let Some(p) = experiment.plan.layout.keys.iter().position(place)
        {
            let factor = trained.free[t].slots[0].factor;
            experiment.plan.theta[p] = model.values[t] * factor;
            directions.push((t, p, factor));
        }
    }
    if !open.is_empty() {
        let plan = &ready.experiments[0].plan;
        let scene = FitScene {
            name: e.scene.path.display().to_string(),
            fingerprint: String::new(),
            base: ready.theta(0, &values),
            evaluate: backend.evaluator_until(plan, 1, limits.stop()).map_err(|e| limits.error(e))?,
        };
        let free = open.iter().map(|k| {
            let mut f = ready.free[*k].clone();
            let v = values[*k].clamp(f.bounds.0, f.bounds.1);
            f.start = (v, v);
            f
        });
        let mut problem = Problem::new(vec![scene], free.collect()).map_err(LabError::failed)?;
        let settings = Settings { iterations: 12, ..Settings::new(Optimizer::GaussNewton) };
        let hooks = Hooks { interrupt: limits.interrupt().in_turn(), ..Hooks::default() };
        let found = palpate_fit::fit(&mut problem, &settings, hooks).map_err(|e| match e {
            FitError::Interrupted => limits.stopped(),
            e => LabError::failed(e),
        })?;
        if let Some(why) = found.broken {
            return Err(limits.break_off(why));
        }
        // A fit that was cut short says nothing of how well the other recording is met.
        limits.check()?;
        open.iter().zip(&found.parameters).for_each(|(k, p)| values[*k] = p.value);
    }
    let shared = model.values.len();
    for (i, k) in open.iter().enumerate() {
        directions.extend(ready.free[*k].slots.iter().map(|s| (shared + i, s.place, s.factor)));
    }
    along(&ready.experiments[0], 0, &ready.theta(0, &values), &directions, shared + open.len(), limits)
}
