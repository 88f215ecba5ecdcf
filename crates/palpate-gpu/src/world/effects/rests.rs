//! The stress-free shape that effects give a body, or that the host found for the shape given: displacement per node, deformation per cell, as kernels read them
//! (`shared/unstrained.wgsl`).

use super::Effects;
use crate::device::pipelines::shared::structs::FIELD_REST;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::params::changes::Changes;
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::body::Body;

fn put(out: &mut Vec<f32>, v: &[f64]) {
    out.extend(v.chunks_exact(3).flat_map(|v| [v[0] as f32, v[1] as f32, v[2] as f32, 0.0]));
}

fn put_nodes(out: &mut Vec<f32>, v: &[DVec3]) {
    v.iter().for_each(|v| put(out, &v.to_array()));
}

impl Effects {
    /// Numbers of every buffer of [`Effects::rests`].
    pub(super) fn rest_sizes(&self, members: usize, body: &Body) -> [(&'static str, usize); 2] {
        let of = |n: usize| if self.bits & FIELD_REST == 0 { 0 } else { 4 * members * n };
        [("rests", of(body.nodes.len())), ("rest_shapes", of(8 * body.cells().len() + 3 * body.points.len()))]
    }

    /// W `[B][N]`, and the deformation of every cell in the shape X + W `[B][cells][8]` or of every elastic point `[B][points][3]`; vectors of four.
    pub(super) fn rests(&self, plan: &Plan, batch: &[Physics], found: &[Vec<DVec3>]) -> [Vec<f32>; 2] {
        let (body, mut out) = (&plan.body, [const { Vec::new() }; 2]);
        for (b, physics) in batch.iter().enumerate() {
            let own = Changes::new(plan, physics).rest.or_else(|| found.get(b).cloned());
            let w = own.unwrap_or_else(|| vec![DVec3::ZERO; body.nodes.len()]);
            put_nodes(&mut out[0], &w);
            let at = |n: u32| body.nodes[n as usize] + w[n as usize];
            body.cells().iter().for_each(|c| put(&mut out[1], &CellPose::new(&c.nodes.map(at), body.cut().grid.h).q));
            for (back, swelling) in body.points.unstrained(&w) {
                let shift = DMat3::IDENTITY - back;
                let columns = [shift.x_axis.extend(swelling), shift.y_axis.extend(0.0), shift.z_axis.extend(0.0)];
                out[1].extend(columns.iter().flat_map(|c| c.to_array().map(|x| x as f32)));
            }
        }
        out
    }
}
