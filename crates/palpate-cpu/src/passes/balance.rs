//! The balance of forces that one solve must satisfy: residual, derivatives by both states and by every parameter.
//!
//! Dynamic (a step of the θ-scheme) and static problems are the same sum with and without inertia:
//! `r(u₁) = M[(1/(θΔt²))(u₁−u₀) − v₀/(θΔt)] + αM(u₁−u₀)/Δt + cells(u₁,u₀) + ghost + clamps(u₁) + contact(u₁) − weight`.
//! Contact acts along the way between the states (`palpate_model::mechanics::contact`): its work is never less than its energy's change, so it
//! limits no time step. Clamps are weighted like the cells: Nitsche's traction terms are bounded by the cells' energy only where
//! both see the same state.

use crate::linear::matrix::Matrix;
use crate::linear::vector::{Nodes, dot};
use crate::passes::altered::Altered;
use crate::passes::assembly::{self, block};
use crate::passes::cells::{Elasticity, Matrices, Mix, zeros};
use crate::passes::points::Acting;
use crate::passes::posed::{Before, Curvature, Posed};
use crate::passes::supports::{self, PlaneNow};
use glam::{DMat3, DVec3};
use palpate_model::cutcells::elements::Elements;
use palpate_model::mechanics::contact;
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::pattern::{Pattern, Places};

/// Factors of the inertia terms; `None` in a static problem.
#[derive(Clone, Copy, Debug)]
pub struct Inertia {
    /// 1/(θΔt²): factor of M(u₁ − u₀) [1/s²].
    pub displacement: f64,
    /// 1/(θΔt): factor of −M v₀ [1/s].
    pub velocity: f64,
    /// 1/Δt [1/s].
    pub rate: f64,
}

/// One balance of one member.
#[derive(Clone, Copy)]
pub struct Balance<'a> {
    /// Everything common to the batch.
    pub plan: &'a Plan,
    /// Pattern of the matrix.
    pub pattern: &'a Pattern,
    /// Where terms add into it.
    pub places: &'a Places,
    /// Matrices at the member's Poisson ratio.
    pub elements: &'a Elements,
    /// The member's parameters.
    pub physics: &'a Physics,
    /// The member's planes.
    pub planes: &'a [PlaneNow],
    /// The member's effects.
    pub effects: &'a [Acting],
    /// What effects change of the body itself.
    pub altered: &'a Altered,
    /// Inertia; `None` = static.
    pub inertia: Option<Inertia>,
    /// How the two states enter the elastic force.
    pub mix: Mix,
    /// Time of the new state on the recording's clock [s].
    pub time: f64,
}

/// The states of a balance: the unknown new displacement, and the old displacement and velocity.
#[derive(Clone, Copy)]
pub struct States<'a> {
    /// u₁ [m].
    pub u1: &'a [DVec3],
    /// u₀ [m].
    pub u0: &'a [DVec3],
    /// v₀ [m/s].
    pub v0: &'a [DVec3],
}

impl<'a> Balance<'a> {
    /// The elastic part.
    pub fn elasticity(&self) -> Elasticity<'a> {
        Elasticity {
            body: &self.plan.body,
            pattern: self.pattern,
            elements: self.elements,
            young: self.young(),
            modulus: self.altered.changes.modulus.as_deref(),
            rest: self.altered.rest.as_deref(),
        }
    }

    pub(super) fn ghost_scale(&self, shear: f64) -> f64 {
        self.plan.solver.ghost * self.plan.body.grid.h * shear
    }

    /// Adds ghost forces for a shear modulus.
    pub(super) fn ghost(&self, shear: f64, mix: &Mix, s: States, out: &mut [DVec3]) {
        if self.plan.body.ghosts.is_empty() {
            return;
        }
        let scale = self.ghost_scale(shear);
        supports::ghost_product(&self.plan.body, scale * (mix.new + mix.rate), s.u1, out);
        if mix.old != mix.rate {
            supports::ghost_product(&self.plan.body, scale * (mix.old - mix.rate), s.u0, out);
        }
        if let Some(w) = &self.altered.changes.rest {
            supports::ghost_product(&self.plan.body, -scale * (mix.new + mix.old), w, out);
        }
    }

    /// Adds M a for accelerations a(node) of the body alone and of the point masses.
    pub(super) fn masses(&self, body: impl Fn(usize) -> DVec3, points: impl Fn(usize) -> DVec3, out: &mut [DVec3]) {
        for (i, w) in self.plan.body.node_volume.iter().enumerate() {
            out[i] += self.density(i) * w * body(i);
        }
        for (site, m) in self.plan.masses.iter().zip(&self.physics.masses) {
            let mut a = DVec3::ZERO;
            for i in 0..8 {
                a += site.weights[i] * points(site.nodes[i] as usize);
            }
            for i in 0..8 {
                out[site.nodes[i] as usize] += *m * site.weights[i] * a;
            }
        }
    }

    /// Share of inertia in the diagonal of the matrix; 0 in a static problem.
    pub fn share_of_inertia(&self, matrix: &Matrix) -> f64 {
        let Some(t) = self.inertia else { return 0.0 };
        let mass: f64 = self.plan.body.node_volume.iter().enumerate().map(|(i, w)| self.density(i) * w).sum();
        t.displacement * mass / self.pattern.blocks.diagonal.iter().map(|k| matrix.mean_diagonal(*k)).sum::<f64>()
    }

    /// Adds inertia, mass damping and weight.
    fn bodily(&self, s: States, out: &mut [DVec3]) {
        let g = self.physics.gravity;
        match self.inertia {
            None => self.masses(|_| -g, |_| -g, out),
            Some(t) => {
                let drag = self.physics.mass_damping * t.rate;
                let newton = |i: usize| t.displacement * (s.u1[i] - s.u0[i]) - t.velocity * s.v0[i] - g;
                self.masses(|i| newton(i) + drag * (s.u1[i] - s.u0[i]), newton, out);
            }
        }
    }

    /// The old state's share in the elastic force: all solves from that state take it over.
    pub fn before(&self, u0: &[DVec3]) -> Before {
        self.elasticity().before(&self.mix, u0)
    }

    /// The cells' poses at a state, for [`Balance::tangent_from`].
    fn posed(&self, s: States<'a>) -> Vec<Posed> {
        let (mut posed, mut unused) = (Vec::new(), zeros(s.u1.len()));
        self.elasticity().force_from(&self.mix, &self.before(s.u0), s.u1, &mut posed, &mut unused);
        posed
    }

    /// r(u₁), shape `[N]` [N].
    pub fn residual(&self, s: States<'a>) -> Nodes {
        self.residual_from(s, &self.before(s.u0), &mut Vec::new())
    }

    /// The same within a solve. Keeps the cells' poses in `posed`, for [`Balance::tangent_from`] at the same displacement.
    pub fn residual_from(&self, s: States<'a>, before: &Before, posed: &mut Vec<Posed>) -> Nodes {
        let mut r = zeros(s.u1.len());
        self.elasticity().force_from(&self.mix, before, s.u1, posed, &mut r);
        if let Some(m) = self.materials() {
            m.force(self.young(), s.u1, s.u0, &mut r);
        }
        self.ghost(self.physics.youngs_modulus * self.elements.shear[0], &self.mix, s, &mut r);
        self.supports(s, &mut r);
        self.bodily(s, &mut r);
        self.add_effects(s, &mut r);
        r
    }

    /// The two instants that clamps act at, each with its weight, time on the recording's clock and displacement.
    pub(super) fn instants(&self, s: States<'a>) -> impl Iterator<Item = (f64, f64, &'a [DVec3])> {
        let dt = self.inertia.map_or(0.0, |t| 1.0 / t.rate);
        [(self.mix.new, self.time, s.u1), (self.mix.old, self.time - dt, s.u0)].into_iter().filter(|i| i.0 != 0.0)
    }

    /// Adds the clamps' force, moved in time by `shift`, with matrices scaled by `young`.
    pub(super) fn clamps(&self, which: Matrices, young: f64, shift: f64, s: States<'a>, out: &mut [DVec3]) {
        let held = self.held();
        for i in 0..self.plan.clamps.len() {
            for (weight, time, u) in self.instants(s) {
                let pose = held.pose(i, time + shift, time - self.physics.start);
                held.force(i, which, pose, weight * young, u, out);
            }
        }
    }

    /// What happens between the body and a plane.
    pub(super) fn contact(&self, plane: &'a PlaneNow, s: States<'a>) -> supports::Contact<'a> {
        supports::Contact { body: &self.plan.body, plane, theta: self.mix.new, u: [s.u1, s.u0] }
    }

    /// Adds clamps and contact.
    fn supports(&self, s: States<'a>, out: &mut [DVec3]) {
        self.clamps(Matrices::Stiffness, self.young(), 0.0, s, out);
        for plane in self.planes {
            for (_, t) in self.contact(plane, s).touches() {
                for i in 0..8 {
                    out[t.nodes[i] as usize] -= t.area * t.pressure * t.weights[i] * plane.normal[0];
                }
            }
        }
    }

    /// Sizes of the forces that the residual is the sum of, in the given norm: what "small" is measured against. `posed` is
    /// what the residual at the same displacement left.
    pub fn scale(&self, s: States<'a>, before: &Before, posed: &[Posed], norm: impl Fn(&[DVec3]) -> f64) -> f64 {
        let n = s.u1.len();
        let g = self.physics.gravity;
        let mut weight = zeros(n);
        self.masses(|_| g, |_| g, &mut weight);
        let mut momentum = zeros(n);
        if let Some(t) = self.inertia {
            self.masses(|i| t.velocity * s.v0[i], |i| t.velocity * s.v0[i], &mut momentum);
        }
        let mut elastic = zeros(n);
        self.elasticity().add_forces(before, posed, &mut elastic);
        let mut support = zeros(n);
        self.supports(s, &mut support);
        self.add_effects(s, &mut support);
        norm(&weight) + norm(&momentum) + norm(&elastic) + norm(&support)
    }

    /// Potential whose gradient by u₁ is the residual, up to a constant [J].
    pub fn potential(&self, s: States<'a>) -> f64 {
        self.potential_from(s, &self.before(s.u0))
    }

    /// The same within a solve.
    pub fn potential_from(&self, s: States<'a>, before: &Before) -> f64 {
        let young = self.physics.youngs_modulus;
        let mut w = self.elasticity().potential(&self.mix, before, s.u1);
        w += self.materials().map_or(0.0, |m| m.potential(s.u1, s.u0));
        if !self.plan.body.ghosts.is_empty() {
            let scale = self.ghost_scale(young * self.elements.shear[0]);
            let mut gu = zeros(s.u1.len());
            supports::ghost_product(&self.plan.body, scale * (self.mix.new + self.mix.rate), s.u1, &mut gu);
            supports::ghost_product(&self.plan.body, 2.0 * scale * (self.mix.old - self.mix.rate), s.u0, &mut gu);
            if let Some(rest) = &self.altered.changes.rest {
                supports::ghost_product(&self.plan.body, -2.0 * scale * (self.mix.new + self.mix.old), rest, &mut gu);
            }
            w += 0.5 * dot(s.u1, &gu);
        }
        let held = self.held();
        for i in 0..self.plan.clamps.len() {
            let pose = held.pose(i, self.time, self.time - self.physics.start);
            w += held.energy(i, pose, self.mix.new * self.young(), s.u1);
        }
        if self.mix.old != 0.0 && !self.plan.clamps.is_empty() {
            // The old state's force does not change with u₁: its potential is linear.
            let mut old = zeros(s.u1.len());
            Balance { mix: Mix { new: 0.0, ..self.mix }, ..*self }.clamps(Matrices::Stiffness, self.young(), 0.0, s, &mut old);
            w += dot(s.u1, &old);
        }
        for plane in self.planes {
            w += self.contact(plane, s).touches().map(|(_, t)| t.area * t.energy).sum::<f64>();
        }
        // Inertia and weight are quadratic and linear: ½ (r(u₁) + r(0))·u₁.
        let mut at_new = zeros(s.u1.len());
        self.bodily(s, &mut at_new);
        let zero = zeros(s.u1.len());
        self.bodily(States { u1: &zero, ..s }, &mut at_new);
        w + 0.5 * dot(s.u1, &at_new) + self.effects_potential(s)
    }

    /// ∂r/∂u₁, symmetric.
    pub fn tangent(&self, s: States<'a>, convex: bool, matrix: &mut Matrix) {
        let curvature = if convex { Curvature::Convex } else { Curvature::Exact };
        self.tangent_from(s, &self.posed(s), curvature, matrix);
    }

    /// The same within a solve. `posed` is what the residual at
    /// the same displacement left.
    pub fn tangent_from(&self, s: States<'a>, posed: &[Posed], curvature: Curvature, matrix: &mut Matrix) {
        let (elasticity, materials) = (self.elasticity(), self.materials());
        assembly::cells(&elasticity, materials.as_ref(), self.pattern, self.places, &self.mix, s, posed, curvature, matrix);
        self.add_sparse(s, curvature == Curvature::Convex, matrix);
        self.add_effects_tangent(s, curvature != Curvature::Exact, matrix);
    }

    /// Adds everything but the cells to the matrix.
    fn add_sparse(&self, s: States<'a>, convex: bool, matrix: &mut Matrix) {
        let (plan, pattern, physics) = (self.plan, self.pattern, self.physics);
        let values = &mut matrix.values;
        let ghost = self.ghost_scale(physics.youngs_modulus * self.elements.shear[0]) * (self.mix.new + self.mix.rate);
        for (block, factor) in &self.places.ghosts {
            add_to_diagonal(&mut values[*block as usize], ghost * factor);
        }
        if let Some(t) = self.inertia {
            let factor = t.displacement + physics.mass_damping * t.rate;
            for (i, w) in plan.body.node_volume.iter().enumerate() {
                add_to_diagonal(&mut values[pattern.blocks.diagonal[i]], self.density(i) * w * factor);
            }
            for (k, (site, m)) in plan.masses.iter().zip(&physics.masses).enumerate() {
                for b in 0..64 {
                    let s = m * t.displacement * site.weights[b / 8] * site.weights[b % 8];
                    add_to_diagonal(&mut values[self.places.masses[k][b] as usize], s);
                }
            }
        }
        let held = self.held();
        for c in 0..plan.clamps.len() {
            let (a, _) = held.pose(c, self.time, self.time - physics.start);
            for (m, cell) in held.cells(c).iter().enumerate() {
                let (k, factor) = held.stiffness(c, m, convex);
                let places = &self.places.cells[cell.cell as usize];
                for b in 0..64 {
                    values[places[b] as usize] +=
                        a * block(k, b / 8, b % 8) * a.transpose() * (self.mix.new * self.young() * factor);
                }
            }
        }
        for plane in self.planes {
            let n = plane.normal[0];
            let nn = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            for (patch, t) in self.contact(plane, s).touches() {
                let places = &self.places.cells[patch.cell as usize];
                for b in 0..64 {
                    values[places[b] as usize] += nn * (-t.area * t.slopes[0] * t.weights[b / 8] * t.weights[b % 8]);
                }
            }
        }
    }

    /// (∂r/∂u₀) du₀ + (∂r/∂v₀) dv₀.
    pub fn by_old(&self, s: States<'a>, du0: &[DVec3], dv0: &[DVec3]) -> Nodes {
        let mut out = self.by_old_linear(du0, dv0);
        self.contact_by_old(s, du0, &mut out);
        self.elasticity().by_old(&self.mix, s.u1, s.u0, du0, &mut out);
        if let Some(m) = self.materials() {
            m.by_old(s.u1, s.u0, du0, &mut out);
        }
        self.add_effects_by_old(s, du0, dv0, &mut out);
        out
    }

    /// Transposes of both: ((∂r/∂u₀)ᵀ z, (∂r/∂v₀)ᵀ z).
    pub fn by_old_transposed(&self, s: States<'a>, z: &[DVec3]) -> (Nodes, Nodes) {
        let zero = zeros(z.len());
        let mut to_u = self.by_old_linear(z, &zero);
        self.contact_by_old(s, z, &mut to_u);
        self.elasticity().by_old_transposed(&self.mix, s.u1, s.u0, z, &mut to_u);
        if let Some(m) = self.materials() {
            m.by_old_transposed(s.u1, s.u0, z, &mut to_u);
        }
        let mut to_v = self.by_old_linear(&zero, z);
        self.add_effects_transposed(s, z, &mut to_u, &mut to_v);
        (to_u, to_v)
    }

    /// Adds the derivative of contact by the old state, times `d`; symmetric.
    fn contact_by_old(&self, s: States<'a>, d: &[DVec3], out: &mut [DVec3]) {
        if !contact::acts_along(self.mix.new) {
            return;
        }
        for plane in self.planes {
            let n = plane.normal[0];
            for (_, t) in self.contact(plane, s).touches() {
                let approach: f64 = (0..8).map(|i| t.weights[i] * n.dot(d[t.nodes[i] as usize])).sum();
                for i in 0..8 {
                    out[t.nodes[i] as usize] -= t.area * t.slopes[1] * approach * t.weights[i] * n;
                }
            }
        }
    }

    /// The symmetric parts (inertia, ghost, clamps) of the derivative by the old state.
    fn by_old_linear(&self, du0: &[DVec3], dv0: &[DVec3]) -> Nodes {
        let mut out = zeros(du0.len());
        if let Some(t) = self.inertia {
            let drag = self.physics.mass_damping * t.rate;
            let newton = |i: usize| -t.displacement * du0[i] - t.velocity * dv0[i];
            self.masses(|i| newton(i) - drag * du0[i], newton, &mut out);
        }
        let factor = self.mix.old - self.mix.rate;
        if factor != 0.0 && !self.plan.body.ghosts.is_empty() {
            let scale = self.ghost_scale(self.physics.youngs_modulus * self.elements.shear[0]);
            supports::ghost_product(&self.plan.body, scale * factor, du0, &mut out);
        }
        if self.mix.old != 0.0 {
            let dt = self.inertia.map_or(0.0, |t| 1.0 / t.rate);
            let held = self.held();
            for i in 0..self.plan.clamps.len() {
                let turn = held.pose(i, self.time - dt, self.time - dt - self.physics.start).0;
                held.product(i, turn, self.mix.old * self.young(), du0, &mut out);
            }
        }
        out
    }
}

/// block += s I.
fn add_to_diagonal(block: &mut DMat3, s: f64) {
    block.x_axis.x += s;
    block.y_axis.y += s;
    block.z_axis.z += s;
}
