//! What is handed to a device, written down so that another implementation of WebGPU can do the same.

use super::error::GpuError;
use super::gpu::Gpu;
use std::sync::PoisonError;

/// Everything that was handed over between [`Gpu::trace`] and [`Gpu::take_trace`].
#[derive(Debug, Default)]
pub struct Trace {
    /// Bytes of every buffer.
    pub sizes: Vec<u64>,
    /// In their order.
    pub submissions: Vec<Submission>,
    buffers: Vec<wgpu::Buffer>,
}

/// A list of work, with what its buffers hold before and after.
#[derive(Debug)]
pub struct Submission {
    /// Buffers by their numbers.
    pub buffers: Vec<usize>,
    /// Their bytes, in the same order.
    pub before: Vec<Vec<u8>>,
    /// The same afterwards.
    pub after: Vec<Vec<u8>>,
    /// What is done.
    pub work: Vec<Work>,
}

/// One entry of a list, with buffers by their numbers.
#[derive(Debug)]
pub enum Work {
    /// A kernel.
    Dispatch {
        /// Its number in [`super::pipelines::PASSES`].
        pass: usize,
        /// In the order of its bindings.
        buffers: Vec<usize>,
        /// Its own arguments.
        call: [u32; 4],
        /// Workgroups, or the buffer and the byte where they stand.
        groups: Groups,
    },
    /// A part of a buffer to a part of another: buffers and bytes, and how many.
    Copy([(usize, u64); 2], u64),
    /// A buffer becomes zero.
    Clear(usize),
}

/// How many workgroups a traced dispatch has.
#[derive(Debug)]
pub enum Groups {
    /// Along both axes.
    All([u32; 2]),
    /// As a buffer says from a byte on.
    At(usize, u64),
}

impl Trace {
    /// Number of a buffer.
    pub(crate) fn number(&mut self, buffer: &wgpu::Buffer) -> usize {
        self.buffers.iter().position(|b| b == buffer).unwrap_or_else(|| {
            self.buffers.push(buffer.clone());
            self.sizes.push(buffer.size());
            self.buffers.len() - 1
        })
    }
}

impl Gpu {
    /// Traces from here on. Every list of work then waits for the device, twice.
    pub fn trace(&self) {
        *self.trace.lock().unwrap_or_else(PoisonError::into_inner) = Some(Trace::default());
    }

    /// Ends tracing; `None` where it was not begun.
    pub fn take_trace(&self) -> Option<Trace> {
        self.trace.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// True between [`Gpu::trace`] and [`Gpu::take_trace`].
    pub(super) fn is_traced(&self) -> bool {
        self.trace.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Number of a buffer in the trace that is being made.
    pub(crate) fn traced(&self, buffer: &wgpu::Buffer) -> Option<usize> {
        Some(self.trace.lock().unwrap_or_else(PoisonError::into_inner).as_mut()?.number(buffer))
    }

    /// What buffers of the trace hold.
    pub(super) fn contents(&self, buffers: &[usize]) -> Result<Vec<Vec<u8>>, GpuError> {
        let all: Vec<wgpu::Buffer> = {
            let trace = self.trace.lock().unwrap_or_else(PoisonError::into_inner);
            trace.iter().flat_map(|t| buffers.iter().map(|k| t.buffers[*k].clone())).collect()
        };
        let parts: Vec<(&wgpu::Buffer, usize)> = all.iter().map(|b| (b, b.size() as usize)).collect();
        self.download_all(&parts)
    }

    /// Adds a list of work.
    pub(super) fn add_traced(&self, submission: Submission) {
        if let Some(trace) = self.trace.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
            trace.submissions.push(submission);
        }
    }
}
