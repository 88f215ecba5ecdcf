//! Records dispatches: a pass by its number, buffers by their names, sizes in members and items.

use super::count::{Count, Counter};
use super::error::GpuError;
use super::gpu::Gpu;
use super::pipelines::{PASSES, shared::roster};
use super::trace::{self, Submission, Work};
use crate::layout::Call;
use std::collections::HashMap;

/// Named buffers: what a pass finds under the names in its WGSL.
pub type Named<'a> = [(&'static str, &'a wgpu::Buffer)];

/// Buffers by the names that kernels know them by.
pub type Buffers = HashMap<&'static str, wgpu::Buffer>;

/// Most workgroups along one axis of a dispatch (the WebGPU limit; every device has at least this).
pub const MOST_GROUPS: u64 = roster::WIDEST as u64;

/// Beyond the limit of one axis a grid becomes two-dimensional; kernels flatten it again.
fn grid(members: usize, groups: usize) -> [u32; 2] {
    let total = (members * groups) as u64;
    [total.min(MOST_GROUPS) as u32, total.div_ceil(MOST_GROUPS) as u32]
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy, Debug)]
pub enum Size {
    /// Members × items, all of them.
    All {
        /// Members B.
        members: usize,
        /// Workgroups per member.
        groups: usize,
    },
    /// As the device wrote it at this byte of the buffer `arguments`.
    Indirect(u64),
    /// As the device wrote it in the buffer `gate`.
    Gate,
}

impl Size {
    /// Buffer and byte where the device wrote it.
    fn place(self) -> (&'static str, u64) {
        if let Size::Indirect(offset) = self { ("arguments", offset) } else { ("gate", 0) }
    }
}

/// Queries of one set, two a dispatch; a submission has as many sets as it needs. (WebGPU allows 4096.)
pub(crate) const QUERIES: u32 = 2048;

/// Time spent in one pass.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PassTime {
    /// Dispatches.
    pub count: u64,
    /// Nanoseconds on the device.
    pub nanoseconds: f64,
}

/// A command buffer in the making, over a set of buffers that all its passes can name.
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    world: &'a Buffers,
    encoder: wgpu::CommandEncoder,
    groups: &'a mut Groups,
    timer: Option<Timer>,
    // Dispatches share a compute pass unless they are timed one by one: opening one costs as much as ten dispatches.
    open: Option<wgpu::ComputePass<'static>>,
    // Of a device that is traced, and of one whose dispatches are counted.
    work: Option<Vec<Work>>,
    count: Option<Count<'a>>,
}

/// Bind groups that were made before, by pass and buffers.
pub type Groups = HashMap<(usize, Vec<wgpu::Buffer>), wgpu::BindGroup>;

struct Timer {
    /// Each full but the last.
    sets: Vec<wgpu::QuerySet>,
    passes: Vec<usize>,
}

impl Timer {
    /// Where the times of one more dispatch go.
    fn place(&mut self, device: &wgpu::Device, pass: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        let first = 2 * self.passes.len() as u32 % QUERIES;
        if first == 0 {
            let (label, ty) = (Some("pass times"), wgpu::QueryType::Timestamp);
            self.sets.push(device.create_query_set(&wgpu::QuerySetDescriptor { label, ty, count: QUERIES }));
        }
        self.passes.push(pass);
        wgpu::ComputePassTimestampWrites {
            query_set: &self.sets[self.sets.len() - 1],
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        }
    }
}

/// Arguments of a pass beside its buffers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Args {
    /// Time step.
    pub step: u32,
    /// 0 = static balance, 1 = step.
    pub mode: u32,
    /// Where the section of the roster starts whose members take part.
    pub roster: u32,
    /// Whatever the pass says.
    pub extra: u32,
}

impl<'a> Recorder<'a> {
    /// Starts recording.
    pub fn new(gpu: &'a Gpu, world: &'a Buffers, groups: &'a mut Groups, timed: bool) -> Recorder<'a> {
        let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("palpate") });
        let timer = (timed && gpu.tick().is_some()).then(|| Timer { sets: Vec::new(), passes: Vec::new() });
        let work = gpu.is_traced().then(Vec::new);
        Recorder { gpu, world, encoder, groups, timer, open: None, work, count: None }
    }

    /// The same, with its dispatches counted where there is a counter.
    pub(crate) fn counted(self, counter: Option<&'a Counter>) -> Recorder<'a> {
        Recorder { count: counter.map(Counter::begin), ..self }
    }

    /// Records one dispatch of `pass`. Buffers are looked up in `own` first, then in the world.
    pub fn run(&mut self, pass: usize, own: &Named, size: Size, args: Args) {
        if let Err(e) = self.try_run(pass, own, size, args) {
            self.gpu.keep(e);
        }
    }

    fn try_run(&mut self, pass: usize, own: &Named, size: Size, args: Args) -> Result<(), GpuError> {
        let source = &PASSES[pass];
        let kernel = self.gpu.pipelines.get(self.gpu, pass).map_err(Clone::clone)?;
        let mut buffers = Vec::with_capacity(source.bindings.len());
        for (name, ..) in source.bindings {
            let found = own.iter().find(|b| b.0 == *name).map(|b| b.1).or_else(|| self.world.get(name));
            buffers.push(found.cloned().ok_or_else(|| GpuError::Refused {
                message: format!("the pass {} was given no buffer called {name}", source.name),
            })?);
        }
        let call = Call { step: args.step, mode: args.mode, roster: args.roster, extra: args.extra };
        self.trace(pass, &buffers, call, size);
        let device = &self.gpu.device;
        let group = self.groups.entry((pass, buffers)).or_insert_with_key(|(_, buffers)| {
            let entries: Vec<wgpu::BindGroupEntry> = source
                .bindings
                .iter()
                .zip(buffers)
                .map(|(b, buffer)| wgpu::BindGroupEntry { binding: b.1, resource: buffer.as_entire_binding() })
                .collect();
            let label = Some(source.name);
            device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout: &kernel.layout, entries: &entries })
        });
        if let Some(count) = &mut self.count {
            match size {
                Size::All { members, groups } => count.add(grid(members, groups)),
                Size::Indirect(_) | Size::Gate => {
                    let (name, offset) = size.place();
                    if let Some(sizes) = self.world.get(name) {
                        self.open = None;
                        count.add_written(&mut self.encoder, sizes, offset);
                    }
                }
            }
        }
        let timestamp_writes = self.timer.as_mut().map(|t| t.place(device, pass));
        if timestamp_writes.is_some() {
            self.open = None;
        }
        let compute = self.open.get_or_insert_with(|| {
            let label = if timestamp_writes.is_some() { source.name } else { "passes" };
            self.encoder
                .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
                .forget_lifetime()
        });
        compute.set_pipeline(&kernel.pipeline);
        compute.set_bind_group(0, &*group, &[]);
        compute.set_immediates(0, bytemuck::bytes_of(&call));
        match size {
            Size::All { members, groups } => {
                let [x, y] = grid(members, groups);
                compute.dispatch_workgroups(x, y, 1);
            }
            Size::Indirect(_) | Size::Gate => {
                let (name, offset) = size.place();
                let Some(sizes) = self.world.get(name) else {
                    return Err(GpuError::Refused { message: format!("no buffer called {name}") });
                };
                compute.dispatch_workgroups_indirect(sizes, offset);
            }
        }
        Ok(())
    }

    /// Writes a dispatch down where the device is traced.
    fn trace(&mut self, pass: usize, buffers: &[wgpu::Buffer], call: Call, size: Size) {
        let Some(work) = &mut self.work else { return };
        let Some(buffers) = buffers.iter().map(|b| self.gpu.traced(b)).collect::<Option<Vec<usize>>>() else { return };
        let groups = match size {
            Size::All { members, groups } => Some(trace::Groups::All(grid(members, groups))),
            Size::Indirect(_) | Size::Gate => {
                let (name, offset) = size.place();
                self.world.get(name).and_then(|sizes| Some(trace::Groups::At(self.gpu.traced(sizes)?, offset)))
            }
        };
        let call = [call.step, call.mode, call.roster, call.extra];
        work.extend(groups.map(|groups| Work::Dispatch { pass, buffers, call, groups }));
    }

    /// Copies `bytes` from a place in a buffer to a place in another.
    pub fn copy_part(&mut self, [from, to]: [(&wgpu::Buffer, u64); 2], bytes: u64) {
        self.open = None;
        if let Some(work) = &mut self.work {
            let places = self.gpu.traced(from.0).zip(self.gpu.traced(to.0));
            work.extend(places.map(|(a, b)| Work::Copy([(a, from.1), (b, to.1)], bytes)));
        }
        self.encoder.copy_buffer_to_buffer(from.0, from.1, to.0, to.1, bytes);
    }

    /// Sets a buffer to zero.
    pub fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.open = None;
        if let Some(work) = &mut self.work {
            work.extend(self.gpu.traced(buffer).map(Work::Clear));
        }
        self.encoder.clear_buffer(buffer, 0, None);
    }

    /// Hands the work to the device, and says which it is; does not wait, unless passes are timed: then adds their times.
    pub fn submit(mut self, times: &mut HashMap<&'static str, PassTime>) -> wgpu::SubmissionIndex {
        self.open = None;
        if let Some(work) = self.work.take().filter(|w| !w.is_empty()) {
            return self.submit_traced(work);
        }
        if let Some(count) = self.count.take() {
            let submitted = self.gpu.queue.submit([self.encoder.finish()]);
            count.end(self.gpu);
            return submitted;
        }
        let Some(timer) = self.timer.take().filter(|t| !t.passes.is_empty()) else {
            return self.gpu.queue.submit([self.encoder.finish()]);
        };
        let count = 2 * timer.passes.len() as u32;
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pass times"),
            size: u64::from(count) * 8,
            usage,
            mapped_at_creation: false,
        });
        for (set, first) in timer.sets.iter().zip((0..count).step_by(QUERIES as usize)) {
            self.encoder.resolve_query_set(set, 0..(count - first).min(QUERIES), &resolved, 8 * u64::from(first));
        }
        let submitted = self.gpu.queue.submit([self.encoder.finish()]);
        match self.gpu.download::<u64>(&resolved, count as usize) {
            Ok(ticks) => {
                let tick = f64::from(self.gpu.tick().unwrap_or(1.0));
                for (pair, pass) in ticks.chunks_exact(2).zip(&timer.passes) {
                    let t = times.entry(PASSES[*pass].name).or_default();
                    t.count += 1;
                    t.nanoseconds += pair[1].saturating_sub(pair[0]) as f64 * tick;
                }
            }
            Err(e) => self.gpu.keep(e),
        }
        submitted
    }

    /// The same of a device that is traced: waits for it before and after.
    fn submit_traced(self, all: Vec<Work>) -> wgpu::SubmissionIndex {
        let mut buffers = Vec::new();
        for work in &all {
            match work {
                Work::Dispatch { buffers: own, groups, .. } => {
                    buffers.extend(own);
                    buffers.extend(if let trace::Groups::At(sizes, _) = groups { Some(*sizes) } else { None });
                }
                Work::Copy([from, to], _) => buffers.extend([from.0, to.0]),
                Work::Clear(buffer) => buffers.push(*buffer),
            }
        }
        buffers.sort_unstable();
        buffers.dedup();
        let before = self.gpu.contents(&buffers);
        let submitted = self.gpu.queue.submit([self.encoder.finish()]);
        match before.and_then(|before| Ok((before, self.gpu.contents(&buffers)?))) {
            Ok((before, after)) => self.gpu.add_traced(Submission { buffers, before, after, work: all }),
            Err(e) => self.gpu.keep(e),
        }
        submitted
    }
}
