//! An open device: its kernels, its errors, which are kept until somebody reads, and what it counts.

use super::error::GpuError;
use super::pipelines::Pipelines;
use super::trace::Trace;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// An open device with its kernels.
#[derive(Debug)]
pub struct Gpu {
    /// Name of the adapter.
    pub name: String,
    /// Its driver, with the version.
    pub driver: String,
    /// Kind of the adapter.
    pub kind: wgpu::DeviceType,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) pipelines: Pipelines,
    /// Largest buffer that a kernel can bind [B].
    pub(crate) largest: u64,
    /// Bytes of all buffers made so far.
    pub(super) made: AtomicU64,
    /// Times that the host has waited for results.
    pub(crate) waits: AtomicU64,
    pub(super) trouble: Arc<Mutex<Option<GpuError>>>,
    pub(super) lost: Arc<AtomicBool>,
    /// What is handed over, where somebody wants to know.
    pub(super) trace: Mutex<Option<Trace>>,
}

impl Gpu {
    /// Keeps an error unless an earlier one is kept already.
    pub(crate) fn keep(&self, error: GpuError) {
        keep(&self.trouble, error);
    }

    /// The first error since the last call.
    pub(crate) fn take_trouble(&self) -> Option<GpuError> {
        let e = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        if !matches!(e, GpuError::Refused { .. }) {
            return Some(e);
        }
        // On a lost device operations fail for all kinds of reasons, none of which is the cause; that it is lost may be known only
        // when nothing is in flight any more.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        Some(if self.is_lost() { GpuError::Lost { reason: e.to_string() } } else { e })
    }

    /// True when an error waits to be read.
    pub(crate) fn troubled(&self) -> bool {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// True when the device is gone for good: another must be opened. [`GpuBackend`](crate::GpuBackend)s on it fail from now on.
    pub fn is_lost(&self) -> bool {
        let _ = self.device.poll(wgpu::PollType::Poll);
        self.lost.load(Ordering::SeqCst)
    }

    /// Ends the device as a driver's reset would; whoever still computes on it gets an error.
    pub fn destroy(&self) {
        self.device.destroy();
    }

    /// How the eight lanes of a cell talk to each other.
    pub fn lanes(&self) -> super::pipelines::Lanes {
        self.pipelines.lanes
    }

    /// True for software adapters, which cap the loop iterations of an invocation.
    pub fn is_software(&self) -> bool {
        self.kind == wgpu::DeviceType::Cpu
    }

    /// Nanoseconds per tick of the device's clock, if it has one.
    pub fn tick(&self) -> Option<f32> {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| self.queue.get_timestamp_period())
    }

    /// The largest buffer that a kernel can bind [B].
    pub fn largest_buffer(&self) -> u64 {
        self.largest.min(self.device.limits().max_buffer_size)
    }

    /// Bytes that the device's memory holds now, as its allocator counts them; `None` where the driver's interface does not tell.
    pub fn allocated(&self) -> Option<u64> {
        // What is no longer needed is given back when the device is looked at.
        let _ = self.device.poll(wgpu::PollType::Poll);
        self.device.generate_allocator_report().map(|r| r.total_allocated_bytes)
    }

    /// Bytes of all buffers made so far, those included that are gone since, but for what looking at a body at rest takes in passing.
    pub fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    /// Counts from an earlier number on: what was made since is gone.
    pub(crate) fn forget_made(&self, earlier: u64) {
        self.made.store(earlier, Ordering::Relaxed);
    }
}

/// Keeps an error unless an earlier one is kept already.
pub(super) fn keep(slot: &Mutex<Option<GpuError>>, error: GpuError) {
    slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}
