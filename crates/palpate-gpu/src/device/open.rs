//! Opens an adapter: the device with the features that kernels need, and the way its lanes talk.

use super::adapters::{Choice, NEEDED, WELCOME, all, instance, pci, refused};
use super::error::{GpuError, translate};
use super::gpu::{Gpu, keep};
use super::pipelines::{Lanes, Pipelines};
use super::probe::lanes_work;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

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
        let found = all(&instance());
        let told = |(index, a): (usize, &wgpu::Adapter)| {
            let info = a.get_info();
            let place = pci(&info).map_or(String::new(), |p| format!(" at {p}"));
            format!("{index}: {}{place}", info.name)
        };
        let names: Vec<String> = found.iter().enumerate().map(told).collect();
        let meant = |(index, a): &(usize, &wgpu::Adapter)| {
            let info = a.get_info();
            choice.means(*index, &info.name, pci(&info))
        };
        let mut meant = found.iter().enumerate().filter(meant).map(|(_, a)| a);
        // Usable ones come first.
        let Some(adapter) = meant.next() else { return Err(GpuError::NoAdapter { wanted: choice.clone(), found: names }) };
        if let Some(refusal) = refused(adapter) {
            return Err(refusal);
        }
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
            trace: Mutex::default(),
        };
        let gpu = match lanes {
            Some(Lanes::Subgroup) if !subgroups => {
                return Err(GpuError::Unsupported { adapter: info.name, feature: "subgroups of eight lanes".into() });
            }
            Some(lanes) => open(lanes),
            // Whether lanes lie in subgroups in their order is up to the driver: ask a kernel.
            None if subgroups => {
                let gpu = open(Lanes::Subgroup);
                match lanes_for(lanes_work(&gpu))? {
                    Lanes::Subgroup => gpu,
                    Lanes::Memory => open(Lanes::Memory),
                }
            }
            None => open(Lanes::Memory),
        };
        Ok(Arc::new(gpu))
    }
}
