//! What benchmarks ask a device: how long passes take, how fast it copies, what a product of conjugate gradients moves.

use crate::device::Gpu;
use crate::error::GpuError;
use crate::memory::Maker as _;
use crate::recorder::PassTime;
use crate::tuning::{self, Product};
use crate::world::World;
use std::time::Instant;

/// One product A p of all members: what conjugate gradients spend their time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProductSpeed {
    /// With or without a matrix.
    pub product: Product,
    /// True when many workgroups share the solve of a member.
    pub many: bool,
    /// Time [s].
    pub seconds: f64,
    /// Numbers read and written, each once [B].
    pub bytes: f64,
}

impl Gpu {
    /// Waits until everything handed to the device is done.
    ///
    /// # Errors
    /// The device is gone.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.device.poll(wgpu::PollType::wait_indefinitely()).map(|_| ()).map_err(|e| GpuError::Lost { reason: e.to_string() })
    }

    /// Measured bandwidth of a copy between buffers of the device, reading and writing counted [B/s].
    ///
    /// # Errors
    /// No memory for it, or the device is gone.
    pub fn copy_bandwidth(&self) -> Result<f64, GpuError> {
        let bytes = self.largest.min(64 << 20);
        let (from, to) = (self.buffer("copy from", bytes)?, self.buffer("copy to", bytes)?);
        let copy = |times: u32| {
            let clock = Instant::now();
            let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("copy") });
            (0..times).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
            self.queue.submit([encoder.finish()]);
            self.wait().map(|()| clock.elapsed().as_secs_f64())
        };
        copy(1)?;
        let one = copy(1)?;
        // Many copies less one leave out what submitting takes.
        let seconds = (copy(9)? - one).max(1e-9);
        Ok(2.0 * 8.0 * bytes as f64 / seconds)
    }
}

impl World {
    /// Times every pass from here on, one by one, which makes steps slower.
    pub fn time_passes(&mut self, on: bool) {
        self.timed = on;
        self.times.borrow_mut().clear();
    }

    /// Time per pass since [`World::time_passes`], the longest first; empty where the device has no clock.
    pub fn pass_times(&self) -> Vec<(&'static str, PassTime)> {
        let mut all: Vec<_> = self.times.borrow().iter().map(|(name, t)| (*name, t.clone())).collect();
        all.sort_by(|a, b| b.1.nanoseconds.total_cmp(&a.1.nanoseconds).then(a.0.cmp(b.0)));
        all
    }

    /// Time and traffic of a product with the current batch.
    ///
    /// # Errors
    /// The device is gone.
    pub fn product_speed(&self) -> Result<ProductSpeed, GpuError> {
        let s = &self.geometry.shape;
        let [nodes, cells, blocks] = [s.nodes, s.cells, s.blocks].map(f64::from);
        // Values, columns and vectors; or tangents, corner forces (written and read) and lists.
        let one = match self.product {
            Product::Matrix => 36.0 * blocks + 4.0 * blocks + 2.0 * 16.0 * nodes,
            Product::Free => {
                (480.0 + 64.0 + 2.0 * 128.0 + 4.0 * 8.0) * cells + 2304.0 * f64::from(s.classes) + 8.0 * blocks + 48.0 * nodes
            }
        };
        let seconds = tuning::time(self, self.product)? / tuning::REPEATS as f64;
        Ok(ProductSpeed { product: self.product, many: self.many, seconds, bytes: one * self.members() as f64 })
    }
}
