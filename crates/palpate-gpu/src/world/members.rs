//! What members differ in: θ decoded, planes, clamp poses over time, element matrices per Poisson's ratio.

use super::geometry::Geometry;
use crate::device::{Gpu, GpuError, Maker as _};
use crate::layout::{ClampPose, Member, Plane};
use glam::DVec3;
use palpate_engine::ParamBatch;
use palpate_model::cutcells::corotation::M24;
use palpate_model::cutcells::elements::Elements;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::mechanics::plane::planes;
use palpate_model::plan::{Physics, Plan};
use std::collections::HashMap;

fn vec4(v: DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

/// θ of a batch on the device.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) physics: Vec<Physics>,
    pub(crate) theta: Vec<Vec<f64>>,
    /// Poisson's ratio of each slot of element matrices that is on the device.
    slots: Vec<f64>,
    /// The matrices themselves where effects make other clamps of them.
    elements: Vec<Elements>,
}

impl Batch {
    /// Uploads θ and what follows from it.
    ///
    /// # Errors
    /// More than the device has.
    pub(crate) fn set(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        geometry: &Geometry,
        theta: &ParamBatch,
        buffers: &mut HashMap<&'static str, wgpu::Buffer>,
    ) -> Result<(), GpuError> {
        self.theta = (0..theta.members()).map(|b| theta.row(b).to_vec()).collect();
        self.physics = self.theta.iter().map(|row| Physics::new(&plan.layout, row)).collect();
        let mut slots: Vec<f64> = Vec::new();
        let mut members = Vec::new();
        let mut all_planes: Vec<Plane> = Vec::new();
        let mut poses: Vec<ClampPose> = Vec::new();
        let mut masses: Vec<f32> = Vec::new();
        let unit = plan.solver.ghost * plan.body.length;
        // What viscosity needs comes first, where it need not be looked for.
        if plan.layout.is_viscous() {
            slots.push(0.0);
        }
        for p in &self.physics {
            let slot = slots.iter().position(|nu| *nu == p.poisson_ratio).unwrap_or_else(|| {
                slots.push(p.poisson_ratio);
                slots.len() - 1
            });
            let ((lambda, mu), (lambda_by_nu, mu_by_nu)) = (lame(1.0, p.poisson_ratio), lame_by_nu(1.0, p.poisson_ratio));
            let shear = |s: f64| (unit * s) as f32;
            // A ratio without matrices is refused by the kernel that refuses other parameters: no modulus goes with it.
            let sound = p.poisson_ratio > -1.0 && p.poisson_ratio < 0.5;
            members.push(Member {
                young: if sound { p.youngs_modulus as f32 } else { f32::NAN },
                density: p.density as f32,
                mass_damping: p.mass_damping as f32,
                stiffness_damping: p.stiffness_damping as f32,
                ghost: [shear(mu), shear(mu_by_nu)],
                slot: slot as u32,
                start: p.start as f32,
                gravity: vec4(p.gravity, 0.0),
                velocity: vec4(p.velocity, 0.0),
                spin: vec4(p.angular_velocity, 0.0),
                lame: [lambda, mu, lambda_by_nu, mu_by_nu].map(|v| v as f32),
                flow: p.viscosity.map_or([0.0; 4], |v| [v.coefficient as f32, v.exponent as f32, 0.0, 0.0]),
            });
            all_planes.extend(planes(plan, p).iter().map(|q| Plane {
                normal: vec4(q.normal[0], q.height),
                by_theta: vec4(q.normal[1], 0.0),
                by_phi: vec4(q.normal[2], 0.0),
                stiffness: q.stiffness as f32,
                scales: f32::from(u8::from(q.scales)),
                pad: [0.0; 2],
            }));
            geometry.effects.poses(plan, p, &mut poses);
            masses.extend(p.masses.iter().map(|m| *m as f32));
        }
        geometry.effects.upload(gpu, plan, &geometry.mass, &self.physics, buffers)?;
        buffers.insert("members", gpu.upload("members", &members)?);
        buffers.insert("planes", gpu.upload("planes", &all_planes)?);
        buffers.insert("poses", gpu.upload("poses", &poses)?);
        buffers.insert("mass_values", gpu.upload("mass_values", &masses)?);
        if self.slots != slots {
            self.upload_elements(gpu, plan, geometry, &slots, buffers)?;
            self.slots = slots;
        }
        if geometry.effects.on_clamps() {
            let own: Vec<&Elements> = members.iter().map(|m| &self.elements[m.slot as usize]).collect();
            let grips = geometry.effects.grips(plan, &self.physics, &own, &geometry.holds)?;
            buffers.insert("hold_elements", gpu.upload("hold_elements", &grips)?);
        }
        Ok(())
    }

    /// Element and clamp matrices of every Poisson's ratio in the batch: `[slot][K, dK/dν][class]`.
    fn upload_elements(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        geometry: &Geometry,
        slots: &[f64],
        buffers: &mut HashMap<&'static str, wgpu::Buffer>,
    ) -> Result<(), GpuError> {
        let (mut cells, mut holds) = (Vec::new(), Vec::new());
        self.elements.clear();
        let push = |out: &mut Vec<f32>, m: &M24| out.extend(m.iter().map(|x| *x as f32));
        for nu in slots {
            let e = Elements::new(plan, &geometry.classes, *nu);
            e.matrices.iter().for_each(|m| push(&mut cells, &m.k));
            e.matrices.iter().for_each(|m| push(&mut cells, &m.k_nu));
            if geometry.effects.on_clamps() {
                self.elements.push(e);
                continue;
            }
            let stated = |(i, cell): &(usize, u32)| &e.clamps[*i][plan.clamps[*i].cells.partition_point(|c| c.cell < *cell)];
            let held: Vec<_> = geometry.holds.iter().map(stated).collect();
            held.iter().for_each(|m| push(&mut holds, &m.k));
            held.iter().for_each(|m| push(&mut holds, &m.k_nu));
        }
        buffers.insert("elements", gpu.upload("elements", &cells)?);
        if !geometry.effects.on_clamps() {
            buffers.insert("hold_elements", gpu.upload("hold_elements", &holds)?);
        }
        Ok(())
    }
}
