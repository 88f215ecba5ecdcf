//! Buffers of a device: made, counted, filled and read.

use super::error::{GpuError, translate};
use super::gpu::Gpu;
use super::wait::answer;
use std::sync::atomic::Ordering;

/// Makes buffers, or counts them.
pub(crate) trait Maker {
    /// What is made.
    type Buffer;

    /// A zeroed storage buffer.
    ///
    /// # Errors
    /// It is larger than a limit of the device.
    fn buffer(&self, label: &str, bytes: u64) -> Result<Self::Buffer, GpuError>;

    /// A storage buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Maker::buffer`].
    fn upload<T: bytemuck::NoUninit>(&self, label: &str, data: &[T]) -> Result<Self::Buffer, GpuError>;

    /// Largest buffer that a kernel can bind [B].
    fn largest(&self) -> u64;
}

impl Gpu {
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
            | if ["shape", "sight", "crowd"].contains(&label) {
                wgpu::BufferUsages::UNIFORM
            } else {
                wgpu::BufferUsages::empty()
            };
        let size = whole(bytes);
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer =
            self.device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
        let (caught, what) = (guard.pop(), label.to_string());
        if let Some(e) = self.caught(async move { caught.await.map(|e| no_room(&what, size, e)) }) {
            return Err(e);
        }
        self.made.fetch_add(size, Ordering::Relaxed);
        Ok(buffer)
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
        self.waited(self.contents_of(parts))
    }

    /// The first items of a buffer, once everything submitted is done, for whoever may not wait.
    ///
    /// # Errors
    /// As [`Gpu::download`].
    pub(crate) async fn items_of<T: bytemuck::Pod>(&self, source: &wgpu::Buffer, items: usize) -> Result<Vec<T>, GpuError> {
        let mut all = self.contents_of(&[(source, items * size_of::<T>())]).await?;
        Ok(bytemuck::pod_collect_to_vec(&all.remove(0)))
    }

    /// The first bytes of each buffer, likewise.
    ///
    /// # Errors
    /// As [`Gpu::download`].
    pub(crate) async fn contents_of(&self, parts: &[(&wgpu::Buffer, usize)]) -> Result<Vec<Vec<u8>>, GpuError> {
        if let Some(e) = self.trouble().await {
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
        let view = self.map(&staging).await?;
        Ok(parts.iter().zip(&places).map(|(part, at)| view[*at..at + part.1].to_vec()).collect())
    }

    /// A buffer's bytes, once everything submitted is done.
    async fn map(&self, staging: &wgpu::Buffer) -> Result<wgpu::BufferView, GpuError> {
        let (giver, mapped) = answer();
        staging.map_async(wgpu::MapMode::Read, .., move |r| giver.give(r));
        self.waits.fetch_add(1, Ordering::Relaxed);
        let mapped = mapped.await;
        if let Some(e) = self.trouble().await {
            return Err(e);
        }
        match mapped {
            Some(Ok(())) => staging.get_mapped_range(..).map_err(|e| GpuError::Lost { reason: e.to_string() }),
            Some(Err(e)) => Err(GpuError::Lost { reason: e.to_string() }),
            None => Err(GpuError::Lost { reason: "the device did not answer".into() }),
        }
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
