//! The driver: forward with tape, back with the adjoint, or forward with tangents. Written once for all backends.

use crate::backend::{Backend, BuildError, FrameResiduals};
use crate::evaluate::{Evaluate, Evaluation, ParamBatch, Request};
use crate::failure::{Failure, FailureKind};
use crate::rows::{Linearised, Rows};
use glam::DVec3;
use palpate_model::plan::Plan;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A plan on a backend, ready to be evaluated for batches of θ.
pub struct Rollout<B: Backend> {
    backend: B,
    world: B::World,
    plan: Plan,
    members: usize,
    /// Ends an evaluation at its next step when set.
    stop: Arc<AtomicBool>,
}

/// One instant of one member, for reports.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Time since the initial state [s].
    pub time: f64,
    /// Displacement [m] of every simulation node.
    pub displacement: Vec<DVec3>,
    /// Velocity [m/s] of every simulation node.
    pub velocity: Vec<DVec3>,
}

impl<B: Backend> Rollout<B> {
    /// Prepares a plan for up to `members` simulations at once (more are evaluated in turns).
    pub fn new(backend: B, plan: &Plan, members: usize) -> Result<Self, BuildError> {
        let world = backend.build(plan, members)?;
        Ok(Rollout { backend, world, plan: plan.clone(), members: members.max(1), stop: Arc::default() })
    }

    /// The same rollout, whose evaluations end at their next step once `stop` is set; every member then fails as
    /// [`FailureKind::Stopped`].
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Rollout { stop, ..self }
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The backend.
    pub fn backend(&self) -> &B {
        &self.backend
    }

    fn run(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        loop {
            let Some(all) = self.attempt(theta, request) else {
                let failure = Failure::new(FailureKind::Stopped, 0.0, "the rollout was cut short");
                return vec![Evaluation::failed(failure); theta.members()];
            };
            if !self.backend.again(&mut self.world) {
                return all;
            }
        }
    }

    /// Evaluates a batch; `None` when it was asked to stop on the way.
    fn attempt(&mut self, theta: &ParamBatch, request: &Request) -> Option<Vec<Evaluation>> {
        let stop = || self.stop.load(Ordering::SeqCst);
        if stop() {
            return None;
        }
        let b = &self.backend;
        let w = &mut self.world;
        b.watch(w, false);
        b.set_params(w, theta);
        let directions = &request.sensitivities;
        let mut tally = b.new_tally(w, directions);
        let steps = self.plan.clock.steps;

        let mut now = b.new_state(w);
        b.start(w, &mut now, &mut tally);
        let mut tangent = (!directions.is_empty()).then(|| (b.new_tangent(w, directions), b.new_tangent(w, directions)));
        if let Some((t, _)) = &mut tangent {
            b.start_tangent(w, &now, t, &mut tally);
        }
        if steps == 0 {
            b.observe(w, 0, &now, &now, &mut tally);
            if let Some((t, _)) = &tangent {
                b.observe_tangent(w, 0, &now, &now, t, t, &mut tally);
            }
        }
        // The tape holds u and v of every step: 48 bytes a node and step in f64; everything else is rebuilt on the way back.
        let mut tape = Vec::new();
        for k in 0..steps {
            if stop() {
                // What was begun is waited for, so that the world is idle when it is used again.
                b.read(w, &tally);
                return None;
            }
            if b.all_failed(&tally) {
                break;
            }
            let mut next = b.new_state(w);
            b.step(w, k, &now, &mut next, &mut tally);
            b.observe(w, k, &now, &next, &mut tally);
            if let Some((t, t_next)) = &mut tangent {
                b.step_tangent(w, k, &now, &next, t, t_next, &mut tally);
                b.observe_tangent(w, k, &now, &next, t, t_next, &mut tally);
                std::mem::swap(t, t_next);
            }
            let old = std::mem::replace(&mut now, next);
            if request.gradient {
                tape.push(old);
            }
        }

        if request.gradient && !b.all_failed(&tally) {
            let mut adj = b.new_adjoint(w);
            let mut adj_now = b.new_adjoint(w);
            let mut next = now;
            if steps == 0 {
                // `now` and `next` are the same state: both halves of the gradient belong to it.
                b.observe_adjoint(w, 0, &next, &next, &mut adj, &mut adj_now, &mut tally);
                b.start_adjoint(w, &next, &adj_now, &mut tally);
            }
            for k in (0..steps).rev() {
                if stop() {
                    b.read(w, &tally);
                    return None;
                }
                let now = tape.pop().expect("one state per step is on the tape");
                b.observe_adjoint(w, k, &now, &next, &mut adj, &mut adj_now, &mut tally);
                b.step_adjoint(w, k, &now, &next, &adj, &mut adj_now, &mut tally);
                std::mem::swap(&mut adj, &mut adj_now);
                b.clear_adjoint(&mut adj_now);
                next = now;
            }
            b.start_adjoint(w, &next, &adj, &mut tally);
        }
        Some(b.read(w, &tally))
    }

    /// Simulates one member and hands every state (the initial one first) to `visit` together with the residuals of the
    /// frames of its step; stops early when `visit` breaks, or with the member's failure.
    pub fn visit(
        &mut self,
        theta: &[f64],
        mut visit: impl FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()>,
    ) -> Result<Evaluation, Failure> {
        let b = &self.backend;
        let w = &mut self.world;
        b.watch(w, true);
        b.set_params(w, &ParamBatch::from_rows(&[theta.to_vec()]));
        let mut tally = b.new_tally(w, &[]);
        let mut now = b.new_state(w);
        b.start(w, &mut now, &mut tally);
        let steps = self.plan.clock.steps;
        let snapshot = |w: &B::World, k: usize, s: &B::State| {
            let (displacement, velocity) = b.read_state(w, s, 0);
            Snapshot { time: k as f64 * self.plan.clock.step, displacement, velocity }
        };
        let mut flow = ControlFlow::Continue(());
        if !b.all_failed(&tally) {
            let residuals = if steps == 0 {
                b.observe(w, 0, &now, &now, &mut tally);
                b.residuals(w, 0, &now, &now, 0)
            } else {
                Vec::new()
            };
            flow = visit(0, snapshot(w, 0, &now), residuals);
        }
        for k in 0..steps {
            if b.all_failed(&tally) || flow.is_break() {
                break;
            }
            let mut next = b.new_state(w);
            b.step(w, k, &now, &mut next, &mut tally);
            if b.all_failed(&tally) {
                break;
            }
            b.observe(w, k, &now, &next, &mut tally);
            let residuals = b.residuals(w, k, &now, &next, 0);
            flow = visit(k + 1, snapshot(w, k + 1, &next), residuals);
            now = next;
        }
        let evaluation = b.read(w, &tally).remove(0);
        match &evaluation.failure {
            Some(f) => Err(f.clone()),
            None => Ok(evaluation),
        }
    }
}

impl<B: Backend> Rollout<B> {
    /// Simulates one member with tangents along `directions` (places in θ) and collects every residual with its sensitivities.
    ///
    /// # Errors
    /// The simulation fails, or the backend has no rows ([`FailureKind::Unsupported`]).
    pub fn linearise(&mut self, theta: &[f64], directions: &[usize]) -> Result<Linearised, Failure> {
        let b = &self.backend;
        let w = &mut self.world;
        b.watch(w, true);
        b.set_params(w, &ParamBatch::from_rows(&[theta.to_vec()]));
        let mut tally = b.new_tally(w, directions);
        let mut now = b.new_state(w);
        let (mut t, mut t_next) = (b.new_tangent(w, directions), b.new_tangent(w, directions));
        let mut rows = Rows::default();
        let mut add = |more: Option<Rows>| {
            let more = more.ok_or_else(|| {
                Failure::new(FailureKind::Unsupported, 0.0, format!("backend {} has no single residuals", b.name()))
            })?;
            rows.residuals.extend(more.residuals);
            rows.sensitivity.extend(more.sensitivity);
            Ok(())
        };
        b.start(w, &mut now, &mut tally);
        b.start_tangent(w, &now, &mut t, &mut tally);
        let steps = self.plan.clock.steps;
        if steps == 0 && !b.all_failed(&tally) {
            b.observe(w, 0, &now, &now, &mut tally);
            add(b.rows(w, 0, [&now, &now], [&t, &t], &tally, 0))?;
        }
        for k in 0..steps {
            if b.all_failed(&tally) {
                break;
            }
            let mut next = b.new_state(w);
            b.step(w, k, &now, &mut next, &mut tally);
            b.observe(w, k, &now, &next, &mut tally);
            b.step_tangent(w, k, &now, &next, &t, &mut t_next, &mut tally);
            if b.all_failed(&tally) {
                break;
            }
            add(b.rows(w, k, [&now, &next], [&t, &t_next], &tally, 0))?;
            std::mem::swap(&mut t, &mut t_next);
            now = next;
        }
        let evaluation = b.read(w, &tally).remove(0);
        match evaluation.failure {
            Some(f) => Err(f),
            None => {
                Ok(Linearised { evaluation: Evaluation { curvature: None, ..evaluation }, directions: directions.to_vec(), rows })
            }
        }
    }
}

impl<B: Backend> Evaluate for Rollout<B> {
    fn parameters(&self) -> usize {
        self.plan.layout.len()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let rows: Vec<Vec<f64>> = (0..theta.members()).map(|b| theta.row(b).to_vec()).collect();
        rows.chunks(self.members).flat_map(|rows| self.run(&ParamBatch::from_rows(rows), request)).collect()
    }
}
