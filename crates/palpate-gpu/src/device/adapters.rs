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
    /// The one with this number in the list of [`adapters`], from 0.
    Index(usize),
    /// The one at this place of the PCI bus.
    Pci(PciAddress),
    /// The first whose name holds this text (case ignored).
    Named(String),
}

/// Place of a device on the PCI bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PciAddress {
    /// Domain, or segment.
    pub domain: u32,
    /// Bus.
    pub bus: u8,
    /// Device.
    pub device: u8,
    /// Function.
    pub function: u8,
}

impl PciAddress {
    /// Reads `0000:01:00.0`, as wgpu and lspci write it, `00000000:01:00.0`, as nvidia-smi does, or `01:00.0`; `None` for other texts.
    pub fn parse(text: &str) -> Option<PciAddress> {
        let (place, function) = text.split_once('.')?;
        let mut parts = place.rsplit(':');
        let hex = |digits: &str, most: usize| {
            let known = !digits.is_empty() && digits.len() <= most && digits.chars().all(|c| c.is_ascii_hexdigit());
            known.then(|| u32::from_str_radix(digits, 16).ok())?
        };
        let byte = |digits: &str| u8::try_from(hex(digits, 2)?).ok();
        let (device, bus) = (byte(parts.next()?)?, byte(parts.next()?)?);
        let domain = parts.next().map_or(Some(0), |d| hex(d, 8))?;
        let function = byte(function)?;
        parts.next().is_none().then_some(PciAddress { domain, bus, device, function })
    }
}

impl std::fmt::Display for PciAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:04x}:{:02x}:{:02x}.{}", self.domain, self.bus, self.device, self.function)
    }
}

impl Choice {
    /// The choice made by the environment variable `PALPATE_ADAPTER`, else [`Choice::Auto`].
    pub fn from_env() -> Choice {
        std::env::var("PALPATE_ADAPTER").map_or(Choice::Auto, |text| Choice::parse(&text))
    }

    /// A number of one or two digits is an index (longer ones, as 4090, are parts of names), what looks like a PCI address is one, all else
    /// is a part of a name.
    pub fn parse(text: &str) -> Choice {
        let text = text.trim();
        let digits = text.len() <= 2 && text.chars().all(|c| c.is_ascii_digit());
        match (text.parse(), PciAddress::parse(text)) {
            _ if text.is_empty() => Choice::Auto,
            (Ok(index), _) if digits => Choice::Index(index),
            (_, Some(place)) => Choice::Pci(place),
            _ => Choice::Named(text.into()),
        }
    }

    /// True when it means this adapter.
    pub(super) fn means(&self, index: usize, name: &str, pci: Option<PciAddress>) -> bool {
        match self {
            Choice::Auto => true,
            Choice::Index(wanted) => *wanted == index,
            Choice::Pci(wanted) => pci == Some(*wanted),
            Choice::Named(part) => name.to_lowercase().contains(&part.to_lowercase()),
        }
    }
}

/// What is wanted, as a part of a sentence about an adapter: `with "A100" in its name`; nothing for [`Choice::Auto`].
impl std::fmt::Display for Choice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Choice::Auto => Ok(()),
            Choice::Index(index) => write!(f, "with the index {index}"),
            Choice::Pci(place) => write!(f, "at the PCI address {place}"),
            Choice::Named(part) => write!(f, "with {part:?} in its name"),
        }
    }
}

/// Features without which no kernel runs: small arguments of a dispatch.
pub(super) const NEEDED: wgpu::Features = wgpu::Features::IMMEDIATES;
/// Features that are used where they are.
pub(super) const WELCOME: wgpu::Features =
    wgpu::Features::SUBGROUP.union(wgpu::Features::TIMESTAMP_QUERY).union(wgpu::Features::MEMORY_DECORATION_COHERENT);
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

/// Every adapter in the order of lists, which an index counts in: usable ones first, and by kind.
pub(crate) async fn all(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut found = instance.enumerate_adapters(wgpu::Backends::all()).await;
    found.sort_by_key(|a| (refused(a).is_some(), rank(a.get_info().device_type)));
    found
}

/// Where an adapter is on the PCI bus; software adapters are nowhere.
pub(super) fn pci(info: &wgpu::AdapterInfo) -> Option<PciAddress> {
    PciAddress::parse(&info.device_pci_bus_id)
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
    /// Its number in the list, from 0.
    pub index: usize,
    /// Where it is on the PCI bus; `None` where the driver does not say so, as software adapters.
    pub pci: Option<PciAddress>,
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
        choice.means(self.index, &self.name, self.pci)
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
    let report = |(index, a): (usize, &wgpu::Adapter)| {
        let info = a.get_info();
        AdapterReport {
            index,
            pci: pci(&info),
            name: format!("{} ({})", info.name, info.driver_info),
            kind: info.device_type,
            api: info.backend,
            limits: a.limits(),
            subgroups: a.features().contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= 8,
            timestamps: a.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            refusal: refused(a),
        }
    };
    all(&instance()).await.iter().enumerate().map(report).collect()
}
