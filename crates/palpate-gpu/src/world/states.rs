//! States on loan from a pool, adjoints and tangents.

use super::rates::Rates;
use crate::device::Gpu;
use std::sync::{Arc, Mutex, PoisonError};

/// A buffer that goes back to the pool when it is no longer needed.
#[derive(Debug)]
pub struct Loan {
    /// The buffer.
    pub(crate) buffer: wgpu::Buffer,
    pub(super) pool: Arc<Mutex<Vec<wgpu::Buffer>>>,
}

impl Loan {
    /// Sets the buffer to zero, after everything handed to the device before.
    pub(crate) fn clear(&self, gpu: &Gpu) {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("clear") });
        encoder.clear_buffer(&self.buffer, 0, None);
        gpu.queue.submit([encoder.finish()]);
    }
}

impl Drop for Loan {
    fn drop(&mut self) {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner).push(self.buffer.clone());
    }
}

/// u (two parts) and v of every member, `[3][B][N]` vectors.
#[derive(Debug)]
pub struct State(pub(crate) Loan);

/// dJ/du and dJ/dv of every member, `[2][B][N]` vectors.
#[derive(Debug)]
pub struct Adjoint(pub(crate) Loan);

/// Derivatives of u and v along some directions, one buffer of `[2][B][N]` vectors per direction.
#[derive(Debug)]
pub struct Tangent {
    pub(crate) rates: Arc<Vec<Rates>>,
    pub(crate) parts: Vec<Loan>,
}
