//! Counts dispatches, and those that had something to do: what benchmarks report where no clock tells anything of a graphics processor.

use super::buffers::Maker as _;
use super::error::GpuError;
use super::gpu::Gpu;
use std::cell::Cell;

/// Dispatches of some work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dispatches {
    /// Recorded by the host.
    pub recorded: u64,
    /// Those of at least one workgroup.
    pub live: u64,
    /// Workgroups of all of them.
    pub workgroups: u64,
}

/// Most dispatches of a submission whose sizes the device writes.
const MOST: u64 = 1 << 17;
/// Bytes of a size.
const SIZE: u64 = 12;

/// Where sizes go that the device wrote, and what was counted so far.
#[derive(Debug)]
pub(crate) struct Counter {
    sizes: wgpu::Buffer,
    all: Cell<Dispatches>,
}

impl Counter {
    /// # Errors
    /// No room for the sizes.
    pub(crate) fn new(gpu: &Gpu) -> Result<Counter, GpuError> {
        Ok(Counter { sizes: gpu.buffer("counted sizes", MOST * SIZE)?, all: Cell::default() })
    }

    /// What was counted so far.
    pub(crate) fn dispatches(&self) -> Dispatches {
        self.all.get()
    }

    /// A submission's count.
    pub(crate) fn begin(&self) -> Count<'_> {
        Count { counter: self, own: Dispatches::default(), written: 0 }
    }
}

/// What a submission has come to.
pub(crate) struct Count<'a> {
    counter: &'a Counter,
    own: Dispatches,
    written: u64,
}

impl Count<'_> {
    /// Counts a dispatch of this size.
    pub(super) fn add(&mut self, [x, y]: [u32; 2]) {
        let workgroups = u64::from(x) * u64::from(y);
        self.own.recorded += 1;
        self.own.live += u64::from(workgroups > 0);
        self.own.workgroups += workgroups;
    }

    /// Counts one whose size the device has written by then.
    pub(super) fn add_written(&mut self, encoder: &mut wgpu::CommandEncoder, sizes: &wgpu::Buffer, offset: u64) {
        self.own.recorded += 1;
        if self.written < MOST {
            encoder.copy_buffer_to_buffer(sizes, offset, &self.counter.sizes, SIZE * self.written, SIZE);
            self.written += 1;
        }
    }

    /// Adds it to the counter, once the submission was handed over; waits for it.
    pub(super) fn end(mut self, gpu: &Gpu) {
        match gpu.download::<[u32; 3]>(&self.counter.sizes, self.written as usize) {
            Ok(sizes) => {
                let recorded = self.own.recorded;
                sizes.iter().for_each(|s| self.add([s[0], s[1]]));
                self.own.recorded = recorded;
                let before = self.counter.all.get();
                self.counter.all.set(Dispatches {
                    recorded: before.recorded + self.own.recorded,
                    live: before.live + self.own.live,
                    workgroups: before.workgroups + self.own.workgroups,
                });
            }
            Err(e) => gpu.keep(e),
        }
    }
}
