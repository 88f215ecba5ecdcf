//! Places that follow a body, moved on the device: vertices, points and splats that a motion carries. The host finds once what each follows
//! (`palpate_model::space::carrier`), and the device adds up for every frame.

#[cfg(test)]
mod tests;

use crate::device::pipelines::{PASSES, pass};
use crate::device::recorder::{Args, Buffers, Groups, Recorder, Size};
use crate::device::{Arena, Gpu, GpuError, Maker as _};
use crate::stencils::StencilTable;
use glam::{DMat3, DVec3};
use palpate_model::space::stencil::Stencils;
use std::collections::HashMap;
use std::sync::Arc;

/// Places of a dispatch: what they give fits into 16 MB.
const TOGETHER: usize = 1 << 18;

/// Moves places on a device.
#[derive(Debug)]
pub struct Skinning {
    gpu: Arc<Gpu>,
    buffers: Buffers,
    groups: Groups,
    places: usize,
    nodes: usize,
}

impl Skinning {
    /// Places that follow `nodes` nodes as stencils with gradients say, on an open device.
    ///
    /// # Errors
    /// More than the device has.
    pub fn on(gpu: Arc<Gpu>, stencils: &Stencils, nodes: usize) -> Result<Skinning, GpuError> {
        let (mut table, mut arena, mut buffers) = (StencilTable::default(), Arena::new("body_tables"), Buffers::new());
        table.extend(stencils.iter());
        table.put(&mut arena);
        arena.upload(&*gpu, &mut buffers)?;
        let places = stencils.len();
        let bytes = size_of::<[[f32; 4]; 4]>() * places.min(TOGETHER);
        buffers.insert("carried_places", gpu.buffer("carried_places", bytes as u64)?);
        buffers.insert("displacements", gpu.buffer("displacements", (size_of::<[f32; 4]>() * nodes) as u64)?);
        Ok(Skinning { gpu, buffers, groups: Groups::new(), places, nodes })
    }

    /// Displacement [m] of every place, and its gradient there, at node displacements `[N]` [m].
    ///
    /// # Errors
    /// The device fails.
    pub fn moved(&mut self, displacement: &[DVec3]) -> Result<Vec<(DVec3, DMat3)>, GpuError> {
        assert_eq!(displacement.len(), self.nodes, "a displacement for every node");
        // What all nodes have in common is added in double precision: a long way costs no digits.
        let common = displacement.iter().sum::<DVec3>() / displacement.len().max(1) as f64;
        let own: Vec<[f32; 4]> = displacement.iter().map(|u| (*u - common).as_vec3().extend(0.0).to_array()).collect();
        self.gpu.queue.write_buffer(&self.buffers["displacements"], 0, bytemuck::cast_slice(&own));
        let mut all = Vec::with_capacity(self.places);
        for first in (0..self.places).step_by(TOGETHER) {
            let count = (self.places - first).min(TOGETHER);
            let mut times = HashMap::new();
            let mut r = Recorder::new(&self.gpu, &self.buffers, &mut self.groups, false);
            let groups = count.div_ceil(PASSES[pass::CARRY_PLACES].width as usize);
            let args = Args { step: count as u32, roster: first as u32, ..Args::default() };
            r.run(pass::CARRY_PLACES, &[], Size::All { members: 1, groups }, args);
            r.submit(&mut times);
            let found: Vec<[[f32; 4]; 4]> = self.gpu.download(&self.buffers["carried_places"], count)?;
            let vector = |v: &[f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
            all.extend(found.iter().map(|[u, a, b, c]| (common + vector(u), DMat3::from_cols(vector(a), vector(b), vector(c)))));
        }
        Ok(all)
    }
}
