//! Effects that change the body itself (stiffness, density, stress-free shape, clamps): a member's fields, and ∂r/∂p of each.

use crate::linear::vector::Nodes;
use crate::passes::balance::{Balance, States};
use crate::passes::cells::{Elasticity, Matrices};
use crate::passes::clamps;
use crate::passes::materials::{CellActing, Materials, cell_laws};
use crate::passes::supports;
use glam::DVec3;
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::cutcells::elements::Elements;
use palpate_model::params::changes::{self, Changes};
use palpate_model::params::grips::{Grip, Pose};
use palpate_model::plan::{Physics, Plan};

/// What a member's effects make of the body; all empty without such effects.
#[derive(Debug, Default)]
pub struct Altered {
    /// Fields on cells and nodes.
    pub changes: Changes,
    /// Every cell in the stress-free shape.
    pub rest: Option<Vec<CellPose>>,
    /// Clamps with compliant layers and moved edges.
    pub grips: Option<Vec<Grip>>,
    /// Laws of cells.
    pub laws: Vec<CellActing>,
}

impl Altered {
    /// The body of one member.
    pub fn new(plan: &Plan, physics: &Physics, elements: &Elements) -> Altered {
        let changes = Changes::new(plan, physics);
        let (body, h) = (&plan.body, plan.body.grid.h);
        let rest = changes.rest.as_ref().map(|w| {
            let at = |n: u32| body.nodes[n as usize] + w[n as usize];
            body.cells.iter().map(|c| CellPose::new(&c.nodes.map(at), h)).collect()
        });
        Altered { changes, rest, grips: Grip::all(plan, physics, elements), laws: cell_laws(plan, physics) }
    }
}

impl<'a> Balance<'a> {
    /// The clamps.
    pub(super) fn held(&self) -> clamps::Clamps<'a> {
        clamps::Clamps {
            plan: self.plan,
            physics: self.physics,
            elements: self.elements,
            changes: &self.altered.changes,
            grips: self.altered.grips.as_deref(),
        }
    }

    /// Young's modulus [Pa] at the time that the step's forces are taken at.
    pub(super) fn young(&self) -> f64 {
        self.physics.youngs_modulus * self.aging()
    }

    /// Factor on Young's modulus from creep.
    pub(super) fn aging(&self) -> f64 {
        if self.effects.is_empty() { 1.0 } else { changes::aging(self.plan, self.physics, self.elapsed()) }
    }

    /// Time from the start of the simulation to the instant between the states that the scheme weights them for [s].
    pub(super) fn elapsed(&self) -> f64 {
        let dt = self.inertia.map_or(0.0, |t| 1.0 / t.rate);
        self.time - self.physics.start - (1.0 - self.mix.new) * dt
    }

    /// Density [kg/m³] around a node.
    pub(super) fn density(&self, node: usize) -> f64 {
        self.physics.density * self.altered.changes.density.as_ref().map_or(1.0, |d| d[node])
    }

    /// Adds the part of ∂r/∂p that comes through the body itself, for number `slot` of effect `effect`.
    pub(super) fn add_altered_column(&self, effect: usize, slot: usize, s: States<'a>, out: &mut Nodes) {
        let (plan, physics) = (self.plan, self.physics);
        let changes = &self.altered.changes;
        if let Some(slope) = changes.modulus_slope(plan, physics, effect, slot) {
            let elasticity = Elasticity { modulus: Some(&slope), ..self.elasticity() };
            elasticity.force(&self.mix, Matrices::Stiffness, self.young(), s.u1, s.u0, out);
            if let Some(m) = self.materials() {
                Materials { elasticity, ..m }.force(self.young(), s.u1, s.u0, out);
            }
            self.each_clamp(s, |c, i, pose, weight, u| c.modulus_column(i, &slope, pose, weight * self.young(), u, out));
        }
        if let Some(slope) = changes.density_slope(plan, physics, effect, slot) {
            let (g, drag) = (physics.gravity, physics.mass_damping);
            for (i, d) in slope.iter().enumerate() {
                let a = self
                    .inertia
                    .map_or(-g, |t| (t.displacement + drag * t.rate) * (s.u1[i] - s.u0[i]) - t.velocity * s.v0[i] - g);
                out[i] += physics.density * plan.body.node_volume[i] * d * a;
            }
        }
        if let Some(slope) = changes::aging_slope(plan, physics, self.elapsed(), effect, slot) {
            let young = physics.youngs_modulus * slope;
            self.elasticity().force(&self.mix, Matrices::Stiffness, young, s.u1, s.u0, out);
            if let Some(m) = self.materials() {
                m.force(young, s.u1, s.u0, out);
            }
            self.each_clamp(s, |c, i, pose, weight, u| c.force(i, Matrices::Stiffness, pose, weight * young, u, out));
        }
        if let Some(dw) = changes::rest_slope(plan, physics, effect, slot) {
            self.elasticity().by_rest(&self.mix, s.u1, s.u0, &dw, out);
            if let Some(m) = self.materials() {
                m.rest_column(s.u1, s.u0, &dw, out);
            }
            let scale = -self.ghost_scale(physics.youngs_modulus * self.elements.shear[0]) * (self.mix.new + self.mix.old);
            supports::ghost_product(&plan.body, scale, &dw, out);
            self.each_clamp(s, |c, i, pose, weight, _| c.rest_column(i, pose.0, weight * self.young(), &dw, out));
        }
        self.all_materials().own_column(effect, slot, s.u1, s.u0, out);
        if self.altered.grips.is_some() {
            for (weight, time, u) in self.instants(s) {
                for i in 0..plan.clamps.len() {
                    let now = [time, time - physics.start];
                    self.held().hold_column(i, [effect, slot], now, weight * self.young(), u, out);
                }
            }
        }
    }

    /// The laws of cells, if there are any that are not absent.
    pub(super) fn materials(&self) -> Option<Materials<'a>> {
        self.altered.laws.iter().any(|l| !l.absent).then(|| self.all_materials())
    }

    /// The laws of cells, absent ones too.
    fn all_materials(&self) -> Materials<'a> {
        Materials {
            elasticity: self.elasticity(),
            laws: &self.altered.laws,
            mix: self.mix,
            rate: self.inertia.map_or(0.0, |t| t.rate),
        }
    }

    /// Visits every clamp at both instants: clamp number, pose, weight in time and displacement.
    fn each_clamp(&self, s: States<'a>, mut visit: impl FnMut(&clamps::Clamps, usize, Pose, f64, &[DVec3])) {
        let held = self.held();
        for (weight, time, u) in self.instants(s) {
            for i in 0..self.plan.clamps.len() {
                visit(&held, i, held.pose(i, time, time - self.physics.start), weight, u);
            }
        }
    }
}
