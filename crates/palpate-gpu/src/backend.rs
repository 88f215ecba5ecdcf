//! [`Backend`] on the device: every call puts dispatches on its list; only `read` waits. Calls that wait are those of `asynchronous.rs`, driven here.

use crate::device::{Choice, Gpu, GpuError};
use crate::skinning::Skinning;
use crate::solve::{backward, forward};
use crate::tracking::Correspondence;
use crate::world::{Adjoint, LEVELS, Level, State, Tally, Tangent, Tuning, World};
use crate::{read, solve};
use glam::DVec3;
use palpate_engine::{Backend, BuildError, Direction, Evaluation, FrameResiduals, ParamBatch, Request, Rows, StressFree};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;
use palpate_model::space::stencil::Stencils;
use std::sync::Arc;

/// The GPU backend.
#[derive(Clone, Debug)]
pub struct GpuBackend {
    pub(crate) gpu: Arc<Gpu>,
    tuning: Option<Tuning>,
    levels: Option<&'static [(usize, u32, u32)]>,
    alone: bool,
    shapes: Option<Arc<dyn StressFree>>,
}

impl GpuBackend {
    /// On the chosen adapter.
    ///
    /// # Errors
    /// There is none, or it cannot run the kernels.
    pub fn new(choice: &Choice) -> Result<GpuBackend, GpuError> {
        Ok(GpuBackend::on(Gpu::open(choice)?))
    }

    /// On an open device.
    pub fn on(gpu: Arc<Gpu>) -> GpuBackend {
        GpuBackend { gpu, tuning: None, levels: None, alone: false, shapes: None }
    }

    /// The same with given ways to solve, instead of those that the environment or a measurement chooses.
    pub fn tuned(self, tuning: Tuning) -> GpuBackend {
        GpuBackend { tuning: Some(tuning), ..self }
    }

    /// The same as on a graphics processor, where a dispatch that nobody wants costs something: solves are given what they took the time before.
    pub fn sparing(self) -> GpuBackend {
        GpuBackend { levels: Some(LEVELS), ..self }
    }

    /// The same with other levels of effort than those of its device.
    #[cfg(test)]
    pub(crate) fn levels(self, levels: &'static [(usize, u32, u32)]) -> GpuBackend {
        GpuBackend { levels: Some(levels), ..self }
    }

    /// The same for one simulation at a time: what fails for want of room advises no smaller batch.
    pub fn alone(self) -> GpuBackend {
        GpuBackend { alone: true, ..self }
    }

    /// The same with somebody who finds stress-free shapes, for bodies whose given shape is their equilibrium.
    pub fn with_shapes(self, shapes: Arc<dyn StressFree>) -> GpuBackend {
        GpuBackend { shapes: Some(shapes), ..self }
    }

    fn world(&self, plan: &Plan, members: usize) -> Result<World, GpuError> {
        self.check_shape(plan)?;
        let world = self.dressed(solve::world(self.gpu.clone(), plan, members, self.ways()?)?);
        self.gpu.take_trouble().map_or(Ok(world), Err)
    }

    /// Ways to solve that are stated.
    pub(crate) fn ways(&self) -> Result<Tuning, GpuError> {
        self.tuning.map_or_else(Tuning::from_env, Ok)
    }

    /// Refuses a shape that is given as the equilibrium where nobody finds the stress-free one.
    pub(crate) fn check_shape(&self, plan: &Plan) -> Result<(), GpuError> {
        if plan.initial == InitialShape::Given && self.shapes.is_none() {
            let what = "a shape that is given as the equilibrium without `GpuBackend::with_shapes`, which finds the stress-free one on the host";
            return Err(GpuError::Plan { what: what.into() });
        }
        Ok(())
    }

    /// A world as this backend wants it.
    pub(crate) fn dressed(&self, mut world: World) -> World {
        world.alone = self.alone;
        if world.plan.initial == InitialShape::Given {
            world.shapes = self.shapes.as_ref().map(|s| s.open(&world.plan));
        }
        if let Some(levels) = self.levels {
            world.effort = Level::of(levels);
        }
        world
    }

    /// Why a world cannot be built, with the way out.
    pub(crate) fn not_built(&self, e: &GpuError) -> BuildError {
        let (message, hint) = (e.to_string(), e.hint_for(self.alone));
        BuildError { message, hint, broken: matches!(e, GpuError::Lost { .. }) }
    }

    /// Waits for an answer; what went wrong is kept for the next evaluation.
    fn or_keep<T>(&self, answer: impl Future<Output = Result<T, GpuError>>) -> Option<T> {
        self.gpu.waited(answer).map_err(|e| self.gpu.keep(e)).ok()
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Who says, on its device, which readings of a frame belong to which part of a surface.
    pub fn correspondence(&self) -> Correspondence {
        Correspondence::on(self.gpu.clone())
    }

    /// Who moves, on its device, places that follow `nodes` nodes.
    ///
    /// # Errors
    /// More than the device has.
    pub fn skinning(&self, stencils: &Stencils, nodes: usize) -> Result<Skinning, GpuError> {
        Skinning::on(self.gpu.clone(), stencils, nodes)
    }
}

impl Backend for GpuBackend {
    type World = World;
    type State = State;
    type Adjoint = Adjoint;
    type Tangent = Tangent;
    type Tally = Tally;

    fn name(&self) -> String {
        format!("gpu ({})", self.gpu.name)
    }

    fn build(&self, plan: &Plan, members: usize) -> Result<World, BuildError> {
        self.world(plan, members).map_err(|e| self.not_built(&e))
    }

    fn set_params(&self, world: &mut World, theta: &ParamBatch) {
        world.set_params(theta);
    }

    fn new_state(&self, world: &World) -> State {
        State(world.lend(3))
    }

    fn new_adjoint(&self, world: &World) -> Adjoint {
        let adjoint = Adjoint(world.lend(2));
        world.record(|r| r.clear(&adjoint.0.buffer));
        adjoint
    }

    fn new_tangent(&self, world: &World, directions: &[Direction]) -> Tangent {
        let parts: Vec<_> = directions.iter().map(|_| world.lend(2)).collect();
        world.record(|r| parts.iter().for_each(|p| r.clear(&p.buffer)));
        Tangent { rates: world.rates(directions), parts }
    }

    fn new_tally(&self, world: &World, request: &Request) -> Tally {
        Tally::new(world, request)
    }

    fn rollout<T>(&self, world: &mut World, watched: bool, mut body: impl FnMut(&mut World) -> T) -> T {
        loop {
            world.effort.watch(watched);
            let result = body(world);
            // Members that were cut off because less was recorded for them than they are allowed get more.
            if !world.effort.rise() {
                return result;
            }
        }
    }

    fn start(&self, world: &mut World, first: &mut State, tally: &mut Tally) {
        forward::start(world, first, tally);
    }

    fn step(&self, world: &mut World, stage: &Stage, past: &[&State], next: &mut State, tally: &mut Tally) {
        forward::step(world, stage, past, next, tally);
    }

    fn observe(&self, world: &World, k: usize, now: &State, next: &State, tally: &mut Tally) {
        let ends = [now, next].map(|s| &s.0.buffer);
        world.record(|r| world.observer.observe(r, k, ends, &tally.buffers));
    }

    fn observe_adjoint(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        adj: &mut Adjoint,
        adj_now: &mut Adjoint,
        tally: &mut Tally,
    ) {
        let ends = [now, next].map(|s| &s.0.buffer);
        let adjoints = [&adj_now.0.buffer, &adj.0.buffer];
        world.record(|r| {
            forward::rest(world, r, k, tally);
            world.observer.observe_adjoint(r, k, ends, adjoints, &tally.buffers);
        });
    }

    fn step_adjoint(
        &self,
        world: &mut World,
        stage: &Stage,
        past: &[&State],
        next: &State,
        adj: &Adjoint,
        adj_past: &mut [Adjoint],
        tally: &mut Tally,
    ) {
        backward::step_adjoint(world, stage, past, next, adj, adj_past, tally);
    }

    fn start_adjoint(&self, world: &mut World, first: &State, adj: &Adjoint, tally: &mut Tally) {
        backward::start_adjoint(world, first, adj, tally);
    }

    fn clear_adjoint(&self, adj: &mut Adjoint) {
        adj.0.clear(&self.gpu);
    }

    fn start_tangent(&self, world: &mut World, first: &State, tangent: &mut Tangent, tally: &mut Tally) {
        backward::start_tangent(world, first, tangent, tally);
    }

    fn step_tangent(
        &self,
        world: &mut World,
        stage: &Stage,
        past: &[&State],
        next: &State,
        tangent_past: &[&Tangent],
        tangent_next: &mut Tangent,
        tally: &mut Tally,
    ) {
        backward::step_tangent(world, stage, past, next, tangent_past, tangent_next, tally);
    }

    fn observe_tangent(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        tangent: &Tangent,
        tangent_next: &Tangent,
        tally: &mut Tally,
    ) {
        let ends = [now, next].map(|s| &s.0.buffer);
        let pairs = tangent.parts.iter().zip(&tangent_next.parts);
        let tangents: Vec<_> = pairs.map(|(a, b)| [&a.buffer, &b.buffer]).collect();
        world.record(|r| world.observer.observe_tangent(r, k, ends, &tangents, &tally.buffers));
    }

    fn observe_product(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        tangent: &Tangent,
        tangent_next: &Tangent,
        adj: &mut Adjoint,
        adj_now: &mut Adjoint,
        tally: &mut Tally,
    ) {
        tally.point(world, tangent);
        let ends = [now, next].map(|s| &s.0.buffer);
        let along = [tangent, tangent_next].map(|t| &t.parts[0].buffer);
        let adjoints = [&adj_now.0.buffer, &adj.0.buffer];
        world.record(|r| {
            forward::rest(world, r, k, tally);
            world.observer.observe_product(r, k, ends, along, adjoints, &tally.buffers);
        });
    }

    fn rows(
        &self,
        world: &World,
        k: usize,
        states: [&State; 2],
        tangents: [&Tangent; 2],
        tally: &Tally,
        member: usize,
    ) -> Option<Rows> {
        // What went wrong is read with the evaluation.
        Some(self.or_keep(self.rows_async(world, k, states, tangents, tally, member)).unwrap_or_default())
    }

    fn keep_pace(&self, world: &mut World) {
        world.keep_pace();
    }

    fn all_failed(&self, _tally: &Tally) -> bool {
        // The answer lies on the device; a broken device is known here and ends the rollout.
        self.gpu.troubled()
    }

    fn read(&self, world: &World, tally: &Tally) -> Vec<Evaluation> {
        self.gpu.wait_for(self.read_async(world, tally)).unwrap_or_else(|e| read::failed(world, &e))
    }

    fn read_state(&self, world: &World, state: &State, member: usize) -> (Vec<DVec3>, Vec<DVec3>) {
        self.or_keep(self.read_state_async(world, state, member)).unwrap_or_else(|| {
            let n = world.plan.body.nodes.len();
            (vec![DVec3::NAN; n], vec![DVec3::NAN; n])
        })
    }

    fn residuals(&self, world: &World, k: usize, now: &State, next: &State, member: usize) -> Vec<FrameResiduals> {
        self.or_keep(self.residuals_async(world, k, [now, next], member)).unwrap_or_default()
    }
}
