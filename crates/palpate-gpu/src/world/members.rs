//! What members differ in: θ decoded, planes, clamp poses over time, element matrices per Poisson's ratio.

use super::coarse::Coarse;
use super::geometry::Geometry;
use crate::device::{Arena, Gpu, GpuError};
use crate::layout::{ClampPose, Member, Plane};
use glam::DVec3;
use palpate_engine::{Direction, Failure, ParamBatch};
use palpate_model::cutcells::corotation::M24;
use palpate_model::cutcells::elements::Elements;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::mechanics::plane::planes;
use palpate_model::observation::Viewed;
use palpate_model::plan::{Physics, Plan};
use std::cell::RefCell;
use std::collections::HashMap;

fn vec4(v: DVec3, w: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w as f32]
}

/// θ of a batch on the device.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) physics: Vec<Physics>,
    pub(crate) theta: Vec<Vec<f64>>,
    /// What each member is compared with.
    pub(crate) views: Vec<Viewed>,
    /// Places that each member wants sensitivities for; empty where all want those that are requested.
    pub(crate) own: Vec<Vec<usize>>,
    /// Why the host has no stress-free shape, or no derivative of it, for a member; empty where none is wanted.
    pub(crate) refused: RefCell<Vec<Option<Failure>>>,
    /// Poisson's ratio of each slot of element matrices that is on the device.
    slots: Vec<f64>,
    /// The matrices themselves, kept where effects make other clamps of them.
    elements: Vec<Elements>,
}

impl Batch {
    /// Directions of the tangents for which `requested` places ask.
    pub(crate) fn directions(&self, requested: &[usize]) -> Vec<Direction> {
        Direction::along(&self.own, requested)
    }

    /// Number of sensitivities of a member, where these many are requested.
    pub(crate) fn count(&self, member: usize, requested: usize) -> usize {
        self.own.get(member).map_or(requested, Vec::len)
    }

    /// Why a member has failed on the host.
    pub(crate) fn refusal(&self, member: usize) -> Option<Failure> {
        self.refused.borrow().get(member).cloned().flatten()
    }

    /// Uploads θ and what follows from it; `found` are stress-free shapes, of plans whose given shape is the equilibrium.
    ///
    /// # Errors
    /// More than the device has.
    pub(crate) fn set(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        geometry: &Geometry,
        coarse: &mut Coarse,
        theta: &ParamBatch,
        found: Vec<Result<Vec<DVec3>, Failure>>,
        buffers: &mut HashMap<&'static str, wgpu::Buffer>,
    ) -> Result<(), GpuError> {
        self.theta = (0..theta.members()).map(|b| theta.row(b).to_vec()).collect();
        self.own.clone_from(&theta.own);
        self.views = (0..theta.members()).map(|b| plan.viewed(&theta.view(b))).collect();
        self.physics = self.theta.iter().map(|row| Physics::new(&plan.layout, row)).collect();
        self.refused.replace(found.iter().map(|f| f.as_ref().err().cloned()).collect());
        let found: Vec<Vec<DVec3>> =
            found.into_iter().map(|f| f.unwrap_or_else(|_| vec![DVec3::ZERO; plan.body.nodes.len()])).collect();
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
        for (b, p) in self.physics.iter().enumerate() {
            let slot = slots.iter().position(|nu| *nu == p.poisson_ratio).unwrap_or_else(|| {
                slots.push(p.poisson_ratio);
                slots.len() - 1
            });
            let ((lambda, mu), (lambda_by_nu, mu_by_nu)) = (lame(1.0, p.poisson_ratio), lame_by_nu(1.0, p.poisson_ratio));
            let shear = |s: f64| (unit * s) as f32;
            // A ratio without matrices, or a member without a shape, is refused by the kernel that refuses other parameters: no modulus goes with it.
            let sound = p.poisson_ratio > -1.0 && p.poisson_ratio < 0.5 && self.refusal(b).is_none();
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
        let mut tables = Arena::new("batch_tables");
        geometry.effects.put(plan, &geometry.mass, &self.physics, &found, &mut tables);
        tables.put("members", &members);
        tables.put("lasting", &self.views.iter().map(|v| v.recording.steps as u32).collect::<Vec<_>>());
        tables.put("planes", &all_planes);
        tables.put("poses", &poses);
        tables.put("mass_values", &masses);
        tables.put("coarse_choices", &coarse.choices(&self.physics));
        tables.upload(gpu, buffers)?;
        coarse.upload(gpu, buffers)?;
        let on_clamps = geometry.effects.on_clamps();
        let others = self.slots != slots;
        if others {
            self.elements = slots.iter().map(|nu| Elements::new(plan, &geometry.classes, *nu)).collect();
            self.slots = slots;
        }
        if others || on_clamps {
            let mut tables = Arena::new("matrices_tables");
            tables.put("elements", &cell_matrices(&self.elements));
            if on_clamps {
                let own: Vec<&Elements> = members.iter().map(|m| &self.elements[m.slot as usize]).collect();
                tables.put("hold_elements", &geometry.effects.grips(plan, &self.physics, &own, &geometry.holds)?);
            } else {
                tables.put("hold_elements", &hold_matrices(plan, geometry, &self.elements));
                self.elements.clear();
            }
            tables.upload(gpu, buffers)?;
        }
        Ok(())
    }
}

fn put(out: &mut Vec<f32>, m: &M24) {
    out.extend(m.iter().map(|x| *x as f32));
}

/// Element matrices of every Poisson's ratio in the batch: `[slot][K, dK/dν][class]`.
fn cell_matrices(elements: &[Elements]) -> Vec<f32> {
    let mut out = Vec::new();
    for e in elements {
        e.matrices.iter().for_each(|m| put(&mut out, &m.k));
        e.matrices.iter().for_each(|m| put(&mut out, &m.k_nu));
    }
    out
}

/// The same of cells that clamps hold.
fn hold_matrices(plan: &Plan, geometry: &Geometry, elements: &[Elements]) -> Vec<f32> {
    let mut out = Vec::new();
    for e in elements {
        let stated = |(i, cell): &(usize, u32)| &e.clamps[*i][plan.clamps[*i].cells.partition_point(|c| c.cell < *cell)];
        let held: Vec<_> = geometry.holds.iter().map(stated).collect();
        held.iter().for_each(|m| put(&mut out, &m.k));
        held.iter().for_each(|m| put(&mut out, &m.k_nu));
    }
    out
}
