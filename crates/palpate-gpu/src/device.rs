//! Adapters and the device: what there is, what it can do, and a place where its errors are kept until somebody reads.

use crate::error::GpuError;
use crate::memory::Maker;
use crate::pipelines::Pipelines;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Which adapter to use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// A discrete GPU before an integrated one before a software one.
    #[default]
    Auto,
    /// The first whose name holds this text (case ignored).
    Named(String),
}

impl Choice {
    /// The choice made by the environment variable `PALPATE_ADAPTER`, else [`Choice::Auto`].
    pub fn from_env() -> Choice {
        match std::env::var("PALPATE_ADAPTER") {
            Ok(name) if !name.is_empty() => Choice::Named(name),
            _ => Choice::Auto,
        }
    }
}

/// How the eight lanes of a cell talk to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    /// Subgroup shuffles.
    Subgroup,
    /// Workgroup memory.
    Memory,
}

/// Features without which no kernel runs: small arguments of a dispatch.
const NEEDED: wgpu::Features = wgpu::Features::IMMEDIATES;
/// Features that are used where they are.
const WELCOME: wgpu::Features = wgpu::Features::SUBGROUP.union(wgpu::Features::TIMESTAMP_QUERY);
/// Storage buffers that the widest kernel binds.
pub(crate) const STORAGE_BUFFERS: u32 = 20;
/// Invocations of the widest workgroup.
pub(crate) const WIDTH: u32 = 256;
/// Workgroup memory of the hungriest kernel [B], and some to spare.
pub(crate) const WORKGROUP_BYTES: u32 = 16_384;

pub(crate) fn instance() -> wgpu::Instance {
    // Indirect arguments come from our own kernels, so the validating dispatch before each of them is left out.
    let flags = wgpu::InstanceFlags::default().difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(wgpu::InstanceDescriptor { flags, ..wgpu::InstanceDescriptor::new_without_display_handle() })
}

pub(crate) fn all(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
}

pub(crate) fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Why an adapter cannot run the kernels.
pub(crate) fn refused(adapter: &wgpu::Adapter) -> Option<GpuError> {
    refusal(&adapter.get_info().name, adapter.features(), &adapter.limits())
}

/// The same of what an adapter says of itself.
pub(crate) fn refusal(name: &str, features: wgpu::Features, limits: &wgpu::Limits) -> Option<GpuError> {
    if !features.contains(NEEDED) {
        return Some(GpuError::Unsupported { adapter: name.into(), feature: "immediates (push constants)".into() });
    }
    let need = |limit, available: u32, needed: u32| {
        let (adapter, available, needed) = (name.to_string(), u64::from(available), u64::from(needed));
        (available < needed).then_some(GpuError::TooSmall { adapter, limit, available, needed })
    };
    need("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS)
        .or_else(|| need("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, WIDTH))
        .or_else(|| need("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, WORKGROUP_BYTES))
}

/// How lanes talk after what the probe of subgroups said. A driver that lists subgroups and cannot compile or run a kernel with them
/// still has workgroup memory.
///
/// # Errors
/// The device is gone or full, whatever the kernel.
pub(crate) fn lanes_for(probe: Result<bool, GpuError>) -> Result<Lanes, GpuError> {
    match probe {
        Ok(true) => Ok(Lanes::Subgroup),
        Err(e @ (GpuError::Lost { .. } | GpuError::OutOfMemory { .. })) => Err(e),
        Ok(false) | Err(_) => Ok(Lanes::Memory),
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
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) pipelines: Pipelines,
    /// Largest buffer that a kernel can bind [B].
    pub(crate) largest: u64,
    /// Bytes of all buffers made so far.
    made: AtomicU64,
    /// Times that the host has waited for results.
    pub(crate) waits: AtomicU64,
    trouble: Arc<Mutex<Option<GpuError>>>,
    lost: Arc<AtomicBool>,
}

impl Gpu {
    /// Opens the chosen adapter.
    ///
    /// # Errors
    /// There is none, or it lacks something.
    pub fn open(choice: &Choice) -> Result<Arc<Gpu>, GpuError> {
        Gpu::open_with(choice, None)
    }

    /// The same with a given way for lanes to talk (tests run both); `None` = subgroups where a probe shows that they work.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_with(choice: &Choice, lanes: Option<Lanes>) -> Result<Arc<Gpu>, GpuError> {
        let mut found = all(&instance());
        found.sort_by_key(|a| rank(a.get_info().device_type));
        let names: Vec<String> = found.iter().map(|a| a.get_info().name).collect();
        let wanted = match choice {
            Choice::Auto => None,
            Choice::Named(name) => Some(name.clone()),
        };
        let fits =
            |a: &wgpu::Adapter| wanted.as_ref().is_none_or(|w| a.get_info().name.to_lowercase().contains(&w.to_lowercase()));
        found.retain(fits);
        let usable = found.iter().position(|a| refused(a).is_none());
        let Some(first) = found.first() else { return Err(GpuError::NoAdapter { wanted, found: names }) };
        let Some(place) = usable else {
            return Err(refused(first).unwrap_or(GpuError::NoAdapter { wanted, found: names }));
        };
        let adapter = &found[place];
        let info = adapter.get_info();
        let features = NEEDED | (adapter.features() & WELCOME);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("palpate"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| GpuError::refused(format!("while it is opened: {e}")))?;
        let trouble = Arc::new(Mutex::new(None));
        let lost = Arc::new(AtomicBool::new(false));
        let (slot, gone) = (trouble.clone(), lost.clone());
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| {
            let e = translate(e);
            gone.fetch_or(matches!(e, GpuError::Lost { .. }), Ordering::SeqCst);
            keep(&slot, e);
        }));
        let (slot, gone) = (trouble.clone(), lost.clone());
        device.set_device_lost_callback(move |reason, text| {
            gone.store(true, Ordering::SeqCst);
            // Dropping the device ends it as well; that is no error.
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&slot, GpuError::Lost { reason: text });
            }
        });
        let subgroups = features.contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= 8;
        let open = |lanes| Gpu {
            name: info.name.clone(),
            driver: format!("{} {}", info.driver, info.driver_info),
            kind: info.device_type,
            device: device.clone(),
            queue: queue.clone(),
            pipelines: Pipelines::new(lanes),
            largest: device.limits().max_storage_buffer_binding_size,
            made: AtomicU64::new(0),
            waits: AtomicU64::new(0),
            trouble: trouble.clone(),
            lost: lost.clone(),
        };
        let gpu = match lanes {
            Some(Lanes::Subgroup) if !subgroups => {
                return Err(GpuError::Unsupported { adapter: info.name, feature: "subgroups of eight lanes".into() });
            }
            Some(lanes) => open(lanes),
            // Whether lanes lie in subgroups in their order is up to the driver: ask a kernel.
            None if subgroups => {
                let gpu = open(Lanes::Subgroup);
                match lanes_for(crate::probe::lanes_work(&gpu))? {
                    Lanes::Subgroup => gpu,
                    Lanes::Memory => open(Lanes::Memory),
                }
            }
            None => open(Lanes::Memory),
        };
        Ok(Arc::new(gpu))
    }

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

    /// True for software adapters, which cap the loop iterations of an invocation.
    pub fn is_software(&self) -> bool {
        self.kind == wgpu::DeviceType::Cpu
    }

    /// Nanoseconds per tick of the device's clock, if it has one.
    pub fn tick(&self) -> Option<f32> {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| self.queue.get_timestamp_period())
    }

    /// A zeroed storage buffer.
    ///
    /// # Errors
    /// It is larger than a limit of the device.
    fn make(&self, label: &str, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        fits(label, bytes, self.largest, self.device.limits().max_buffer_size)?;
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST
            | if ["arguments", "gate"].contains(&label) { wgpu::BufferUsages::INDIRECT } else { wgpu::BufferUsages::empty() }
            | if label == "shape" { wgpu::BufferUsages::UNIFORM } else { wgpu::BufferUsages::empty() };
        let size = whole(bytes);
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer =
            self.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
        if let Some(e) = pollster::block_on(guard.pop()) {
            return Err(no_room(label, size, e));
        }
        self.made.fetch_add(size, Ordering::Relaxed);
        Ok(buffer)
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

    /// Bytes of all buffers made so far, those included that are gone since.
    pub fn made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    /// The smallest buffer: something to bind where a large one could not be had.
    pub(crate) fn small(&self) -> wgpu::Buffer {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        self.device.create_buffer(&wgpu::BufferDescriptor { label: Some("nothing"), size: 256, usage, mapped_at_creation: false })
    }

    /// Waits for everything submitted, and returns what a buffer holds.
    ///
    /// # Errors
    /// Anything that went wrong since the last read.
    pub(crate) fn download<T: bytemuck::Pod>(&self, source: &wgpu::Buffer, items: usize) -> Result<Vec<T>, GpuError> {
        let mut all = self.download_all(&[(source, items * size_of::<T>())])?;
        Ok(bytemuck::pod_collect_to_vec(&all.remove(0)))
    }

    /// Waits once for everything submitted, and returns the first bytes of each buffer.
    ///
    /// # Errors
    /// As [`Gpu::download`].
    pub(crate) fn download_all(&self, parts: &[(&wgpu::Buffer, usize)]) -> Result<Vec<Vec<u8>>, GpuError> {
        if let Some(e) = self.take_trouble() {
            return Err(e);
        }
        let places: Vec<usize> =
            parts.iter().scan(0, |end, part| Some(std::mem::replace(end, *end + part.1.next_multiple_of(4)))).collect();
        let size = places.last().zip(parts.last()).map_or(4, |(at, part)| (at + part.1).next_multiple_of(4).max(4)) as u64;
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging =
            self.device.create_buffer(&wgpu::BufferDescriptor { label: Some("read"), size, usage, mapped_at_creation: false });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        for ((source, bytes), at) in parts.iter().zip(&places) {
            let bytes = (bytes.next_multiple_of(4) as u64).min(source.size());
            encoder.copy_buffer_to_buffer(source, 0, &staging, *at as u64, bytes);
        }
        self.queue.submit([encoder.finish()]);
        let view = self.map(&staging)?;
        Ok(parts.iter().zip(&places).map(|(part, at)| view[*at..at + part.1].to_vec()).collect())
    }

    /// Waits for everything submitted, and then for the buffer.
    fn map(&self, staging: &wgpu::Buffer) -> Result<wgpu::BufferView, GpuError> {
        let done = Arc::new(Mutex::new(None));
        let slot = done.clone();
        staging.map_async(wgpu::MapMode::Read, .., move |r| *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(r));
        self.waits.fetch_add(1, Ordering::Relaxed);
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        if let Some(e) = self.take_trouble() {
            return Err(e);
        }
        waited.map_err(|e| GpuError::Lost { reason: e.to_string() })?;
        match done.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(Ok(())) => {}
            Some(Err(e)) => return Err(GpuError::Lost { reason: e.to_string() }),
            None => return Err(GpuError::Lost { reason: "the device did not answer".into() }),
        }
        staging.get_mapped_range(..).map_err(|e| GpuError::Lost { reason: e.to_string() })
    }
}

impl Maker for Gpu {
    type Buffer = wgpu::Buffer;

    fn buffer(&self, label: &str, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        self.make(label, bytes)
    }

    fn upload<T: bytemuck::NoUninit>(&self, label: &str, data: &[T]) -> Result<wgpu::Buffer, GpuError> {
        let buffer = self.make(label, size_of_val(data) as u64)?;
        self.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(data));
        Ok(buffer)
    }

    fn largest(&self) -> u64 {
        self.largest
    }
}

/// Size of the buffer that holds so many bytes: empty lists still need something to bind, one element of the largest struct.
pub(crate) fn whole(bytes: u64) -> u64 {
    bytes.max(256).next_multiple_of(16)
}

fn keep(slot: &Mutex<Option<GpuError>>, error: GpuError) {
    slot.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
}

/// Refuses a buffer beyond what a kernel can bind, or beyond the largest there is [B].
pub(crate) fn fits(label: &str, bytes: u64, binding: u64, buffer: u64) -> Result<(), GpuError> {
    for (limit, available) in [("max_storage_buffer_binding_size", binding), ("max_buffer_size", buffer)] {
        if bytes > available {
            return Err(GpuError::Limit { limit, available, needed: bytes, what: format!("the buffer `{label}`") });
        }
    }
    Ok(())
}

/// What a device says that has no room for a buffer.
pub(crate) fn no_room(label: &str, bytes: u64, e: wgpu::Error) -> GpuError {
    match translate(e) {
        GpuError::OutOfMemory { what } => {
            GpuError::OutOfMemory { what: format!("the buffer `{label}` of {bytes} bytes: {what}") }
        }
        e => e,
    }
}

/// wgpu's error as ours.
pub(crate) fn translate(e: wgpu::Error) -> GpuError {
    // Its words are spread over indented lines.
    let flat = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
    match e {
        wgpu::Error::OutOfMemory { source } => GpuError::OutOfMemory { what: flat(source.to_string()) },
        // Whatever is asked of a device that is gone is refused so.
        wgpu::Error::Validation { description, .. } if description.contains("device is lost") => {
            GpuError::Lost { reason: flat(description) }
        }
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            GpuError::refused(flat(description))
        }
    }
}
