//! What adapters there are, and what each can do.

use super::buffers::fits;
use super::error::GpuError;
use super::wait;

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

/// Features without which no kernel runs: small arguments of a dispatch.
pub(super) const NEEDED: wgpu::Features = wgpu::Features::IMMEDIATES;
/// Features that are used where they are.
pub(super) const WELCOME: wgpu::Features = wgpu::Features::SUBGROUP.union(wgpu::Features::TIMESTAMP_QUERY);
/// Storage buffers that the widest kernel binds: as many as browsers give.
pub(crate) const STORAGE_BUFFERS: u32 = 10;
/// Invocations of the widest workgroup.
pub(crate) const WIDTH: u32 = 256;
/// Workgroup memory of the hungriest kernel [B], and some to spare.
pub(crate) const WORKGROUP_BYTES: u32 = 16_384;

/// Where adapters are asked for.
pub(crate) fn instance() -> wgpu::Instance {
    // Indirect arguments come from our own kernels, so the validating dispatch before each of them is left out.
    let flags = wgpu::InstanceFlags::default().difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    wgpu::Instance::new(wgpu::InstanceDescriptor { flags, ..wgpu::InstanceDescriptor::new_without_display_handle() })
}

/// Every adapter.
pub(crate) async fn all(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    instance.enumerate_adapters(wgpu::Backends::all()).await
}

/// Which kind is taken first.
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
    /// The largest buffer that a kernel can bind [B].
    pub fn largest_buffer(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }

    /// Whether this adapter has room for the largest buffer of an evaluation ([`crate::Memory::largest`]).
    ///
    /// # Errors
    /// It is beyond one of its limits.
    pub fn holds(&self, largest: u64) -> Result<(), GpuError> {
        let l = &self.limits;
        match fits("", largest, l.max_storage_buffer_binding_size, l.max_buffer_size) {
            // Which one it is is not known before it is made.
            Err(GpuError::Limit { limit, available, needed, .. }) => {
                Err(GpuError::Limit { limit, available, needed, what: "the largest buffer".into() })
            }
            done => done,
        }
    }

    /// True when this is an adapter that the choice means.
    pub fn is_meant(&self, choice: &Choice) -> bool {
        match choice {
            Choice::Auto => true,
            Choice::Named(name) => self.name.to_lowercase().contains(&name.to_lowercase()),
        }
    }

    /// True for adapters that compute on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == wgpu::DeviceType::Cpu
    }
}

/// Every adapter of this machine, the one that [`Choice::Auto`] takes first.
pub fn adapters() -> Vec<AdapterReport> {
    wait::for_system(adapters_async())
}

/// The same, for whoever may not wait.
pub async fn adapters_async() -> Vec<AdapterReport> {
    let mut found: Vec<AdapterReport> = all(&instance())
        .await
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
                refusal: refused(a),
            }
        })
        .collect();
    found.sort_by_key(|a| (a.refusal.is_some(), rank(a.kind)));
    found
}
