//! How effects make clamps hold: pose and matrices of a member's clamps with their derivatives, for every backend.
//!
//! The numbers of [`crate::changes::HOLD`] turn and move the pose of a clamp and put a compliant layer between body and clamp.

use crate::changes::{self, HOLD};
use crate::corotation::M24;
use crate::effects::field::Spot;
use crate::effects::{Law, Site};
use crate::element::CellMatrices;
use crate::elements::{Elements, layer_matrix, layered};
use crate::plan::{ClampCell, Physics, Plan, clamp_pose};
use glam::{DMat3, DVec3};

/// Rotation and translation of a clamp: a point X is wanted at A X + b.
pub type Pose = (DMat3, DVec3);

/// Rotation of Cayley's vector r and its derivatives by the three components: (1 − r²/4) I + ½ r rᵀ + \[r\]×, over 1 + r²/4.
fn cayley(r: DVec3) -> (DMat3, [DMat3; 3]) {
    let cross = crate::rotation::cross_matrix;
    let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
    let (s, below) = (0.25 * r.length_squared(), 1.0 + 0.25 * r.length_squared());
    let above = DMat3::from_diagonal(DVec3::splat(1.0 - s)) + outer(r, r) * 0.5 + cross(r);
    let slope = |e: DVec3| {
        let own = DMat3::from_diagonal(DVec3::splat(-0.5 * r.dot(e))) + (outer(e, r) + outer(r, e)) * 0.5 + cross(e);
        (own - above * (0.5 * r.dot(e) / below)) * (1.0 / below)
    };
    (above * (1.0 / below), DVec3::AXES.map(slope))
}

fn three(hold: &[f64; HOLD], at: usize) -> DVec3 {
    DVec3::from_slice(&hold[at..at + 3])
}

fn on_clamps(law: &Law) -> bool {
    matches!(law.site, Site::Clamps(_))
}

/// True when some effect acts on clamps.
pub fn acted(plan: &Plan) -> bool {
    plan.layout.effects().any(|(law, _)| on_clamps(law))
}

/// The clamps of one member at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Grips<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The member's parameters.
    pub physics: &'a Physics,
    /// The spot of the clamps' fields at this instant.
    pub spot: Spot,
}

impl<'a> Grips<'a> {
    /// The clamps `elapsed` seconds after the start.
    pub fn new(plan: &'a Plan, physics: &'a Physics, elapsed: f64) -> Grips<'a> {
        Grips { plan, physics, spot: Spot { elapsed, ..Spot::of(plan) } }
    }

    /// The same at another time.
    pub fn after(self, elapsed: f64) -> Grips<'a> {
        Grips { spot: Spot { elapsed, ..self.spot }, ..self }
    }

    /// Pose of clamp `index`, whose prescribed motion is taken at a time on the recording's clock.
    pub fn pose(&self, index: usize, time: f64) -> Pose {
        let (a, b) = clamp_pose(self.plan.clamps[index].motion.as_ref(), time);
        let (hold, c) = (changes::hold(self.plan, self.physics, &self.spot), self.spot.anchor);
        let turn = cayley(three(&hold, 5)).0;
        (a * turn, b + a * (c + three(&hold, 2) - turn * c))
    }

    /// Derivative of [`Grips::pose`] by number `slot` of effect `effect`; `None` for effects that leave clamps alone.
    pub fn pose_slope(&self, index: usize, time: f64, effect: usize, slot: usize) -> Option<Pose> {
        let slope = changes::hold_slope(self.plan, self.physics, &self.spot, effect, slot)?;
        let (a, _) = clamp_pose(self.plan.clamps[index].motion.as_ref(), time);
        let turns = cayley(three(&changes::hold(self.plan, self.physics, &self.spot), 5)).1;
        let dr = three(&slope, 5);
        let turn = turns[0] * dr.x + turns[1] * dr.y + turns[2] * dr.z;
        Some((a * turn, a * (three(&slope, 2) - turn * self.spot.anchor)))
    }

    /// Matrices of cell `m` of clamp `index` with the layer that effects put in (constant in time).
    pub fn matrices(&self, elements: &Elements, index: usize, m: usize) -> CellMatrices {
        self.layered(&self.plan.clamps[index].cells[m], &elements.clamps[index][m], elements.nu)
    }

    /// The same of any held cell, from its matrices without layer.
    pub fn layered(&self, c: &ClampCell, cell: &CellMatrices, nu: f64) -> CellMatrices {
        let hold = changes::hold(self.plan, self.physics, &self.spot);
        let [k3, k3_nu] = self.layer(c, nu);
        let make = |k: &M24, k3: &M24| Box::new(layered(k, k3, self.plan.body.grid.h, hold[1], false).map(|v| hold[0] * v));
        CellMatrices { k: make(&cell.k, &k3), k_nu: make(&cell.k_nu, &k3_nu) }
    }

    /// Derivative of the stiffness in [`Grips::matrices`] by number `slot` of effect `effect`; `None` where there is none.
    pub fn matrix_slope(&self, elements: &Elements, [index, m]: [usize; 2], by: [usize; 2]) -> Option<Box<M24>> {
        self.layered_slope(&self.plan.clamps[index].cells[m], &elements.clamps[index][m].k, elements.nu, by)
    }

    /// The same of any held cell, from its stiffness without layer.
    pub fn layered_slope(&self, c: &ClampCell, k: &M24, nu: f64, [effect, slot]: [usize; 2]) -> Option<Box<M24>> {
        let slope = changes::hold_slope(self.plan, self.physics, &self.spot, effect, slot)?;
        if slope[0] == 0.0 && slope[1] == 0.0 {
            return None;
        }
        let (hold, h) = (changes::hold(self.plan, self.physics, &self.spot), self.plan.body.grid.h);
        let [k3, _] = self.layer(c, nu);
        let (own, by_layer) = (layered(k, &k3, h, hold[1], false), layered(k, &k3, h, hold[1], true));
        Some(Box::new(std::array::from_fn(|i| slope[0] * own[i] + hold[0] * slope[1] * by_layer[i])))
    }

    fn layer(&self, c: &ClampCell, nu: f64) -> [Box<M24>; 2] {
        layer_matrix(c, self.plan.body.cells[c.cell as usize].fraction, nu)
    }
}
