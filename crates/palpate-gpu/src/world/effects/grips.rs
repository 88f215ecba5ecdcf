//! What effects make of clamps, computed on the host: poses over time, matrices, and the derivatives of both.

use super::Effects;
use crate::device::GpuError;
use crate::device::pipelines::shared::structs::FIELD_GRIPS;
use crate::layout::{ClampPose, HoldSlope};
use glam::{DMat3, DVec3};
use palpate_model::cutcells::elements::Elements;
use palpate_model::effects::field::Spot;
use palpate_model::params::changes;
use palpate_model::params::grips::{Grip, Grips, Pose};
use palpate_model::plan::{Physics, Plan, clamp_pose};

/// Numbers of a [`HoldSlope`].
pub(super) const FLOATS: usize = size_of::<HoldSlope>() / 4;
/// Central differences of a prescribed motion over this time [s] leave about 1e-10 of it (as on the CPU).
const MOMENT: f64 = 1e-6;

fn vec4(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

fn mat3(m: DMat3) -> [[f32; 4]; 3] {
    [m.x_axis, m.y_axis, m.z_axis].map(vec4)
}

/// A pose as the device has it, with its rate, from the pose as a function of time.
fn device_pose(at: impl Fn(f64) -> Pose, time: f64) -> ClampPose {
    let (a, b) = at(time);
    let (later, earlier) = (at(time + MOMENT), at(time - MOMENT));
    let rate = 0.5 / MOMENT;
    ClampPose {
        turn: mat3(a),
        excess: mat3(a - DMat3::IDENTITY),
        shift: vec4(b),
        turn_rate: mat3((later.0 - earlier.0) * rate),
        shift_rate: vec4((later.1 - earlier.1) * rate),
    }
}

/// Rows of the parameters that change the clamps' matrices, at the plan's own parameters or a little beyond.
pub(super) fn matrix_rows(plan: &Plan, rows: &[[usize; 2]]) -> Vec<usize> {
    let spot = Spot::of(plan);
    let physics = Physics::new(&plan.layout, &plan.theta);
    let mut beyond = physics.clone();
    beyond.effects.iter_mut().flatten().for_each(|p| *p += 1e-3);
    let changes = |p: &Physics, [effect, slot]: [usize; 2]| {
        changes::edge_slope(plan, p, effect, slot).is_some()
            || changes::hold_slope(plan, p, &spot, effect, slot).is_some_and(|s| s[0] != 0.0 || s[1] != 0.0)
    };
    (0..rows.len()).filter(|r| changes(&physics, rows[*r]) || changes(&beyond, rows[*r])).collect()
}

/// Times since the start of the start and of every stage's end [s].
fn instants(plan: &Plan) -> Vec<f64> {
    std::iter::once(0.0).chain(plan.clock.stages().iter().map(|s| s.time)).collect()
}

impl Effects {
    /// True when some effect acts on clamps: then every member has its own clamp matrices.
    pub(crate) fn on_clamps(&self) -> bool {
        self.bits & FIELD_GRIPS != 0
    }

    /// Rows of the numbers that change the clamps' matrices.
    pub(crate) fn matrix_rows(&self) -> &[usize] {
        &self.matrix_rows
    }

    /// Numbers of effects that move the clamps' poses, and those among them that change the matrices.
    pub(crate) fn hold_numbers(&self) -> [u32; 2] {
        [&self.grip_rows.len(), &self.matrix_rows.len()].map(|n| *n as u32)
    }

    /// Place among the matrices' slopes of a parameter of the clamps, by its row.
    pub(crate) fn matrix_row(&self, row: u32) -> Option<u32> {
        self.matrix_rows.iter().position(|r| *r == row as usize).map(|k| k as u32)
    }

    /// Numbers that a member's slopes of clamp matrices take, for a body of `holds` clamp cells.
    pub(crate) fn matrix_floats(&self, holds: usize) -> usize {
        576 * self.matrix_rows.len() * holds
    }

    /// Poses of a member's clamps at the start and at the end of every stage, `[stages + 1][clamps]`.
    pub(crate) fn poses(&self, plan: &Plan, physics: &Physics, out: &mut Vec<ClampPose>) {
        let grips = Grips::new(plan, physics, 0.0);
        for elapsed in instants(plan) {
            let (time, now) = (physics.start + elapsed, grips.after(elapsed));
            out.extend(plan.clamps.iter().enumerate().map(|(i, clamp)| {
                if self.on_clamps() {
                    device_pose(|t| now.pose(i, t), time)
                } else {
                    device_pose(|t| clamp_pose(clamp.motion.as_ref(), t), time)
                }
            }));
        }
    }

    /// Derivatives of the poses, `[rows][B][stages + 1][clamps]` of [`HoldSlope`].
    pub(super) fn hold_slopes(&self, plan: &Plan, batch: &[Physics]) -> Vec<f32> {
        let mut out: Vec<HoldSlope> = Vec::new();
        for [effect, slot] in &self.grip_rows {
            for physics in batch {
                let grips = Grips::new(plan, physics, 0.0);
                for elapsed in instants(plan) {
                    let (time, now) = (physics.start + elapsed, grips.after(elapsed));
                    out.extend((0..plan.clamps.len()).map(|i| {
                        let slope = now.pose_slope(i, time, *effect, *slot);
                        slope.map_or_else(HoldSlope::default, |(a, b)| HoldSlope { turn: mat3(a), shift: vec4(b) })
                    }));
                }
            }
        }
        bytemuck::cast_slice(&out).to_vec()
    }

    /// Thickness of the layers at held nodes and its derivatives by the numbers of [`Effects::matrix_rows`], `[1 + rows][B]` [m]; constant in time.
    pub(super) fn layers(&self, plan: &Plan, batch: &[Physics]) -> Vec<f32> {
        if !self.on_clamps() {
            return Vec::new();
        }
        let spot = Spot::of(plan);
        let mut out: Vec<f32> = batch.iter().map(|p| changes::hold(plan, p, &spot)[1] as f32).collect();
        for row in &self.matrix_rows {
            let [effect, slot] = self.grip_rows[*row];
            let slope = |p: &Physics| changes::hold_slope(plan, p, &spot, effect, slot).map_or(0.0, |s| s[1]);
            out.extend(batch.iter().map(|p| slope(p) as f32));
        }
        out
    }

    /// Clamp matrices of all members, `[B][K, dK/dν][clamp cell]`, then the slopes of K, `[rows][B][clamp cell]`; `holds` are (clamp,
    /// cell of the body) in the device's order, `elements` those at each member's Poisson's ratio. What a member does not hold is zero.
    ///
    /// # Errors
    /// A member's clamp reaches beyond what the bounds of the effects on its edge allow.
    pub(crate) fn grips(
        &self,
        plan: &Plan,
        batch: &[Physics],
        elements: &[&Elements],
        holds: &[(usize, u32)],
    ) -> Result<Vec<f32>, GpuError> {
        const NONE: [f64; 576] = [0.0; 576];
        let mut out = Vec::new();
        let mut put = |m: Option<&[f64; 576]>| out.extend(m.unwrap_or(&NONE).iter().map(|x| *x as f32));
        let mut all = Vec::new();
        for (physics, elements) in batch.iter().zip(elements) {
            let grips = Grip::all(plan, physics, elements).unwrap_or_default();
            let places = places(&grips, holds);
            if grips.iter().map(|g| g.cells.len()).sum::<usize>() > places.iter().flatten().count() {
                return Err(GpuError::Plan { what: "a clamp's edge beyond the bounds of `clamp-edge`".to_string() });
            }
            places.iter().for_each(|at| put(at.map(|(i, m)| &*grips[i].matrices[m].k)));
            places.iter().for_each(|at| put(at.map(|(i, m)| &*grips[i].matrices[m].k_nu)));
            all.push((grips, places));
        }
        for row in &self.matrix_rows {
            for ((physics, elements), (own, places)) in batch.iter().zip(elements).zip(&all) {
                let grips = Grips::new(plan, physics, 0.0);
                let slopes: Vec<_> = own.iter().map(|g| g.matrix_slopes(&grips, elements.nu, self.grip_rows[*row])).collect();
                let slope = |(i, m): (usize, usize)| slopes[i].as_ref().and_then(|of| of(m));
                places.iter().for_each(|at| put(at.and_then(slope).as_deref()));
            }
        }
        Ok(out)
    }
}

/// Where a member's clamps have each of the device's clamp cells: clamp and number among its cells.
fn places(grips: &[Grip], holds: &[(usize, u32)]) -> Vec<Option<(usize, usize)>> {
    holds.iter().map(|(i, cell)| Some((*i, grips[*i].cells.binary_search_by_key(cell, |c| c.cell).ok()?))).collect()
}
