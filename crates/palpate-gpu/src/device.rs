//! Adapters and the device: what there is, what it can do, and a place where its errors are kept until somebody reads.

use crate::error::GpuError;
use crate::memory::Maker;
use crate::pipelines::Pipelines;
use std::sync::atomic::{AtomicU64, Ordering};
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

/// One adapter, for lists.
#[derive(Clone, Debug)]
pub struct AdapterReport {
    /// Name and driver.
    pub name: String,
    /// Discrete, integrated, software.
    pub kind: wgpu::DeviceType,
    /// Vulkan, Metal, DX12.
    pub api: wgpu::Backend,
    /// Its limits.
    pub limits: wgpu::Limits,
    /// True with subgroups of at least eight lanes.
    pub subgroups: bool,
    /// True when passes can be timed.
    pub timestamps: bool,
    /// Why it cannot be used, if it cannot.
    pub refusal: Option<GpuError>,
}

impl AdapterReport {
    /// True for adapters that compute on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == wgpu::DeviceType::Cpu
    }
}

/// Features without which no kernel runs: small arguments of a dispatch.
const NEEDED: wgpu::Features = wgpu::Features::IMMEDIATES;
/// Features that are used where they are.
const WELCOME: wgpu::Features = wgpu::Features::SUBGROUP.union(wgpu::Features::TIMESTAMP_QUERY);
/// Storage buffers that the widest kernel binds.
pub(crate) const STORAGE_BUFFERS: u32 = 20;

fn instance() -> wgpu::Instance {
    // Indirect arguments come from our own kernels, so the validating dispatch before each of them is left out.
    let flags = wgpu::InstanceFlags::default().difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(wgpu::InstanceDescriptor { flags, ..wgpu::InstanceDescriptor::new_without_display_handle() })
}

fn all(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
}

fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Why an adapter cannot run the kernels.
fn refusal(adapter: &wgpu::Adapter) -> Option<GpuError> {
    let name = adapter.get_info().name;
    if !adapter.features().contains(NEEDED) {
        return Some(GpuError::Unsupported { adapter: name, feature: "immediates (push constants)".into() });
    }
    let limits = adapter.limits();
    let need = |limit, available: u32, needed: u32| {
        (available < needed).then(|| GpuError::Limit {
            limit,
            available: available.into(),
            needed: needed.into(),
            what: name.clone(),
        })
    };
    need("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS)
        .or_else(|| need("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, 256))
        .or_else(|| need("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, 16384))
}

/// Every adapter of this machine, the one that [`Choice::Auto`] takes first.
pub fn adapters() -> Vec<AdapterReport> {
    let mut found: Vec<AdapterReport> = all(&instance())
        .iter()
        .map(|a| {
            let info = a.get_info();
            AdapterReport {
                name: format!("{} ({})", info.name, info.driver_info),
                kind: info.device_type,
                api: info.backend,
                limits: a.limits(),
                subgroups: a.features().contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= 8,
                timestamps: a.features().contains(wgpu::Features::TIMESTAMP_QUERY),
                refusal: refusal(a),
            }
        })
        .collect();
    found.sort_by_key(|a| (a.refusal.is_some(), rank(a.kind)));
    found
}

/// An open device with its kernels.
#[derive(Debug)]
pub struct Gpu {
    /// Name of the adapter.
    pub name: String,
    /// Kind of the adapter.
    pub kind: wgpu::DeviceType,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) pipelines: Pipelines,
    /// Largest buffer that a kernel can bind [B].
    pub(crate) largest: u64,
    /// Bytes of all buffers made so far.
    made: AtomicU64,
    trouble: Arc<Mutex<Option<GpuError>>>,
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
        let usable = found.iter().position(|a| refusal(a).is_none());
        let Some(first) = found.first() else { return Err(GpuError::NoAdapter { wanted, found: names }) };
        let Some(place) = usable else {
            return Err(refusal(first).unwrap_or(GpuError::NoAdapter { wanted, found: names }));
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
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| GpuError::Refused { message: e.to_string() })?;
        let trouble = Arc::new(Mutex::new(None));
        let slot = trouble.clone();
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| keep(&slot, translate(e))));
        let slot = trouble.clone();
        device.set_device_lost_callback(move |reason, text| {
            // Dropping the device ends it as well; that is no error.
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&slot, GpuError::Lost { reason: text });
            }
        });
        let subgroups = features.contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= 8;
        let open = |lanes| Gpu {
            name: info.name.clone(),
            kind: info.device_type,
            device: device.clone(),
            queue: queue.clone(),
            pipelines: Pipelines::new(lanes),
            largest: device.limits().max_storage_buffer_binding_size,
            made: AtomicU64::new(0),
            trouble: trouble.clone(),
        };
        let gpu = match lanes {
            Some(Lanes::Subgroup) if !subgroups => {
                return Err(GpuError::Unsupported { adapter: info.name, feature: "subgroups of eight lanes".into() });
            }
            Some(lanes) => open(lanes),
            // Whether lanes lie in subgroups in their order is up to the driver: ask a kernel.
            None if subgroups => {
                let gpu = open(Lanes::Subgroup);
                if crate::probe::lanes_work(&gpu)? { gpu } else { open(Lanes::Memory) }
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
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// True when an error waits to be read.
    pub(crate) fn troubled(&self) -> bool {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).is_some()
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
        let most = self.device.limits().max_buffer_size;
        for (limit, available) in [("max_storage_buffer_binding_size", self.largest), ("max_buffer_size", most)] {
            if bytes > available {
                return Err(GpuError::Limit { limit, available, needed: bytes, what: format!("the buffer `{label}`") });
            }
        }
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_SRC
            | wgpu::BufferUsages::COPY_DST
            | if ["arguments", "gate"].contains(&label) { wgpu::BufferUsages::INDIRECT } else { wgpu::BufferUsages::empty() }
            | if label == "shape" { wgpu::BufferUsages::UNIFORM } else { wgpu::BufferUsages::empty() };
        let size = whole(bytes);
        self.made.fetch_add(size, Ordering::Relaxed);
        Ok(self.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false }))
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
        if let Some(e) = self.take_trouble() {
            return Err(e);
        }
        let bytes = (items * size_of::<T>()) as u64;
        let size = bytes.max(4).next_multiple_of(4);
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging =
            self.device.create_buffer(&wgpu::BufferDescriptor { label: Some("read"), size, usage, mapped_at_creation: false });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        encoder.copy_buffer_to_buffer(source, 0, &staging, 0, size.min(source.size()));
        self.queue.submit([encoder.finish()]);
        let done = Arc::new(Mutex::new(None));
        let slot = done.clone();
        staging.map_async(wgpu::MapMode::Read, .., move |r| *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(r));
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
        let view = staging.get_mapped_range(..).map_err(|e| GpuError::Lost { reason: e.to_string() })?;
        Ok(bytemuck::pod_collect_to_vec(&view[..bytes as usize]))
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

/// wgpu's error as ours.
pub(crate) fn translate(e: wgpu::Error) -> GpuError {
    match e {
        wgpu::Error::OutOfMemory { source } => GpuError::OutOfMemory { what: source.to_string() },
        // Whatever is asked of a device that is gone is refused so.
        wgpu::Error::Validation { description, .. } if description.contains("device is lost") => {
            GpuError::Lost { reason: description }
        }
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
            GpuError::Refused { message: description }
        }
    }
}
