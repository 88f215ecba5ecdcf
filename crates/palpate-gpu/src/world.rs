//! What the backend holds: buffers of a plan and a batch, states on loan from a pool, adjoints, tangents, tallies.

use crate::choices::Choices;
use crate::device::Gpu;
use crate::effort::Level;
use crate::error::GpuError;
use crate::geometry::{self, Geometry};
use crate::layout::{Health, Newton, Shape};
use crate::members::Batch;
use crate::memory::Maker as _;
use crate::observe::Observer;
use crate::pipelines::shared::{roster, structs};
use crate::recorder::{Groups, PassTime, Recorder};
use crate::tuning::{self, Product, Tuning};
use palpate_engine::ParamBatch;
use palpate_model::effects::sensors::Sensors;
use palpate_model::plan::Plan;
use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Buffers by the names that kernels know them by.
pub type Buffers = HashMap<&'static str, wgpu::Buffer>;

/// Bytes of a node's vector.
pub(crate) const VECTOR: u64 = 16;

/// A plan made ready on a device, and the current batch.
#[derive(Debug)]
pub struct World {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) plan: Plan,
    pub(crate) geometry: Geometry,
    pub(crate) batch: Batch,
    pub(crate) observer: Observer,
    pub(crate) capacity: usize,
    pub(crate) buffers: Buffers,
    pool: Arc<Mutex<Vec<wgpu::Buffer>>>,
    groups: RefCell<Groups>,
    /// Time on the device per pass, when asked for.
    pub(crate) times: RefCell<HashMap<&'static str, PassTime>>,
    pub(crate) timed: bool,
    /// True when many workgroups share the solve of a member.
    pub(crate) many: bool,
    pub(crate) product: Product,
    pub(crate) effort: Level,
    /// True where its owner runs one simulation at a time.
    pub(crate) alone: bool,
}

/// One work buffer: name, items per member as a function of the shape, bytes per item.
type Work = (&'static str, fn(&Shape) -> u32, u64);

/// Work space per member.
const WORK: [Work; 20] = [
    ("increment", |s| s.nodes, VECTOR),
    ("direction", |s| s.nodes, VECTOR),
    ("trial", |s| s.nodes, VECTOR),
    ("residual", |s| s.nodes, VECTOR),
    ("sizes", |s| 2 * s.nodes, VECTOR),
    ("old_force", |s| s.nodes, VECTOR),
    ("rhs", |s| s.nodes, VECTOR),
    ("column", |s| s.nodes, VECTOR),
    ("cg_rest", |s| s.nodes, VECTOR),
    ("cg_along", |s| s.nodes, VECTOR),
    ("cg_image", |s| s.nodes, VECTOR),
    ("inverses", |s| 2 * s.nodes, VECTOR),
    ("values", |s| 9 * s.blocks, 4),
    ("tangents", |s| structs::TANGENT_VECTORS * s.cells, VECTOR),
    ("cell_force", |s| 8 * s.cells, VECTOR),
    ("law_modes", |s| s.cells * modes(s.fields), VECTOR),
    ("cell_support", |s| 8 * s.cells, VECTOR),
    ("old_stress", |s| 8 * s.cells, VECTOR),
    ("touches", |s| 3 * s.patches, VECTOR),
    ("hold_forces", |s| 8 * s.holds, VECTOR),
];

/// The same per column of a member that is solved for at the same time as others.
const OF_COLUMN: [Work; 4] = [
    ("cg_scalars", |_| 4, VECTOR),
    ("cg_parts", |s| 2 * s.nodes.div_ceil(roster::NARROW), 4),
    ("newton", |_| 1, size_of::<Newton>() as u64),
    ("column_health", |_| 1, size_of::<Health>() as u64),
];

/// Vectors that such a column has of its own while several are solved for; one alone uses those of the work space.
pub(crate) const COLUMN_VECTORS: [&str; 4] = ["direction", "cg_rest", "cg_along", "cg_image"];

/// Vectors that laws of cells need per cell for the matrix (`shared/modes.wgsl`).
fn modes(fields: u32) -> u32 {
    match (fields >> structs::SCALARS_AT) & structs::MOST_SCALARS {
        0 => 0,
        n => 1 + 8 * (n + 1) + 2 * n,
    }
}

/// Sections of the roster, and kinds of items, of `list_members`.
pub(crate) const SECTIONS: usize = roster::SECTIONS as usize;
pub(crate) const KINDS: usize = roster::KINDS as usize;

/// Work buffers of a batch, with their bytes.
pub(crate) fn work(shape: &Shape, members: usize) -> Vec<(&'static str, u64)> {
    let systems = geometry::columns(members as u64) * members as u64;
    let each = WORK.iter().map(|w| (w, members as u64)).chain(OF_COLUMN.iter().map(|w| (w, systems)));
    let own = each.map(|((name, items, bytes), count)| (*name, u64::from(items(shape)) * bytes * count));
    let shared: [(&'static str, u64); 5] = [
        ("shape", size_of::<Shape>() as u64),
        ("roster", 4 * SECTIONS as u64 * (systems + 1)),
        ("arguments", 12 * (SECTIONS * KINDS) as u64),
        ("gate", 12),
        // Where listings that may not change `gate` write instead.
        ("no_gate", 12),
    ];
    own.chain(shared).collect()
}

impl World {
    pub(crate) fn new(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
        let tuning = tuning.on_device(&gpu, plan)?;
        let mut buffers = Buffers::new();
        let capacity = members.max(1);
        let many = plan.body.nodes.len() >= tuning.many_from;
        let geometry = Geometry::new(&*gpu, plan, capacity, many, &mut buffers)?;
        for (name, bytes) in work(&geometry.shape, capacity) {
            buffers.insert(name, gpu.buffer(name, bytes)?);
        }
        let observer = Observer::new(&gpu, plan, capacity)?;
        let effort = Level::new(!gpu.is_software());
        let mut world = World {
            gpu,
            plan: plan.clone(),
            geometry,
            batch: Batch::default(),
            observer,
            capacity,
            buffers,
            pool: Arc::default(),
            groups: RefCell::default(),
            times: RefCell::default(),
            timed: false,
            many,
            product: tuning.product.unwrap_or(Product::Matrix),
            effort,
            alone: false,
        };
        if world.geometry.effects.on_nodes() || world.geometry.effects.on_cells() {
            // What effects add to blocks is in the matrix alone.
            world.product = Product::Matrix;
        } else if many && tuning.product.is_none() {
            world.product = tuning::faster(&mut world, &Choices::of_user())?;
        }
        Ok(world)
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
        let set = self.batch.set(&self.gpu, &self.plan, &self.geometry, theta, &mut self.buffers);
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
        self.observer.set(&self.gpu, &starts, &sensors);
    }

    /// Tells the kernels how many Newton iterations they have.
    pub(crate) fn set_iterations(&mut self, iterations: usize) {
        self.geometry.shape.iterations = iterations as u32;
        if let Some(buffer) = self.buffers.get("shape") {
            self.gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&self.geometry.shape));
        }
    }

    /// Runs `record` and hands what it recorded to the device.
    pub(crate) fn record(&self, record: impl FnOnce(&mut Recorder)) {
        let mut groups = self.groups.borrow_mut();
        let mut recorder = Recorder::new(&self.gpu, &self.buffers, &mut groups, self.timed);
        record(&mut recorder);
        recorder.submit(&mut self.times.borrow_mut());
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

/// A buffer that goes back to the pool when it is no longer needed.
#[derive(Debug)]
pub struct Loan {
    /// The buffer.
    pub(crate) buffer: wgpu::Buffer,
    pool: Arc<Mutex<Vec<wgpu::Buffer>>>,
}

impl Loan {
    /// Sets the buffer to zero, after everything handed to the device before.
    pub(crate) fn clear(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("clear") });
        encoder.clear_buffer(&self.buffer, 0, None);
        gpu.queue.submit([encoder.finish()]);
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(self.buffer.clone());
    }
}

/// u (two parts) and v of every member, `[3][B][N]` vectors.
#[derive(Debug)]
pub struct State(pub(crate) Loan);

/// dJ/du and dJ/dv of every member, `[2][B][N]` vectors.
#[derive(Debug)]
pub struct Adjoint(pub(crate) Loan);

/// du/dθ_q and dv/dθ_q, one buffer of `[2][B][N]` vectors per direction.
#[derive(Debug)]
pub struct Tangent {
    pub(crate) directions: Vec<usize>,
    pub(crate) parts: Vec<Loan>,
}

/// Everything to be read of every member.
#[derive(Debug)]
pub struct Tally {
    pub(crate) directions: Vec<usize>,
    /// health `[B]`, gradient `[B, P]`, and what observations add.
    pub(crate) buffers: Buffers,
}

/// What a tally of B members and P parameters holds beside observations, in bytes.
pub(crate) fn tally_sizes(b: u64, p: u64) -> [(&'static str, u64); 2] {
    [("health", b * size_of::<Health>() as u64), ("gradient", 4 * b * p)]
}

impl Tally {
    pub(crate) fn new(world: &World, directions: &[usize]) -> Tally {
        let (b, p) = (world.members() as u64, world.plan.layout.len() as u64);
        let mut buffers = Buffers::new();
        for (name, bytes) in tally_sizes(b, p) {
            let buffer = world.gpu.buffer(name, bytes).unwrap_or_else(|e| {
                world.gpu.keep(e);
                world.gpu.small()
            });
            buffers.insert(name, buffer);
        }
        world.observer.extend_tally(&world.gpu, directions, &mut buffers);
        Tally { directions: directions.to_vec(), buffers }
    }

    pub(crate) fn get(&self, name: &'static str) -> &wgpu::Buffer {
        &self.buffers[name]
    }
}
