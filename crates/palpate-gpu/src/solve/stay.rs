//! Solves by workgroups that stay for all iterations: only where so many run at the same time that none waits for one that has not begun, which no
//! API promises. Asked for by `PALPATE_GPU_CG = stay`.

use crate::device::{Gpu, GpuError};
use crate::world::World;

/// Workgroups of a solve that use more registers than those of the probe may be fewer at the same time.
const SHARE: u32 = 4;

impl World {
    /// Gives every member its share of the workgroups that run at the same time. One that is alone waits for nobody.
    ///
    /// # Errors
    /// Workgroups do not run at the same time on this adapter, or a kernel cannot be asked.
    pub(crate) async fn engage(&mut self, asked: u32) -> Result<(), GpuError> {
        if asked == 0 || !self.many {
            return Ok(());
        }
        let shape = &mut self.geometry.shape;
        if self.geometry.stay == 0 {
            // Bodies so large that a device is full with one dispatch an iteration.
            return Ok(());
        }
        if asked == 1 {
            shape.crew = 1;
            return Ok(());
        }
        let together = self.gpu.together().await?;
        if together < 2 * SHARE {
            let feature = format!("workgroups that run at the same time ({together} do; PALPATE_GPU_CG = many needs none)");
            return Err(GpuError::Unsupported { adapter: self.gpu.name.clone(), feature });
        }
        let crew = asked.min(shape.slices).min(together / SHARE / self.capacity as u32);
        // Fewer than two have no advantage over dispatches.
        shape.crew = if crew < 2 { 0 } else { crew };
        Ok(())
    }

    /// Iterations in one dispatch where the workgroups of so many systems stay; `None` where they do not, or do not all run at the same time.
    pub(crate) fn stay(&self, systems: u32) -> Option<u32> {
        let crew = self.geometry.shape.crew;
        let together = self.gpu.together.get().map_or(1, |n| n / SHARE);
        (crew == 1 || crew != 0 && crew * systems <= together).then_some(self.geometry.stay)
    }
}

impl Gpu {
    /// How many workgroups are known to run at the same time; asked once.
    async fn together(&self) -> Result<u32, GpuError> {
        if let Some(known) = self.together.get() {
            return Ok(*known);
        }
        let found = crate::device::probe::together(self).await?;
        Ok(*self.together.get_or_init(|| found))
    }
}
