//! What is read of every member at the end.

use super::World;
use crate::device::Maker as _;
use crate::device::recorder::Buffers;
use crate::layout::Health;

/// Everything to be read of every member.
#[derive(Debug)]
pub struct Tally {
    pub(crate) directions: Vec<usize>,
    /// health `[B]`, gradient `[B, P]`, and what observations add.
    pub(crate) buffers: Buffers,
}

/// What a tally of B members and P parameters holds beside observations, in bytes.
pub(crate) fn tally_sizes(b: u64, p: u64) -> [(&'static str, u64); 2] {
    [("health", b * size_of::<Health>() as u64), ("gradient", 4 * b * p)]
}

impl Tally {
    pub(crate) fn new(world: &World, directions: &[usize]) -> Tally {
        let (b, p) = (world.members() as u64, world.plan.layout.len() as u64);
        let mut buffers = Buffers::new();
        for (name, bytes) in tally_sizes(b, p) {
            let buffer = world.gpu.buffer(name, bytes).unwrap_or_else(|e| {
                world.gpu.keep(e);
                world.gpu.small()
            });
            buffers.insert(name, buffer);
        }
        world.observer.extend_tally(&world.gpu, directions, &mut buffers);
        Tally { directions: directions.to_vec(), buffers }
    }

    pub(crate) fn get(&self, name: &'static str) -> &wgpu::Buffer {
        &self.buffers[name]
    }
}
