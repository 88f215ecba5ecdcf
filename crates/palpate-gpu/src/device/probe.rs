//! Asks a kernel whether eight neighbouring invocations sit side by side in a subgroup, which no API promises.

use super::buffers::Maker as _;
use super::error::GpuError;
use super::gpu::Gpu;
use super::pipelines::{PASSES, pass};
use super::recorder::{Args, Recorder, Size};
use std::collections::HashMap;

/// True when sums over groups of eight lanes come out right.
pub(crate) async fn lanes_work(gpu: &Gpu) -> Result<bool, GpuError> {
    let width = PASSES[pass::PROBE_LANES].width as usize;
    let groups = 3;
    let sums = gpu.buffer("sums", (16 * width * groups) as u64)?;
    let (world, mut made, mut times) = (HashMap::new(), HashMap::new(), HashMap::new());
    let mut r = Recorder::new(gpu, &world, &mut made, false);
    r.run(pass::PROBE_LANES, &[("sums", &sums)], Size::All { members: 1, groups }, Args::default());
    r.submit(&mut times);
    let found: Vec<[f32; 4]> = gpu.items_of(&sums, width * groups).await?;
    // Lane i of the dispatch offers (i, i², 1) to its group and asks for the next lane's i.
    Ok(found.iter().enumerate().all(|(i, v)| {
        let first = i - i % 8;
        let sum = |f: fn(f32) -> f32| (first..first + 8).map(|k| f(k as f32)).sum::<f32>();
        *v == [sum(|k| k), sum(|k| k * k), 8.0, (first + (i + 1) % 8) as f32]
    }))
}

/// Most workgroups that are asked for.
const MOST_TOGETHER: u32 = 1024;

/// How many workgroups run at the same time, a power of two: twice as many are asked until some wait in vain.
///
/// # Errors
/// The device is gone or full.
pub(crate) async fn together(gpu: &Gpu) -> Result<u32, GpuError> {
    let mut known = 1;
    if !gpu.device.features().contains(wgpu::Features::MEMORY_DECORATION_COHERENT) {
        return Ok(known);
    }
    let meetings = gpu.buffer("meetings", 12)?;
    while known < MOST_TOGETHER {
        let groups = 2 * known as usize;
        let sums = gpu.buffer("sums", 8 * groups as u64)?;
        let (world, mut made, mut times) = (HashMap::new(), HashMap::new(), HashMap::new());
        let mut r = Recorder::new(gpu, &world, &mut made, false);
        let named = [("sums", &sums), ("meetings", &meetings)];
        r.run(pass::PROBE_MEETING, &named, Size::All { members: 1, groups }, Args::default());
        r.submit(&mut times);
        let found: Vec<u32> = gpu.items_of(&sums, 2 * groups).await?;
        if found[groups..].iter().any(|failed| *failed != 0) {
            break;
        }
        known *= 2;
    }
    Ok(known)
}
