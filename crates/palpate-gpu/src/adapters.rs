//! What adapters there are, and what each can do.

use crate::device::{Choice, all, fits, instance, rank, refused};
use crate::error::GpuError;

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
                refusal: refused(a),
            }
        })
        .collect();
    found.sort_by_key(|a| (a.refusal.is_some(), rank(a.kind)));
    found
}
