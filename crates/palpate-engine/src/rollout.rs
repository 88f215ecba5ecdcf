//! The driver: forward with tape, back with the adjoint, or forward with tangents. Written once for all backends.

use crate::backend::{Backend, BuildError};
use crate::evaluate::{Direction, Evaluate, Evaluation, MOST_SENSITIVITIES, ParamBatch, Request, Wanted};
use crate::failure::{Failure, FailureKind};
use crate::product::{Held, product};
use crate::residuals::FrameResiduals;
use crate::rows::{Linearised, Rows};
use crate::stop::Stop;
use crate::tape::{Adjoints, Tape};
use glam::DVec3;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use std::ops::ControlFlow;

/// A plan on a backend, ready to be evaluated for batches of θ.
pub struct Rollout<B: Backend> {
    backend: B,
    world: B::World,
    plan: Plan,
    stages: Vec<Stage>,
    members: usize,
    /// The ways forward that products were last asked for, one of each recording; they hold until the world is used for something else.
    held: Vec<Held<B>>,
    /// The member that the world is set to for products.
    at: Option<ParamBatch>,
    /// Ends an evaluation at its next stage.
    stop: Stop,
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

/// Gets the states of a simulation by number, with the residuals of the frames of their step, and may end it.
pub type Visitor<'a> = dyn FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()> + 'a;

/// A step that has been taken and observed, or the start.
struct Moment<'a, B: Backend> {
    world: &'a B::World,
    /// Number of the step that ended; `None` at the start.
    step: Option<usize>,
    /// States at both ends of the step; twice the start's at the start.
    ends: [&'a B::State; 2],
    /// Tangents at both, where there are directions.
    tangents: Option<[&'a B::Tangent; 2]>,
    tally: &'a mut B::Tally,
}

/// The way forward.
struct Forward<'a, B: Backend> {
    backend: &'a B,
    stages: &'a [Stage],
    stop: &'a Stop,
    /// What tangents are taken along, if they are wanted: single residuals are read beside them, also where there are none.
    directions: Option<&'a [Direction]>,
    /// Every state is kept, for the way back.
    keep: bool,
}

impl<B: Backend> Forward<'_, B> {
    /// Takes all steps and shows every one of them, until all members have failed, `visit` breaks or somebody asks to stop.
    /// Breaks with nothing where somebody asked.
    fn run(
        &self,
        w: &mut B::World,
        tally: &mut B::Tally,
        visit: &mut dyn FnMut(Moment<B>) -> ControlFlow<()>,
    ) -> ControlFlow<(), Tape<B::State>> {
        let (b, directions) = (self.backend, self.directions);
        let mut first = b.new_state(w);
        b.start(w, &mut first, tally);
        let mut tangents = directions.map(|directions| {
            let mut t = b.new_tangent(w, directions);
            b.start_tangent(w, &first, &mut t, tally);
            Tape::new(self.stages, t, false)
        });
        let mut states = Tape::new(self.stages, first, self.keep);
        if self.stages.is_empty() {
            let now = states.last();
            b.observe(w, 0, now, now, tally);
        }
        if b.all_failed(tally) {
            return ControlFlow::Continue(states);
        }
        let start = tangents.as_ref().map(|t| [t.last(); 2]);
        let now = states.last();
        let mut flow = visit(Moment { world: w, step: None, ends: [now; 2], tangents: start, tally });
        for s in self.stages {
            let _step = tracing::trace_span!("step", number = s.step).entered();
            if self.stop.can_end() {
                b.keep_pace(w);
            }
            if self.stop.is_over() {
                // What was begun is waited for, so that the world is idle when it is used again.
                b.read(w, tally);
                return ControlFlow::Break(());
            }
            if b.all_failed(tally) || flow.is_break() {
                break;
            }
            let mut next = b.new_state(w);
            b.step(w, s, &states.past(s), &mut next, tally);
            if b.all_failed(tally) {
                break;
            }
            if let Some(now) = s.completes {
                b.observe(w, s.step, states.get(now), &next, tally);
            }
            if let Some((tape, directions)) = tangents.as_mut().zip(directions) {
                let mut t = tape.forget(s.number).unwrap_or_else(|| b.new_tangent(w, directions));
                b.step_tangent(w, s, &states.past(s), &next, &tape.past(s), &mut t, tally);
                tape.push(t);
            }
            states.push(next);
            if let Some(now) = s.completes
                && !b.all_failed(tally)
            {
                let tangents = tangents.as_ref().map(|t| [t.get(now), t.last()]);
                let ends = [states.get(now), states.last()];
                flow = visit(Moment { world: w, step: Some(s.step), ends, tangents, tally });
            }
            states.forget(s.number + 1);
        }
        ControlFlow::Continue(states)
    }

    /// The way back over all states of a tape; breaks where somebody asked to stop.
    fn back(&self, w: &mut B::World, mut states: Tape<B::State>, tally: &mut B::Tally) -> ControlFlow<()> {
        let b = self.backend;
        let mut adjoints = Adjoints::<B>::new(self.stages.len() + 1);
        if self.stages.is_empty() {
            // Both ends of the only step are the same state: both halves of the gradient belong to it.
            let (mut adj, mut adj_now) = (b.new_adjoint(w), adjoints.take(b, w, 0));
            b.observe_adjoint(w, 0, states.last(), states.last(), &mut adj, &mut adj_now, tally);
            adjoints.put(0, adj_now);
        }
        for s in self.stages.iter().rev() {
            if self.stop.can_end() {
                b.keep_pace(w);
            }
            if self.stop.is_over() {
                b.read(w, tally);
                return ControlFlow::Break(());
            }
            let mut adj = adjoints.take(b, w, s.number + 1);
            if let Some(now) = s.completes {
                let mut adj_now = adjoints.take(b, w, now);
                b.observe_adjoint(w, s.step, states.get(now), states.last(), &mut adj, &mut adj_now, tally);
                adjoints.put(now, adj_now);
            }
            adjoints.back(b, w, s, (&states, states.last()), adj, tally);
            states.pop();
        }
        let adj = adjoints.take(b, w, 0);
        b.start_adjoint(w, states.last(), &adj, tally);
        ControlFlow::Continue(())
    }
}

impl<B: Backend> Rollout<B> {
    /// Prepares a plan for up to `members` simulations at once (more are evaluated in turns).
    pub fn new(backend: B, plan: &Plan, members: usize) -> Result<Self, BuildError> {
        let world = backend.build(plan, members)?;
        let stages = plan.stages();
        Ok(Rollout {
            backend,
            world,
            plan: plan.clone(),
            stages,
            members: members.max(1),
            held: Vec::new(),
            at: None,
            stop: Stop::default(),
        })
    }

    /// The same rollout, whose evaluations end at their next stage once `stop` says so; every member then fails as
    /// [`FailureKind::Stopped`].
    #[must_use]
    pub fn stopped_by(self, stop: Stop) -> Self {
        Rollout { stop, ..self }
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What the backend holds, for those who measure it.
    pub fn world_mut(&mut self) -> &mut B::World {
        &mut self.world
    }

    /// The backend.
    pub fn backend(&self) -> &B {
        &self.backend
    }

    /// Evaluates a batch of at most as many members as there is room for.
    fn run(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let (members, sensitivities) = (theta.members(), request.sensitivities.len());
        let _span = tracing::debug_span!("evaluation", members, sensitivities, gradient = request.gradient.any()).entered();
        self.let_go();
        let (b, stop, stages) = (&self.backend, &self.stop, &self.stages);
        let directions = theta.directions(&request.sensitivities);
        let wanted = Some(directions.as_slice()).filter(|d| !d.is_empty());
        let forward = Forward { backend: b, stages, stop, directions: wanted, keep: request.gradient.any() };
        let attempt = |w: &mut B::World| {
            if stop.is_over() {
                return None;
            }
            b.set_params(w, theta);
            let mut tally = b.new_tally(w, request);
            let mut visit = |m: Moment<B>| {
                if let Some([t0, t1]) = m.tangents.filter(|_| m.step.is_some() || stages.is_empty()) {
                    b.observe_tangent(m.world, m.step.unwrap_or(0), m.ends[0], m.ends[1], t0, t1, m.tally);
                }
                ControlFlow::Continue(())
            };
            let ControlFlow::Continue(states) = forward.run(w, &mut tally, &mut visit) else { return None };
            if request.gradient.any() && !b.all_failed(&tally) && forward.back(w, states, &mut tally).is_break() {
                return None;
            }
            Some(b.read(w, &tally))
        };
        let all = b.rollout(&mut self.world, false, attempt);
        all.unwrap_or_else(|| vec![Evaluation::failed(stopped()); theta.members()])
    }

    /// Simulates one member and hands every state (the initial one first) to `visit` together with the residuals of the
    /// frames of its step; stops early when `visit` breaks, or with the member's failure.
    ///
    /// # Errors
    /// The simulation fails, or somebody asked to stop.
    pub fn visit(
        &mut self,
        theta: &[f64],
        mut visit: impl FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()>,
    ) -> Result<Evaluation, Failure> {
        self.show(theta, &mut visit)
    }

    /// [`Rollout::visit`], compiled once for all visitors.
    fn show(&mut self, theta: &[f64], visit: &mut Visitor<'_>) -> Result<Evaluation, Failure> {
        let _span = tracing::debug_span!("evaluation", members = 1).entered();
        self.let_go();
        let (b, dt, times) = (&self.backend, self.plan.clock.step, &self.plan.times);
        let (stages, stop) = (&self.stages, &self.stop);
        let forward = Forward { backend: b, stages, stop, directions: None, keep: false };
        b.rollout(&mut self.world, true, |w| {
            b.set_params(w, &ParamBatch::of(theta));
            let mut tally = b.new_tally(w, &Request::default());
            let mut each = |m: Moment<B>| {
                let (displacement, velocity) = b.read_state(m.world, m.ends[1], 0);
                let state = m.step.map_or(0, |k| k + 1);
                let observed = m.step.is_some() || stages.is_empty();
                let residuals =
                    if observed { b.residuals(m.world, m.step.unwrap_or(0), m.ends[0], m.ends[1], 0) } else { Vec::new() };
                let time = times.get(state).map_or(state as f64 * dt, |t| t - times[0]);
                visit(state, Snapshot { time, displacement, velocity }, residuals)
            };
            forward.run(w, &mut tally, &mut each).continue_value().ok_or_else(stopped)?;
            let evaluation = b.read(w, &tally).remove(0);
            evaluation.failure.clone().map_or(Ok(evaluation), Err)
        })
    }

    /// Simulates one member with tangents along `directions` (places in θ) and collects every residual with its sensitivities.
    ///
    /// # Errors
    /// The simulation fails, somebody asked to stop, or the backend has no rows ([`FailureKind::Unsupported`]).
    pub fn linearise(&mut self, theta: &[f64], directions: &[usize]) -> Result<Linearised, Failure> {
        refuse_many(directions.len())?;
        self.let_go();
        let b = &self.backend;
        let along = Direction::parameters(directions);
        let (stages, stop) = (&self.stages, &self.stop);
        let forward = Forward { backend: b, stages, stop, directions: Some(&along), keep: false };
        b.rollout(&mut self.world, true, |w| {
            b.set_params(w, &ParamBatch::of(theta));
            let request = Request { sensitivities: directions.to_vec(), ..Request::default() };
            let mut tally = b.new_tally(w, &request);
            let (mut rows, mut without_rows) = (Rows::default(), false);
            let mut each = |m: Moment<B>| {
                if m.step.is_none() && !stages.is_empty() {
                    return ControlFlow::Continue(());
                }
                // Without directions there are residuals alone.
                let none = b.new_tangent(m.world, &[]);
                let tangents = m.tangents.unwrap_or([&none; 2]);
                match b.rows(m.world, m.step.unwrap_or(0), m.ends, tangents, m.tally, 0) {
                    Some(more) => {
                        rows.residuals.extend(more.residuals);
                        rows.sensitivity.extend(more.sensitivity);
                        ControlFlow::Continue(())
                    }
                    None => {
                        without_rows = true;
                        ControlFlow::Break(())
                    }
                }
            };
            forward.run(w, &mut tally, &mut each).continue_value().ok_or_else(stopped)?;
            let evaluation = b.read(w, &tally).remove(0);
            if without_rows {
                let detail = format!("backend {} has no single residuals", b.name());
                return Err(Failure::new(FailureKind::Unsupported, 0.0, detail));
            }
            match evaluation.failure {
                Some(f) => Err(f),
                None => Ok(Linearised {
                    evaluation: Evaluation { curvature: None, ..evaluation },
                    directions: directions.to_vec(),
                    rows,
                }),
            }
        })
    }
}

impl<B: Backend> Rollout<B> {
    /// Simulates one member and keeps every state, unless that is what is kept already.
    fn hold(&mut self, at: &ParamBatch) -> Result<(), Failure> {
        if self.held.iter().any(|h| h.at == *at) {
            return Ok(());
        }
        self.held.retain(|h| h.at.view(0).recording != at.view(0).recording);
        self.at = None;
        let (b, stages, stop) = (&self.backend, &self.stages, &self.stop);
        let forward = Forward { backend: b, stages, stop, directions: None, keep: true };
        let states = b.rollout(&mut self.world, false, |w| {
            b.set_params(w, at);
            let mut tally = b.new_tally(w, &Request::default());
            let mut visit = |_: Moment<B>| ControlFlow::Continue(());
            let states = forward.run(w, &mut tally, &mut visit).continue_value().ok_or_else(stopped)?;
            b.read(w, &tally).remove(0).failure.map_or(Ok(states), Err)
        })?;
        self.held.push(Held { at: at.clone(), states });
        self.at = Some(at.clone());
        Ok(())
    }

    /// Lets go of what was kept for products: the world is needed for something else.
    fn let_go(&mut self) {
        self.held.clear();
        self.at = None;
    }
}

pub(crate) fn stopped() -> Failure {
    Failure::new(FailureKind::Stopped, 0.0, "the rollout was cut short")
}

/// Forward sensitivities by very many parameters would take the memory of as many states.
fn refuse_many(directions: usize) -> Result<(), Failure> {
    if directions <= MOST_SENSITIVITIES {
        return Ok(());
    }
    let detail = format!("sensitivities by {directions} parameters at once; at most {MOST_SENSITIVITIES} are computed directly");
    Err(Failure {
        hint: "fit a field with optimizer = \"lbfgs\" or \"gauss-newton-cg\", which need no sensitivities, or free fewer numbers"
            .into(),
        ..Failure::new(FailureKind::Unsupported, 0.0, detail)
    })
}

impl<B: Backend> Evaluate for Rollout<B> {
    fn parameters(&self) -> usize {
        self.plan.layout.len()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        if let Err(failure) = refuse_many(request.sensitivities.len()) {
            return vec![Evaluation::failed(failure); theta.members()];
        }
        theta.parts(self.members).flat_map(|part| self.run(&part, request)).collect()
    }

    fn has_products(&self) -> bool {
        true
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        self.hold(at)?;
        let (b, ways) = (&self.backend, (&self.stages[..], &self.stop));
        if self.at.as_ref() != Some(at) {
            b.set_params(&mut self.world, at);
            self.at = Some(at.clone());
        }
        let states = &self.held.iter().find(|h| h.at == *at).expect("a way forward was just kept").states;
        b.rollout(&mut self.world, false, |w| product(b, w, ways, states, v, wanted))
    }
}
