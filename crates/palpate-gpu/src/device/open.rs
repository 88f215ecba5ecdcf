//! Opens an adapter: the device with the features that kernels need, and the way its lanes talk.

use super::adapters::{Choice, NEEDED, WELCOME, all, instance, pci, refused};
use super::error::{GpuError, translate};
use super::gpu::{Gpu, Scopes, Troubles, keep};
use super::host::{Bare, Host};
use super::pipelines::{Lanes, Pipelines};
use super::probe::lanes_work;
use super::wait;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

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
        Gpu::open_for(choice, lanes, Arc::new(Bare))
    }

    /// The same for a host that lends a clock, or remembers what was measured.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub fn open_for(choice: &Choice, lanes: Option<Lanes>, host: Arc<dyn Host>) -> Result<Arc<Gpu>, GpuError> {
        let opened = wait::for_system(Opened::new(choice, host))?;
        let first = opened.first(lanes)?;
        let talk = first.waited(opened.talk(lanes, &first))?;
        Ok(Arc::new(opened.last(first, talk)))
    }

    /// The same, for whoever may not wait.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub async fn open_async(choice: &Choice, lanes: Option<Lanes>, host: Arc<dyn Host>) -> Result<Arc<Gpu>, GpuError> {
        let opened = Opened::new(choice, host).await?;
        let first = opened.first(lanes)?;
        let talk = opened.talk(lanes, &first).await?;
        Ok(Arc::new(opened.last(first, talk)))
    }
}

/// A device before it is known how its lanes talk.
struct Opened {
    host: Arc<dyn Host>,
    info: wgpu::AdapterInfo,
    device: wgpu::Device,
    queue: wgpu::Queue,
    trouble: Arc<Troubles>,
    lost: Arc<AtomicBool>,
}

impl Opened {
    async fn new(choice: &Choice, host: Arc<dyn Host>) -> Result<Opened, GpuError> {
        let found = all(&instance()).await;
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
        let opened = adapter.request_device(&descriptor).await;
        let (device, queue) = opened.map_err(|e| GpuError::refused(format!("while it is opened: {e}")))?;
        let trouble = Arc::new(Troubles::default());
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
        Ok(Opened { host, info, device, queue, trouble, lost })
    }

    /// True where the adapter lists subgroups that are wide enough.
    fn lists_subgroups(&self) -> bool {
        self.device.features().contains(wgpu::Features::SUBGROUP) && self.info.subgroup_min_size >= 8
    }

    fn gpu(&self, lanes: Lanes) -> Gpu {
        Gpu {
            name: self.info.name.clone(),
            driver: format!("{} {}", self.info.driver, self.info.driver_info),
            kind: self.info.device_type,
            host: self.host.clone(),
            device: self.device.clone(),
            queue: self.queue.clone(),
            pipelines: Pipelines::new(lanes),
            largest: self.device.limits().max_storage_buffer_binding_size,
            made: AtomicU64::new(0),
            waits: AtomicU64::new(0),
            trouble: self.trouble.clone(),
            scopes: Scopes::default(),
            lost: self.lost.clone(),
            together: OnceLock::new(),
            trace: Default::default(),
        }
    }

    /// The device as it is wanted, or with subgroups where they are listed.
    ///
    /// # Errors
    /// Subgroups are wanted where there are none.
    fn first(&self, wanted: Option<Lanes>) -> Result<Gpu, GpuError> {
        let listed = self.lists_subgroups();
        if wanted == Some(Lanes::Subgroup) && !listed {
            return Err(GpuError::Unsupported { adapter: self.info.name.clone(), feature: "subgroups of eight lanes".into() });
        }
        Ok(self.gpu(wanted.unwrap_or(if listed { Lanes::Subgroup } else { Lanes::Memory })))
    }

    /// How its lanes talk. Whether they lie in subgroups in their order is up to the driver: a kernel is asked.
    async fn talk(&self, wanted: Option<Lanes>, first: &Gpu) -> Result<Lanes, GpuError> {
        let asked = wanted.is_none() && first.lanes() == Lanes::Subgroup;
        if asked { lanes_for(lanes_work(first).await) } else { Ok(first.lanes()) }
    }

    fn last(&self, first: Gpu, talk: Lanes) -> Gpu {
        if first.lanes() == talk { first } else { self.gpu(talk) }
    }
}
