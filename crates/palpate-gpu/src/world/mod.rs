//! What the backend holds: a plan's buffers and a batch's, states on loan from a pool, and what is read at the end.

mod coarse;
mod effects;
mod effort;
mod elastic;
mod geometry;
mod limits;
mod mass;
mod members;
pub(crate) mod rates;
mod room;
mod states;
mod sums;
mod tally;
mod tuning;

#[cfg(test)]
pub(crate) use coarse::MOST_GROUPS;
#[cfg(test)]
pub(crate) use coarse::carried;
pub(crate) use coarse::{Coarse, vectors as coarse_vectors};
pub(crate) use effort::{Effort, LEVELS, Level};
pub(crate) use geometry::Geometry;
pub(crate) use limits::columns;
pub(crate) use rates::Rates;
pub(crate) use room::{KINDS, SOLVING, SOLVING_VECTORS, VECTOR, work};
pub(crate) use states::Loan;
pub use states::{Adjoint, State, Tangent};
pub(crate) use sums::{Found, Sums};
pub use tally::Tally;
pub(crate) use tally::tally_sizes;
pub(crate) use tuning::MANY;
pub use tuning::{Product, Tuning};
#[cfg(test)]
pub(crate) use {
    limits::{LOOPS, MOST_SYSTEMS, Most},
    room::SECTIONS,
};

use crate::costs::Observer;
use crate::device::pipelines::shared::structs::FIELD_SEVERAL;
use crate::device::recorder::{Buffers, Groups, PassTime, Recorder};
use crate::device::{Counter, Gpu, GpuError, HandedOver, Maker as _};
use crate::layout::Shape;
use crate::passes::Passes;
use members::Batch;
use palpate_engine::{Direction, ParamBatch, Request, StressFreeShapes};
use palpate_model::effects::sensors::Sensors;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Stages that a device may still have to compute while the next one is recorded.
const AHEAD: usize = 3;

/// Directions, and what changes along them.
type Known = (Vec<Direction>, Arc<Vec<Rates>>);

/// A plan made ready on a device, and the current batch.
#[derive(Debug)]
pub struct World {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) plan: Plan,
    pub(crate) geometry: Geometry,
    pub(crate) batch: Batch,
    pub(crate) coarse: Coarse,
    pub(crate) observer: Observer,
    pub(crate) capacity: usize,
    pub(crate) buffers: Buffers,
    pool: Arc<Mutex<Vec<wgpu::Buffer>>>,
    groups: RefCell<Groups>,
    /// Directions of this batch's tangents, and what changes along them.
    rates: RefCell<Known>,
    /// Time on the device per pass, when asked for.
    pub(crate) times: RefCell<HashMap<&'static str, PassTime>>,
    pub(crate) timed: bool,
    /// Counts dispatches, when asked for.
    pub(crate) counter: Option<Counter>,
    /// The work handed over last, and the ends of the latest stages.
    last: RefCell<Option<wgpu::SubmissionIndex>>,
    ahead: VecDeque<HandedOver>,
    /// True when many workgroups share the solve of a member.
    pub(crate) many: bool,
    pub(crate) product: Product,
    pub(crate) effort: Level,
    /// True where its owner runs one simulation at a time.
    pub(crate) alone: bool,
    /// Who finds stress-free shapes, where the shape given is the equilibrium.
    pub(crate) shapes: Option<Box<dyn StressFreeShapes>>,
}

impl World {
    pub(crate) fn new(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
        gpu.clone().waited(World::made(gpu, plan, members, tuning))
    }

    /// The same, for whoever may not wait.
    pub(crate) async fn made(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
        let mut buffers = Buffers::new();
        let capacity = members.max(1);
        let many = plan.body.nodes.len() >= tuning.many_from;
        let geometry = Geometry::new(&*gpu, plan, capacity, many, &mut buffers)?;
        for (name, bytes) in work(&geometry.shape, capacity) {
            buffers.insert(name, gpu.buffer(name, bytes)?);
        }
        let observer = Observer::new(&gpu, plan, capacity)?;
        let coarse = Coarse::new(plan, &geometry);
        let effort = Level::new(!gpu.is_software());
        let mut world = World {
            gpu,
            plan: plan.clone(),
            geometry,
            batch: Batch::default(),
            coarse,
            observer,
            capacity,
            buffers,
            pool: Arc::default(),
            groups: RefCell::default(),
            rates: RefCell::default(),
            times: RefCell::default(),
            last: RefCell::default(),
            ahead: VecDeque::new(),
            timed: false,
            counter: None,
            many,
            product: tuning.product.unwrap_or(Product::Matrix),
            effort,
            alone: false,
            shapes: None,
        };
        world.engage(tuning.crew).await?;
        if world.needs_matrix() || world.geometry.shape.crew != 0 {
            world.product = Product::Matrix;
        }
        world.learn_stiffness().await?;
        Ok(world)
    }

    /// Shows the body at rest to the second level of the preconditioner, as the plan itself has it.
    async fn learn_stiffness(&mut self) -> Result<(), GpuError> {
        let Some(stage) = self.plan.clock.stages().first().cloned() else { return Ok(()) };
        let made = self.gpu.made();
        self.set_params(&ParamBatch::from_rows(std::slice::from_ref(&self.plan.theta.clone())));
        self.enter(&stage);
        let tally = Tally::new(self, &Request::default());
        let rest = State(self.lend(3));
        self.record(|r| {
            r.clear(&rest.0.buffer);
            Passes::new(self, r, Some(stage.number), &rest, &rest, &tally).linearise();
        });
        drop((tally, rest));
        let count = 9 * self.geometry.shape.blocks as usize;
        let values = self.gpu.items_of::<f32>(&self.buffers["values"], count).await?;
        self.coarse.learn(&self.plan, &self.geometry, &stage, &self.batch.physics[0], &values);
        // Nothing of it is kept: the batches to come bring their own.
        self.batch = Batch::default();
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).clear();
        self.gpu.forget_made(made);
        Ok(())
    }

    /// True where elastic points or effects add to blocks, which only the matrix holds.
    pub(crate) fn needs_matrix(&self) -> bool {
        self.geometry.shape.elastic != 0 || self.geometry.effects.on_nodes() || self.geometry.effects.on_cells()
    }

    /// What changes along directions of the current batch; computed once for all tangents of an evaluation.
    pub(crate) fn rates(&self, directions: &[Direction]) -> Arc<Vec<Rates>> {
        let mut known = self.rates.borrow_mut();
        if known.0 != directions || known.1.len() != directions.len() {
            *known = (directions.to_vec(), Arc::new(Rates::all(self, directions)));
        }
        known.1.clone()
    }

    /// True where an effect does nothing in any member.
    pub(crate) fn is_absent(&self, effect: usize) -> bool {
        let law = self.plan.layout.effects().nth(effect).map(|e| e.0);
        law.is_some_and(|law| self.batch.physics.iter().all(|p| law.is_absent(&p.effects[effect])))
    }

    /// Members of the current batch.
    pub fn members(&self) -> usize {
        self.batch.physics.len()
    }

    /// Device memory that the world's own buffers take [B]; states come on top.
    pub fn bytes(&self) -> u64 {
        self.buffers.values().map(wgpu::Buffer::size).sum::<u64>() + self.observer.bytes()
    }

    pub(crate) fn set_params(&mut self, theta: &ParamBatch) {
        let before = self.members();
        // Buffers of the batch before are replaced: bind groups that hold them must go.
        self.groups.borrow_mut().clear();
        *self.rates.borrow_mut() = Known::default();
        let found = self.shapes.as_mut().map_or_else(Vec::new, |s| s.find(theta));
        let set = self.batch.set(&self.gpu, &self.plan, &self.geometry, &mut self.coarse, theta, found, &mut self.buffers);
        if let Err(e) = set {
            self.gpu.keep(e);
        }
        if self.members() > self.capacity {
            let (what, limit) = ("a batch larger than it was built for".into(), "members");
            let (available, needed) = (self.capacity as u64, self.members() as u64);
            self.gpu.keep(GpuError::Limit { limit, available, needed, what });
        }
        if before != self.members() {
            self.pool.lock().unwrap_or_else(PoisonError::into_inner).clear();
        }
        self.geometry.shape.members = self.members() as u32;
        // Frames are stamped by a clock that may be ahead.
        let sensors: Vec<Sensors> = self.batch.theta.iter().map(|row| Sensors::new(&self.plan.layout, row)).collect();
        let starts: Vec<f64> = self.batch.physics.iter().zip(&sensors).map(|(p, s)| p.start + s.ahead()).collect();
        self.observer.set(&self.gpu, &self.batch.views, &starts, &sensors);
    }

    /// Tells the kernels how many Newton iterations they have.
    pub(crate) fn set_iterations(&mut self, iterations: usize) {
        self.geometry.shape.iterations = iterations as u32;
        if let Some(buffer) = self.buffers.get("shape") {
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&self.geometry.shape));
        }
    }

    /// Tells the kernels of the stage that comes next.
    pub(crate) fn enter(&self, stage: &Stage) {
        let base = self.geometry.shape;
        let shape = Shape {
            iterations: self.plan.solver.newton_iterations as u32,
            dt: stage.length as f32,
            theta: stage.theta as f32,
            time: stage.time as f32,
            coarse_kind: self.coarse.kind(stage),
            fields: base.fields | if stage.from.len() > 1 { FIELD_SEVERAL } else { 0 },
            ..base
        };
        if let Some(buffer) = self.buffers.get("shape") {
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&shape));
        }
    }

    /// Room for the weighted sum of several past states; a single one needs none.
    pub(crate) fn room_to_mix(&self, past: &[&State]) -> Option<State> {
        (past.len() > 1).then(|| State(self.lend(3)))
    }

    /// Runs `record` and hands what it recorded to the device.
    pub(crate) fn record(&self, record: impl FnOnce(&mut Recorder)) {
        let mut groups = self.groups.borrow_mut();
        let recorder = Recorder::new(&self.gpu, &self.buffers, &mut groups, self.timed);
        let mut recorder = recorder.counted(self.counter.as_ref());
        record(&mut recorder);
        self.last.replace(Some(recorder.submit(&mut self.times.borrow_mut())));
    }

    /// Waits for all but the last stages that were handed over: enough of them keep the device busy.
    pub(crate) fn keep_pace(&mut self) {
        while let Some(stage) = self.too_far_ahead() {
            self.gpu.wait_until(stage);
        }
    }

    /// The same, for whoever may not wait.
    pub(crate) async fn keep_pace_async(&mut self) {
        while let Some(stage) = self.too_far_ahead() {
            stage.done().await;
        }
    }

    /// The first of too many stages that were handed over.
    fn too_far_ahead(&mut self) -> Option<HandedOver> {
        self.ahead.extend(self.last.take().map(|work| self.gpu.handed_over(work)));
        if self.ahead.len() > AHEAD { self.ahead.pop_front() } else { None }
    }

    /// A buffer of `vectors` per node and member, from the pool.
    pub(crate) fn lend(&self, vectors: u64) -> Loan {
        let size = (vectors * VECTOR * u64::from(self.geometry.shape.nodes) * self.members() as u64).max(VECTOR);
        let mut pool = self.pool.lock().unwrap_or_else(PoisonError::into_inner);
        let known = pool.iter().rposition(|b| b.size() == size).map(|k| pool.remove(k));
        let made = known.map_or_else(|| self.gpu.buffer("state", size), Ok);
        let buffer = made.unwrap_or_else(|e| {
            self.gpu.keep(e);
            // Something to bind; the error is read before any number.
            self.gpu.small()
        });
        Loan { buffer, pool: self.pool.clone() }
    }
}
