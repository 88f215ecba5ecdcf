//! Clamps: Nitsche's forces on the held regions, as effects change them (compliance, slip, edge), with all their derivatives.
//!
//! A clamp wants its points at A X + b. Effects turn and move that pose, put a compliant layer between body and clamp and shift the edge
//! of what is held; a body whose stiffness varies is held as stiffly as it is itself, and one with another stress-free shape X + W is
//! held in that shape.

use crate::passes::cells::Matrices;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::corotation::{M24, V24, corners, flatten, multiply};
use palpate_model::cutcells::elements::Elements;
use palpate_model::params::changes::Changes;
use palpate_model::params::grips::{Grip, Grips, Pose};
use palpate_model::plan::{ClampCell, Physics, Plan, clamp_pose};
use palpate_model::space::body::Body;

/// A member's clamps.
#[derive(Clone, Copy)]
pub struct Clamps<'a> {
    /// The plan.
    pub plan: &'a Plan,
    /// The member's parameters.
    pub physics: &'a Physics,
    /// Matrices at the member's Poisson ratio.
    pub elements: &'a Elements,
    /// What effects change of the body.
    pub changes: &'a Changes,
    /// What effects change of every clamp; `None` where none acts on clamps.
    pub grips: Option<&'a [Grip]>,
}

/// Where a clamp cell's points are wanted, seen from the clamp: displacement W of the stress-free shape.
fn wanted(rest: Option<&[DVec3]>, node: u32) -> DVec3 {
    rest.map_or(DVec3::ZERO, |w| w[node as usize])
}

/// Displacement of a clamp cell's corners from where the clamp wants them, in the clamp's frame: Aᵀ(x − b) − X − W.
fn deviation(body: &Body, rest: Option<&[DVec3]>, c: &ClampCell, (a, b): Pose, u: &[DVec3]) -> V24 {
    flatten(&body.cells[c.cell as usize].nodes.map(|n| {
        let x = body.nodes[n as usize];
        a.transpose() * (x + u[n as usize] - b) - x - wanted(rest, n)
    }))
}

impl<'a> Clamps<'a> {
    /// Cells that clamp `index` holds.
    pub fn cells(&self, index: usize) -> &'a [ClampCell] {
        self.grips.map_or(&self.plan.clamps[index].cells, |g| &g[index].cells)
    }

    fn matrix(&self, index: usize, cell: usize, which: Matrices) -> &'a M24 {
        let m = &self.grips.map_or(&self.elements.clamps[index], |g| &g[index].matrices)[cell];
        match which {
            Matrices::Stiffness => &m.k,
            Matrices::ByPoisson => &m.k_nu,
        }
    }

    fn factor(&self, c: &ClampCell) -> f64 {
        self.changes.modulus.as_ref().map_or(1.0, |m| m[c.cell as usize])
    }

    /// Pose of clamp `index` at a time on the recording's clock, `elapsed` seconds after the start.
    pub fn pose(&self, index: usize, time: f64, elapsed: f64) -> Pose {
        if self.grips.is_none() {
            return clamp_pose(self.plan.clamps[index].motion.as_ref(), time);
        }
        Grips::new(self.plan, self.physics, elapsed).pose(index, time)
    }

    /// Adds the force of clamp `index` that stands in `pose`: A K (Aᵀ(x − b) − X − W), with matrices scaled by `young`.
    pub fn force(&self, index: usize, which: Matrices, pose: Pose, young: f64, u: &[DVec3], out: &mut [DVec3]) {
        let body = &self.plan.body;
        for (m, c) in self.cells(index).iter().enumerate() {
            let d = deviation(body, self.changes.rest.as_deref(), c, pose, u);
            let f = corners(&multiply(self.matrix(index, m, which), &d));
            self.add(c, pose.0, young * self.factor(c), f, out);
        }
    }

    fn add(&self, c: &ClampCell, turn: DMat3, scale: f64, f: [DVec3; 8], out: &mut [DVec3]) {
        let nodes = &self.plan.body.cells[c.cell as usize].nodes;
        for i in 0..8 {
            out[nodes[i] as usize] += scale * (turn * f[i]);
        }
    }

    /// Adds A K Aᵀ du of clamp `index`, with the matrices scaled by `young`.
    pub fn product(&self, index: usize, turn: DMat3, young: f64, du: &[DVec3], out: &mut [DVec3]) {
        for (m, c) in self.cells(index).iter().enumerate() {
            let nodes = &self.plan.body.cells[c.cell as usize].nodes;
            let d: [DVec3; 8] = nodes.map(|n| turn.transpose() * du[n as usize]);
            let f = corners(&multiply(self.matrix(index, m, Matrices::Stiffness), &flatten(&d)));
            self.add(c, turn, young * self.factor(c), f, out);
        }
    }

    /// Energy [J] of clamp `index`, for line searches.
    pub fn energy(&self, index: usize, pose: Pose, young: f64, u: &[DVec3]) -> f64 {
        let energy = |(m, c): (usize, &ClampCell)| {
            let d = deviation(&self.plan.body, self.changes.rest.as_deref(), c, pose, u);
            let f = multiply(self.matrix(index, m, Matrices::Stiffness), &d);
            0.5 * young * self.factor(c) * d.iter().zip(&f).map(|(d, f)| d * f).sum::<f64>()
        };
        self.cells(index).iter().enumerate().map(energy).sum()
    }

    /// Matrix of cell `m` of clamp `index` in the clamp's frame, for E = 1 Pa, and the factor on E; with `convex` one that is never negative.
    pub fn stiffness(&self, index: usize, m: usize, convex: bool) -> (&M24, f64) {
        let fallback = self.grips.filter(|_| convex).and_then(|grips| grips[index].convex.as_ref());
        let k = fallback.map_or_else(|| self.matrix(index, m, Matrices::Stiffness), |matrices| &matrices[m].k);
        (k, self.factor(&self.cells(index)[m]))
    }

    /// Adds the derivative of the force of clamp `index` by the stiffness of its cells, `slope` per cell of the body.
    pub fn modulus_column(&self, index: usize, slope: &[f64], pose: Pose, young: f64, u: &[DVec3], out: &mut [DVec3]) {
        let changes = Changes { modulus: Some(slope.to_vec()), rest: self.changes.rest.clone(), density: None };
        Clamps { changes: &changes, ..*self }.force(index, Matrices::Stiffness, pose, young, u, out);
    }

    /// Adds the derivative of the force of clamp `index` by a change `dw` [m] of the stress-free shape: −A K dw.
    pub fn rest_column(&self, index: usize, turn: DMat3, young: f64, dw: &[DVec3], out: &mut [DVec3]) {
        for (m, c) in self.cells(index).iter().enumerate() {
            let d = flatten(&self.plan.body.cells[c.cell as usize].nodes.map(|n| dw[n as usize]));
            let f = corners(&multiply(self.matrix(index, m, Matrices::Stiffness), &d));
            self.add(c, turn, -young * self.factor(c), f, out);
        }
    }

    /// Adds the derivative of the force of clamp `index` by number `slot` of effect `effect`; nothing for effects that leave clamps alone.
    pub fn hold_column(
        &self,
        index: usize,
        [effect, slot]: [usize; 2],
        [time, elapsed]: [f64; 2],
        young: f64,
        u: &[DVec3],
        out: &mut [DVec3],
    ) {
        let (plan, grips) = (self.plan, Grips::new(self.plan, self.physics, elapsed));
        let pose = grips.pose(index, time);
        let Some(own) = self.grips.map(|g| &g[index]) else { return };
        let Some(change) = own.matrix_slopes(&grips, self.elements.nu, [effect, slot]) else { return };
        let moves = grips.pose_slope(index, time, effect, slot);
        for (m, c) in own.cells.iter().enumerate() {
            let (nodes, scale) = (&plan.body.cells[c.cell as usize].nodes, young * self.factor(c));
            let d = deviation(&plan.body, self.changes.rest.as_deref(), c, pose, u);
            if let Some((da, db)) = moves {
                let k = self.matrix(index, m, Matrices::Stiffness);
                // The pose: dA K d + A K (dAᵀ(x − b) − Aᵀ db).
                let moved = nodes
                    .map(|n| da.transpose() * (plan.body.nodes[n as usize] + u[n as usize] - pose.1) - pose.0.transpose() * db);
                self.add(c, da, scale, corners(&multiply(k, &d)), out);
                self.add(c, pose.0, scale, corners(&multiply(k, &flatten(&moved))), out);
            }
            // The matrix: factor, layer and edge.
            if let Some(change) = change(m) {
                self.add(c, pose.0, scale, corners(&multiply(&change, &d)), out);
            }
        }
    }
}
