//! An open device: its kernels, its errors, which are kept until somebody reads, and what it counts.

use super::error::GpuError;
use super::host::Host;
use super::pipelines::Pipelines;
use super::trace::Trace;
use super::wait;
use std::collections::HashMap;
use std::fmt;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::{self, ThreadId};

/// The first error since it was read last, of every thread: those that compute side by side do not end each other's work.
pub(super) type Troubles = Mutex<HashMap<ThreadId, GpuError>>;

/// What scopes of errors have caught, where a device says it later.
#[derive(Default)]
pub(super) struct Scopes(Mutex<Vec<Scope>>);

type Scope = Pin<Box<dyn Future<Output = Option<GpuError>> + Send>>;

impl fmt::Debug for Scopes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Scopes")
    }
}

/// An open device with its kernels.
#[derive(Debug)]
pub struct Gpu {
    /// Name of the adapter.
    pub name: String,
    /// Its driver, with the version.
    pub driver: String,
    /// Kind of the adapter.
    pub kind: wgpu::DeviceType,
    pub(super) host: Arc<dyn Host>,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) pipelines: Pipelines,
    /// Largest buffer that a kernel can bind [B].
    pub(crate) largest: u64,
    /// Bytes of all buffers made so far.
    pub(super) made: AtomicU64,
    /// Times that the host has waited for results.
    pub(crate) waits: AtomicU64,
    pub(super) trouble: Arc<Troubles>,
    pub(super) scopes: Scopes,
    pub(super) lost: Arc<AtomicBool>,
    /// How many workgroups are known to run at the same time, once somebody has asked.
    pub(crate) together: OnceLock<u32>,
    /// What is handed over, where somebody wants to know.
    pub(super) trace: Mutex<Option<Trace>>,
}

impl Gpu {
    /// Keeps an error of this thread unless an earlier one is kept already.
    pub(crate) fn keep(&self, error: GpuError) {
        keep(&self.trouble, error);
    }

    /// The first error of this thread since the last call.
    pub(crate) fn take_trouble(&self) -> Option<GpuError> {
        self.wait_for(self.trouble()).unwrap_or_else(Some)
    }

    /// The same, for whoever may not wait.
    pub(crate) async fn trouble(&self) -> Option<GpuError> {
        let scopes = std::mem::take(&mut *self.scopes.0.lock().unwrap_or_else(PoisonError::into_inner));
        for scope in scopes {
            scope.await.into_iter().for_each(|e| self.keep(e));
        }
        let e = self.trouble.lock().unwrap_or_else(PoisonError::into_inner).remove(&thread::current().id())?;
        if !matches!(e, GpuError::Refused { .. }) {
            return Some(e);
        }
        // On a lost device operations fail for all kinds of reasons, none of which is the cause; that it is lost may be known only
        // when nothing is in flight any more.
        if !self.is_lost() {
            self.done().await;
        }
        Some(if self.is_lost() { GpuError::Lost { reason: e.to_string() } } else { e })
    }

    /// What a scope of errors has caught, where the device says so at once; else whoever reads next hears of it.
    pub(crate) fn caught(&self, scope: impl Future<Output = Option<GpuError>> + Send + 'static) -> Option<GpuError> {
        let mut scope: Scope = Box::pin(scope);
        wait::now(scope.as_mut()).unwrap_or_else(|| {
            self.scopes.0.lock().unwrap_or_else(PoisonError::into_inner).push(scope);
            None
        })
    }

    /// Whoever lends it clock and memory.
    pub fn host(&self) -> &dyn Host {
        &*self.host
    }

    /// Seconds since any moment.
    ///
    /// # Errors
    /// The host has no clock.
    pub(crate) fn seconds(&self) -> Result<f64, GpuError> {
        self.host.seconds().ok_or(GpuError::NoClock)
    }

    /// True when an error of this thread waits to be read.
    pub(crate) fn troubled(&self) -> bool {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).contains_key(&thread::current().id())
    }

    /// True when the device is gone for good: another must be opened. [`GpuBackend`](crate::GpuBackend)s on it fail from now on.
    pub fn is_lost(&self) -> bool {
        self.look();
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
        self.look();
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

/// Keeps an error of this thread unless an earlier one is kept already.
pub(super) fn keep(troubles: &Troubles, error: GpuError) {
    troubles.lock().unwrap_or_else(PoisonError::into_inner).entry(thread::current().id()).or_insert(error);
}
