//! What benchmarks ask a device: how long passes take, how fast it copies, what an iteration of conjugate gradients takes and moves.

use super::faster;
use crate::device::Maker as _;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::structs::TANGENT_VECTORS;
use crate::device::recorder::PassTime;
use crate::device::{Counter, Dispatches, Gpu, GpuError};
use crate::layout::Newton;
use crate::passes::Passes;
use crate::world::Product;
use crate::world::{State, Tally, VECTOR, World, coarse_vectors};
use palpate_engine::Request;

/// Time of some work of all members, and what it has to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traffic {
    /// Time [s].
    pub seconds: f64,
    /// Numbers read and written, each once [B].
    pub bytes: f64,
}

/// How fast conjugate gradients are: what steps spend their time on.
#[derive(Clone, Debug, PartialEq)]
pub struct CgSpeed {
    /// True when many workgroups share the solve of a member.
    pub many: bool,
    /// How A p is computed.
    pub product: Product,
    /// A whole iteration, as solves run it.
    pub iteration: Traffic,
    /// Iterations that were timed.
    pub iterations: usize,
    /// Each product A p by itself; empty where one workgroup does a whole iteration, as no such product runs there.
    pub products: Vec<(Product, Traffic)>,
}

/// Iterations that are timed, where the host counts them; an even number, and fewer than the smallest body needs to converge.
const ITERATIONS: u32 = 16;

/// A body at rest, and where its solves report to.
struct Rest {
    tally: Tally,
    blank: State,
}

impl Gpu {
    /// Measured bandwidth of a copy between buffers of the device, reading and writing counted [B/s].
    ///
    /// # Errors
    /// No memory for it, the device is gone, or its host has no clock.
    pub fn copy_bandwidth(&self) -> Result<f64, GpuError> {
        let bytes = self.largest.min(64 << 20);
        let (from, to) = (self.buffer("copy from", bytes)?, self.buffer("copy to", bytes)?);
        let copy = |times: u32| {
            let begun = self.seconds()?;
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("copy") });
            (0..times).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
            self.queue.submit([encoder.finish()]);
            self.wait()?;
            Ok(self.seconds()? - begun)
        };
        copy(1)?;
        let one = copy(1)?;
        // Many copies less one leave out what submitting takes.
        let seconds = (copy(9)? - one).max(1e-9);
        Ok(2.0 * 8.0 * bytes as f64 / seconds)
    }
}

impl World {
    /// Times every pass from here on, one by one, which makes steps slower.
    pub fn time_passes(&mut self, on: bool) {
        self.timed = on;
        self.times.borrow_mut().clear();
    }

    /// Time per pass since [`World::time_passes`], the longest first; empty where the device has no clock.
    pub fn pass_times(&self) -> Vec<(&'static str, PassTime)> {
        let mut all: Vec<_> = self.times.borrow().iter().map(|(name, t)| (*name, t.clone())).collect();
        all.sort_by(|a, b| b.1.nanoseconds.total_cmp(&a.1.nanoseconds).then(a.0.cmp(b.0)));
        all
    }

    /// Counts dispatches from here on; every list of work then waits for the device.
    ///
    /// # Errors
    /// No room for their sizes.
    pub fn count_dispatches(&mut self, on: bool) -> Result<(), GpuError> {
        self.counter = if on { Some(Counter::new(&self.gpu)?) } else { None };
        Ok(())
    }

    /// Dispatches since [`World::count_dispatches`].
    pub fn dispatches(&self) -> Dispatches {
        self.counter.as_ref().map_or_else(Dispatches::default, Counter::dispatches)
    }

    /// Iterations of Newton's method and of conjugate gradients that every member took for the latest stage.
    ///
    /// # Errors
    /// The device is gone.
    pub fn iterations(&self) -> Result<Vec<[u32; 2]>, GpuError> {
        let all: Vec<Newton> = self.gpu.download(&self.buffers["newton"], self.members())?;
        Ok(all.iter().map(|n| [n.iteration, n.total]).collect())
    }

    /// Iterations of conjugate gradients that every member took for the latest derivative.
    ///
    /// # Errors
    /// The device is gone.
    pub fn derivative_iterations(&self) -> Result<Vec<u32>, GpuError> {
        let all: Vec<Newton> = self.gpu.download(&self.buffers["newton"], self.members())?;
        Ok(all.iter().map(|n| n.cg).collect())
    }

    /// What an iteration of conjugate gradients of all members moves, and a round of Newton's method without them [B]: every number once.
    pub fn bytes_of_iteration_and_round(&self) -> [f64; 2] {
        let s = &self.geometry.shape;
        let [nodes, cells, blocks, patches] = [s.nodes, s.cells, s.blocks, s.patches].map(f64::from);
        // Forces and tangents of cells, written and read again by nodes and blocks; the matrix; states, residuals, inverses and solutions.
        let tangents = VECTOR as f64 * f64::from(TANGENT_VECTORS);
        let of_cells = 2.0 * 16.0 * VECTOR as f64 + 2.0 * tangents + 64.0;
        let round = cells * of_cells + 36.0 * blocks + 48.0 * 2.0 * patches + 40.0 * VECTOR as f64 * nodes;
        [self.bytes_of_iteration(), self.members() as f64 * round]
    }

    fn bytes_of_iteration(&self) -> f64 {
        // Way, solution and residuals are read and written: 9 vectors a node beside those of the product, and the second level, which members share.
        let shape = &self.geometry.shape;
        let vectors = 9.0 * self.members() as f64 * f64::from(shape.nodes) + coarse_vectors(shape.groups as usize) as f64;
        self.bytes_of(self.product) + VECTOR as f64 * vectors
    }

    /// Time and traffic of conjugate gradients with the current batch: the body at rest, under a load in all directions.
    ///
    /// # Errors
    /// The device is gone, or its host has no clock.
    pub fn cg_speed(&mut self) -> Result<CgSpeed, GpuError> {
        // The shape goes to the device with this.
        self.set_iterations(self.plan.solver.newton_iterations);
        self.time_cg()
    }

    fn time_cg(&self) -> Result<CgSpeed, GpuError> {
        let products = if self.many { vec![Product::Matrix, Product::Free] } else { Vec::new() };
        let alone = |p: Product| Ok((p, Traffic { seconds: faster::time(self, p)?, bytes: self.bytes_of(p) }));
        let products = products.into_iter().map(alone).collect::<Result<Vec<_>, GpuError>>()?;
        let rest = Rest { tally: Tally::new(self, &Request::default()), blank: State(self.lend(3)) };
        self.record(|r| r.clear(&rest.blank.0.buffer));
        self.work(&rest, |s| s.linearise());
        let run = |repeats: u32| {
            self.begin(&rest)?;
            let begun = self.gpu.seconds()?;
            self.work(&rest, |s| {
                s.list();
                s.begin_cg(asks::FOR_DERIVATIVE);
                if self.many {
                    s.precondition();
                }
                (0..repeats).for_each(|k| if self.many { s.iterate(k % 2) } else { s.iterate_chunk(asks::FOR_DERIVATIVE) });
            });
            self.gpu.download::<f32>(&self.buffers["cg_sums"], 1)?;
            Ok(self.gpu.seconds()? - begun)
        };
        let repeats = if self.many { ITERATIONS } else { 1 };
        // The first run compiles the kernels.
        run(repeats)?;
        let seconds = (faster::shortest(|| run(repeats))? - faster::shortest(|| run(0))?).max(1e-6);
        run(repeats)?;
        let iterations = self.iterations_done()?;
        let bytes = self.bytes_of_iteration();
        let iteration = Traffic { seconds: seconds / iterations.max(1) as f64, bytes };
        Ok(CgSpeed { many: self.many, product: self.product, iteration, iterations, products })
    }

    fn work(&self, rest: &Rest, record: impl FnOnce(&mut Passes)) {
        self.record(|r| record(&mut Passes::new(self, r, Some(0), &rest.blank, &rest.blank, &rest.tally)));
    }

    /// Makes a solve ready that does not end by itself.
    fn begin(&self, rest: &Rest) -> Result<(), GpuError> {
        let count = self.plan.body.nodes.len() * self.members();
        let wave = |i: usize| [(i as f32).sin(), (2.0 * i as f32).cos(), (3.0 * i as f32).sin(), 0.0f32];
        let load: Vec<[f32; 4]> = (0..count).map(wave).collect();
        self.gpu.queue.write_buffer(&self.buffers["rhs"], 0, bytemuck::cast_slice(&load));
        self.work(rest, |s| {
            s.list();
            s.begin_column(0);
        });
        let newton = &self.buffers["newton"];
        let mut state: Vec<Newton> = self.gpu.download(newton, self.members())?;
        // A norm that nothing is below.
        state.iter_mut().for_each(|n| (n.goal, n.forcing) = (-1.0, -1.0));
        self.gpu.queue.write_buffer(newton, 0, bytemuck::cast_slice(&state));
        self.gpu.wait()
    }

    /// Iterations that the first member's solve has made.
    fn iterations_done(&self) -> Result<usize, GpuError> {
        if self.many {
            let scalars: Vec<[f32; 4]> = self.gpu.download(&self.buffers["cg_sums"], 2)?;
            return Ok(scalars[0][1].max(scalars[1][1]) as usize);
        }
        Ok(self.gpu.download::<Newton>(&self.buffers["newton"], 1)?[0].cg as usize)
    }

    /// What a product has to move for all members: what each has of its own, and what they share [B].
    fn bytes_of(&self, product: Product) -> f64 {
        let s = &self.geometry.shape;
        let [nodes, cells, blocks, patches] = [s.nodes, s.cells, s.blocks, s.patches].map(f64::from);
        let (own, shared) = match product {
            // Values and two vectors; columns, rows and masses.
            Product::Matrix => (36.0 * blocks + 32.0 * nodes, 4.0 * blocks + 20.0 * nodes),
            // Tangents, corner forces (written and read), contact and two vectors; cells, corners, patches, element matrices, masses,
            // ghosts.
            Product::Free => (
                (480.0 + 2.0 * 128.0) * cells + 48.0 * patches + 32.0 * nodes,
                (64.0 + 32.0) * cells
                    + 64.0 * patches
                    + 2304.0 * f64::from(s.classes)
                    + 24.0 * nodes
                    + 8.0 * f64::from(s.ghosts) * blocks,
            ),
        };
        own * self.members() as f64 + shared
    }
}
