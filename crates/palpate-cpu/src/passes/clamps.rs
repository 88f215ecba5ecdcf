//! Clamps: Nitsche's forces on the held regions, as effects change them (compliance, slip), with all their derivatives.
//!
//! A clamp wants its points at A X + b. Effects turn and move that pose and put a compliant layer between body and clamp; a body
//! whose stiffness varies is held as stiffly as it is itself, and one with another stress-free shape X + W is held in that shape.

use crate::passes::cells::Matrices;
use glam::{DMat3, DVec3};
use palpate_model::body::Body;
use palpate_model::changes::{self, Changes, HOLD};
use palpate_model::corotation::{M24, V24, corners, flatten, multiply};
use palpate_model::effects::Site;
use palpate_model::effects::field::Spot;
use palpate_model::element::CellMatrices;
use palpate_model::elements::{Elements, layer_matrix, layered};
use palpate_model::plan::{ClampCell, Physics, Plan, clamp_pose};

/// Rotation and translation of a clamp.
pub type Pose = (DMat3, DVec3);

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
    /// Matrices changed by effects; `None` where none acts on clamps.
    pub grips: Option<&'a [Vec<CellMatrices>]>,
}

/// Rotation of Cayley's vector r and its derivatives by the three components: (1 − r²/4) I + ½ r rᵀ + \[r\]×, over 1 + r²/4.
fn cayley(r: DVec3) -> (DMat3, [DMat3; 3]) {
    let cross = palpate_model::rotation::cross_matrix;
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

/// Matrices of every clamp cell with the layers that effects put in, or `None` when no effect acts on clamps.
pub fn grips(plan: &Plan, physics: &Physics, elements: &Elements) -> Option<Vec<Vec<CellMatrices>>> {
    if !plan.layout.effects().any(|(law, _)| matches!(law.site, Site::Clamps(_))) {
        return None;
    }
    let h = plan.body.grid.h;
    let hold = changes::hold(plan, physics, &Spot::of(plan));
    let of = |i: usize, m: usize, c: &ClampCell| {
        let cell = &elements.clamps[i][m];
        let [k3, k3_nu] = layer_matrix(c, plan.body.cells[c.cell as usize].fraction, elements.nu);
        let make = |k: &M24, k3: &M24| Box::new(layered(k, k3, h, hold[1], false).map(|v| hold[0] * v));
        CellMatrices { k: make(&cell.k, &k3), k_nu: make(&cell.k_nu, &k3_nu) }
    };
    let all = plan.clamps.iter().enumerate();
    Some(all.map(|(i, clamp)| clamp.cells.iter().enumerate().map(|(m, c)| of(i, m, c)).collect()).collect())
}

impl Clamps<'_> {
    fn matrix(&self, index: usize, cell: usize, which: Matrices) -> &M24 {
        let m = &self.grips.unwrap_or(&self.elements.clamps)[index][cell];
        match which {
            Matrices::Stiffness => &m.k,
            Matrices::ByPoisson => &m.k_nu,
        }
    }

    fn factor(&self, c: &ClampCell) -> f64 {
        self.changes.modulus.as_ref().map_or(1.0, |m| m[c.cell as usize])
    }

    fn hold(&self, elapsed: f64) -> [f64; HOLD] {
        changes::hold(self.plan, self.physics, &Spot { elapsed, ..Spot::of(self.plan) })
    }

    /// Pose of clamp `index` at a time on the recording's clock, `elapsed` seconds after the start.
    pub fn pose(&self, index: usize, time: f64, elapsed: f64) -> Pose {
        let (a, b) = clamp_pose(self.plan.clamps[index].motion.as_ref(), time);
        if self.grips.is_none() {
            return (a, b);
        }
        let (hold, c) = (self.hold(elapsed), Spot::of(self.plan).anchor);
        let turn = cayley(three(&hold, 5)).0;
        (a * turn, b + a * (c + three(&hold, 2) - turn * c))
    }

    /// Adds the force of clamp `index` that stands in `pose`: A K (Aᵀ(x − b) − X − W), with matrices scaled by `young`.
    pub fn force(&self, index: usize, which: Matrices, pose: Pose, young: f64, u: &[DVec3], out: &mut [DVec3]) {
        let body = &self.plan.body;
        for (m, c) in self.plan.clamps[index].cells.iter().enumerate() {
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
        for (m, c) in self.plan.clamps[index].cells.iter().enumerate() {
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
        self.plan.clamps[index].cells.iter().enumerate().map(energy).sum()
    }

    /// Matrix of cell `m` of clamp `index` in the clamp's frame, for E = 1 Pa, and the factor on E.
    pub fn stiffness(&self, index: usize, m: usize) -> (&M24, f64) {
        (self.matrix(index, m, Matrices::Stiffness), self.factor(&self.plan.clamps[index].cells[m]))
    }

    /// Adds the derivative of the force of clamp `index` by the stiffness of its cells, `slope` per cell of the body.
    pub fn modulus_column(&self, index: usize, slope: &[f64], pose: Pose, young: f64, u: &[DVec3], out: &mut [DVec3]) {
        let changes = Changes { modulus: Some(slope.to_vec()), rest: self.changes.rest.clone(), density: None };
        Clamps { changes: &changes, ..*self }.force(index, Matrices::Stiffness, pose, young, u, out);
    }

    /// Adds the derivative of the force of clamp `index` by a change `dw` [m] of the stress-free shape: −A K dw.
    pub fn rest_column(&self, index: usize, turn: DMat3, young: f64, dw: &[DVec3], out: &mut [DVec3]) {
        for (m, c) in self.plan.clamps[index].cells.iter().enumerate() {
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
        let (plan, h) = (self.plan, self.plan.body.grid.h);
        let spot = Spot { elapsed, ..Spot::of(plan) };
        let Some(slope) = changes::hold_slope(plan, self.physics, &spot, effect, slot) else { return };
        let hold = self.hold(elapsed);
        let pose = self.pose(index, time, elapsed);
        let (a, _) = clamp_pose(plan.clamps[index].motion.as_ref(), time);
        let turns = cayley(three(&hold, 5)).1;
        let dr = three(&slope, 5);
        let turn = turns[0] * dr.x + turns[1] * dr.y + turns[2] * dr.z;
        let (da, db) = (a * turn, a * (three(&slope, 2) - turn * spot.anchor));
        for (m, c) in plan.clamps[index].cells.iter().enumerate() {
            let (nodes, scale) = (&plan.body.cells[c.cell as usize].nodes, young * self.factor(c));
            let d = deviation(&plan.body, self.changes.rest.as_deref(), c, pose, u);
            let k = self.matrix(index, m, Matrices::Stiffness);
            // The pose: dA K d + A K (dAᵀ(x − b) − Aᵀ db).
            let moved =
                nodes.map(|n| da.transpose() * (plan.body.nodes[n as usize] + u[n as usize] - pose.1) - pose.0.transpose() * db);
            self.add(c, da, scale, corners(&multiply(k, &d)), out);
            self.add(c, pose.0, scale, corners(&multiply(k, &flatten(&moved))), out);
            // The matrix: factor and layer.
            if slope[0] != 0.0 || slope[1] != 0.0 {
                let [k3, _] = layer_matrix(c, plan.body.cells[c.cell as usize].fraction, self.elements.nu);
                let by_layer = layered(&self.elements.clamps[index][m].k, &k3, h, hold[1], true);
                let change: M24 = std::array::from_fn(|i| k[i] * slope[0] / hold[0] + hold[0] * slope[1] * by_layer[i]);
                self.add(c, pose.0, scale, corners(&multiply(&change, &d)), out);
            }
        }
    }
}
