//! Clamps: Nitsche's forces on the held regions, as effects change them (compliance, slip, edge), with all their derivatives.
//!
//! A clamp wants its points at A X + b. Effects turn and move that pose, put a compliant layer between body and clamp and shift the edge
//! of what is held; a body whose stiffness varies is held as stiffly as it is itself, and one with another stress-free shape X + W is
//! held in that shape. The force on a cell's corners is A K (Aᵀ(x − b) − X − W).
//!
//! Clamps are weighted in time like the cells: Nitsche's traction terms are bounded by the cells' energy only where both see the same state.

use super::elastic_cells::blocks::block;
use super::products::Parts;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, zeros};
use crate::linear::matrix::Matrix;
use crate::linear::vector::dot;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::corotation::{M24, V24, corners, flatten, multiply};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::params::grips::{Grips, Pose};
use palpate_model::plan::{ClampCell, clamp_pose};

/// The prescribed motion is a smooth curve: central differences over a microsecond leave about 1e-10 of its derivative by time.
const MOMENT: f64 = 1e-6;

/// Which matrix a force is made with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Which {
    Stiffness,
    ByPoisson,
}

/// One clamp at one instant: number, weight in time, pose, and the body's displacement.
struct Instant<'s> {
    index: usize,
    weight: f64,
    time: f64,
    pose: Pose,
    u: &'s [DVec3],
}

/// The term.
pub struct Clamped<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

impl<'a> Clamped<'a> {
    /// Cells that clamp `index` holds.
    fn cells(&self, index: usize) -> &'a [ClampCell] {
        self.c.altered.grips.as_ref().map_or(&self.c.plan.clamps[index].cells, |g| &g[index].cells)
    }

    fn matrix(&self, index: usize, cell: usize, which: Which) -> &'a M24 {
        let m = &self.c.altered.grips.as_ref().map_or(&self.c.elements.clamps[index], |g| &g[index].matrices)[cell];
        match which {
            Which::Stiffness => &m.k,
            Which::ByPoisson => &m.k_nu,
        }
    }

    /// Pose of clamp `index` at a time on the recording's clock, its prescribed motion `shift` later.
    fn pose(&self, index: usize, time: f64, shift: f64) -> Pose {
        if self.c.altered.grips.is_none() {
            return clamp_pose(self.c.plan.clamps[index].motion.as_ref(), time + shift);
        }
        Grips::new(self.c.plan, self.c.physics(), time - self.c.physics().start).pose(index, time + shift)
    }

    /// Every clamp at the instants that it acts at, its motion shifted in time by `shift`.
    fn instants<'s>(&self, u1: &'s [DVec3], shift: f64) -> Vec<Instant<'s>>
    where
        'a: 's,
    {
        let w = &self.c.weights;
        let states = [(w.new, self.c.time, u1), (w.old, self.c.time - self.c.length(), self.c.past.u)];
        let acting = states.into_iter().filter(|s| s.0 != 0.0);
        let all = acting.flat_map(|(weight, time, u)| (0..self.c.plan.clamps.len()).map(move |index| (index, weight, time, u)));
        all.map(|(index, weight, time, u)| Instant { index, weight, time, pose: self.pose(index, time, shift), u }).collect()
    }

    /// Displacement of a held cell's corners from where the clamp wants them, in the clamp's frame: Aᵀ(x − b) − X − W.
    fn deviation(&self, c: &ClampCell, (a, b): Pose, u: &[DVec3]) -> V24 {
        let (body, rest) = (&self.c.plan.body, self.c.coefficients.changes.rest.as_deref());
        flatten(&body.cells()[c.cell as usize].nodes.map(|n| {
            let x = body.nodes[n as usize];
            a.transpose() * (x + u[n as usize] - b) - x - rest.map_or(DVec3::ZERO, |w| w[n as usize])
        }))
    }

    fn nodes(&self, c: &ClampCell) -> &'a [u32; 8] {
        &self.c.plan.body.cells()[c.cell as usize].nodes
    }

    /// Hands every held cell with the force on its corners, for 1 Pa and without the instant's weight, to `visit`.
    fn each(&self, at: &Instant, which: Which, mut visit: impl FnMut(&ClampCell, [DVec3; 8])) {
        for (m, c) in self.cells(at.index).iter().enumerate() {
            let y = multiply(self.matrix(at.index, m, which), &self.deviation(c, at.pose, at.u));
            visit(c, corners(&y).map(|f| at.pose.0 * f));
        }
    }

    fn add(&self, c: &ClampCell, scale: f64, f: [DVec3; 8], out: &mut [DVec3]) {
        let nodes = self.nodes(c);
        for i in 0..8 {
            out[nodes[i] as usize] += scale * f[i];
        }
    }

    fn work(&self, c: &ClampCell, f: [DVec3; 8], z: &[DVec3]) -> f64 {
        self.nodes(c).iter().zip(f).map(|(n, f)| z[*n as usize].dot(f)).sum()
    }

    /// Adds the force of all clamps.
    fn force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        let young = self.c.young();
        for at in self.instants(u1, 0.0) {
            self.each(&at, Which::Stiffness, |c, f| self.add(c, at.weight * young * self.c.factor(c.cell as usize), f, out));
        }
    }

    /// Hands the parts of the force's derivative by number `slot` of effect `effect`, for 1 Pa, to `visit`.
    fn each_held(&self, at: &Instant, [effect, slot]: [usize; 2], mut visit: impl FnMut(&ClampCell, [DVec3; 8])) {
        let Some(own) = self.c.altered.grips.as_ref().map(|g| &g[at.index]) else { return };
        let grips = Grips::new(self.c.plan, self.c.physics(), at.time - self.c.physics().start);
        let Some(change) = own.matrix_slopes(&grips, self.c.elements.nu, [effect, slot]) else { return };
        let pose = grips.pose(at.index, at.time);
        let moves = grips.pose_slope(at.index, at.time, effect, slot);
        for (m, c) in own.cells.iter().enumerate() {
            let d = self.deviation(c, pose, at.u);
            if let Some((da, db)) = moves {
                let k = self.matrix(at.index, m, Which::Stiffness);
                // The pose: dA K d + A K (dAᵀ(x − b) − Aᵀ db).
                let nodes = &self.c.plan.body.nodes;
                let moved = self
                    .nodes(c)
                    .map(|n| da.transpose() * (nodes[n as usize] + at.u[n as usize] - pose.1) - pose.0.transpose() * db);
                visit(c, corners(&multiply(k, &d)).map(|f| da * f));
                visit(c, corners(&multiply(k, &flatten(&moved))).map(|f| pose.0 * f));
            }
            // The matrix: factor, layer and edge.
            if let Some(change) = change(m) {
                visit(c, corners(&multiply(&change, &d)).map(|f| pose.0 * f));
            }
        }
    }

    fn moving(&self) -> bool {
        self.c.plan.clamps.iter().any(|c| c.motion.is_some())
    }

    /// K Aᵀ v of a held cell, in the clamp's frame.
    fn turned(&self, at: &Instant, m: usize, c: &ClampCell, turn: DMat3, v: &[DVec3]) -> [DVec3; 8] {
        let d = self.nodes(c).map(|n| turn.transpose() * v[n as usize]);
        corners(&multiply(self.matrix(at.index, m, Which::Stiffness), &flatten(&d)))
    }

    /// Adds A K Aᵀ d at the old state, which is symmetric.
    fn old_product(&self, u1: &[DVec3], d: &[DVec3], out: &mut [DVec3]) {
        if self.c.weights.old == 0.0 {
            return;
        }
        let young = self.c.young();
        // The second half of the instants is the old state.
        for at in self.instants(u1, 0.0).into_iter().skip(self.c.plan.clamps.len()) {
            for (m, c) in self.cells(at.index).iter().enumerate() {
                let f = self.turned(&at, m, c, at.pose.0, d).map(|f| at.pose.0 * f);
                self.add(c, at.weight * young * self.c.factor(c.cell as usize), f, out);
            }
        }
    }
}

impl Term for Clamped<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let young = self.c.young();
        let (mut w, mut old) = (0.0, zeros(if self.c.weights.old == 0.0 { 0 } else { u1.len() }));
        for (i, at) in self.instants(u1, 0.0).iter().enumerate() {
            let scale = |c: &ClampCell| at.weight * young * self.c.factor(c.cell as usize);
            if i >= self.c.plan.clamps.len() {
                // The old state's force does not change with u₁: its potential is linear.
                self.each(at, Which::Stiffness, |c, f| self.add(c, scale(c), f, &mut old));
                continue;
            }
            for (m, c) in self.cells(at.index).iter().enumerate() {
                let d = self.deviation(c, at.pose, at.u);
                let f = multiply(self.matrix(at.index, m, Which::Stiffness), &d);
                w += 0.5 * scale(c) * d.iter().zip(&f).map(|(d, f)| d * f).sum::<f64>();
            }
        }
        w + if old.is_empty() { 0.0 } else { dot(u1, &old) }
    }

    fn tangent(&self, _u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        let young = self.c.young();
        for index in 0..self.c.plan.clamps.len() {
            let (a, _) = self.pose(index, self.c.time, 0.0);
            let fallback = self.c.altered.grips.as_ref().filter(|_| curvature == Curvature::Convex);
            let convex = fallback.and_then(|grips| grips[index].convex.as_ref());
            for (m, cell) in self.cells(index).iter().enumerate() {
                let k = convex.map_or_else(|| self.matrix(index, m, Which::Stiffness), |matrices| &matrices[m].k);
                let places = &self.c.places.cells[cell.cell as usize];
                let scale = self.c.weights.new * young * self.c.factor(cell.cell as usize);
                for b in 0..64 {
                    matrix.values[places[b] as usize] += a * block(k, b / 8, b % 8) * a.transpose() * scale;
                }
            }
        }
    }

    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        // Clamps hold nodes of bodies without cells.
        let holds = (0..self.c.plan.clamps.len()).any(|index| !self.cells(index).is_empty());
        if holds { Parts::Matrix } else { Parts::Nothing }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        self.old_product(u1, change.u, out);
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        self.old_product(u1, z, &mut out.u);
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (young, ln_young, d) = (self.c.young(), self.c.ln_young_along(rates), &rates.physics);
        for at in self.instants(u1, 0.0) {
            let scale = |c: &ClampCell| at.weight * young * self.c.factor(c.cell as usize);
            if ln_young != 0.0 || rates.changes.modulus.is_some() {
                let change = |c: &ClampCell| ln_young + self.c.ln_factor_along(rates, c.cell as usize);
                self.each(&at, Which::Stiffness, |c, f| self.add(c, scale(c) * change(c), f, out));
            }
            if d.poisson_ratio != 0.0 {
                self.each(&at, Which::ByPoisson, |c, f| self.add(c, scale(c) * d.poisson_ratio, f, out));
            }
            if let Some(dw) = &rates.changes.rest {
                for (m, c) in self.cells(at.index).iter().enumerate() {
                    let f = self.turned(&at, m, c, DMat3::IDENTITY, dw).map(|f| at.pose.0 * f);
                    self.add(c, -scale(c), f, out);
                }
            }
            for (effect, numbers) in d.effects.iter().enumerate() {
                for (slot, rate) in numbers.iter().enumerate().filter(|(_, r)| **r != 0.0) {
                    self.each_held(&at, [effect, slot], |c, f| self.add(c, rate * scale(c), f, out));
                }
            }
        }
        if d.start != 0.0 && self.moving() {
            for sign in [1.0, -1.0] {
                for at in self.instants(u1, sign * MOMENT) {
                    let scale = sign * d.start * at.weight * young / (2.0 * MOMENT);
                    self.each(&at, Which::Stiffness, |c, f| self.add(c, scale * self.c.factor(c.cell as usize), f, out));
                }
            }
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let young = self.c.young();
        for at in self.instants(u1, 0.0) {
            let scale = |c: &ClampCell| at.weight * young * self.c.factor(c.cell as usize);
            if sought.modulus {
                let mut by_ln = Vec::new();
                self.each(&at, Which::Stiffness, |c, f| by_ln.push((c.cell as usize, scale(c) * self.work(c, f, z))));
                self.c.pull_modulus(by_ln.into_iter(), gradient);
            }
            if sought.poisson {
                self.each(&at, Which::ByPoisson, |c, f| gradient.physics.poisson_ratio += scale(c) * self.work(c, f, z));
            }
            if let Some(rest) = &mut gradient.changes.rest {
                for (m, c) in self.cells(at.index).iter().enumerate() {
                    self.add(c, -scale(c), self.turned(&at, m, c, at.pose.0, z), rest);
                }
            }
            for (effect, numbers) in gradient.physics.effects.iter_mut().enumerate().filter(|(e, _)| sought.effects[*e]) {
                for (slot, g) in numbers.iter_mut().enumerate() {
                    self.each_held(&at, [effect, slot], |c, f| *g += scale(c) * self.work(c, f, z));
                }
            }
        }
        if sought.start && self.moving() {
            for sign in [1.0, -1.0] {
                for at in self.instants(u1, sign * MOMENT) {
                    let scale = sign * at.weight * young / (2.0 * MOMENT);
                    self.each(&at, Which::Stiffness, |c, f| {
                        gradient.physics.start += scale * self.c.factor(c.cell as usize) * self.work(c, f, z);
                    });
                }
            }
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.force(u1, &mut out.supports);
    }
}
