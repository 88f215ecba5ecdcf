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
