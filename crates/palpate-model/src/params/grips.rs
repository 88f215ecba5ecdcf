//! How effects make clamps hold: pose and matrices of a member's clamps with their derivatives, for every backend.
//!
//! The numbers of [`crate::params::changes::HOLD`] turn and move the pose of a clamp and put a compliant layer between body and clamp; a shift
//! of its edge makes it hold other cells ([`crate::cutcells::clamp_edge`]).

use crate::cutcells::clamp_edge::{self, Held};
use crate::cutcells::corotation::M24;
use crate::cutcells::element::CellMatrices;
use crate::cutcells::elements::{Elements, cell_matrices, clamp_matrices, layer_matrix, layered};
use crate::effects::field::Spot;
use crate::effects::{Law, Site};
use crate::params::changes::{self, HOLD};
use crate::plan::{ClampCell, ClampSite, Physics, Plan, clamp_pose};
use glam::{DMat3, DVec3};

/// Rotation and translation of a clamp: a point X is wanted at A X + b.
pub type Pose = (DMat3, DVec3);

/// Rotation of Cayley's vector r and its derivatives by the three components: (1 − r²/4) I + ½ r rᵀ + \[r\]×, over 1 + r²/4.
fn cayley(r: DVec3) -> (DMat3, [DMat3; 3]) {
    let cross = crate::mechanics::rotation::cross_matrix;
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
    matches!(law.site, Site::Clamps(_) | Site::Edges(_))
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

    /// Matrices of a held cell with the layer that effects put in (constant in time), from those without.
    fn layered(&self, c: &ClampCell, cell: &CellMatrices, nu: f64) -> CellMatrices {
        let hold = changes::hold(self.plan, self.physics, &self.spot);
        let [k3, k3_nu] = self.layer(c, nu);
        let make = |k: &M24, k3: &M24| Box::new(layered(k, k3, self.plan.body.cut().grid.h, hold[1], false).map(|v| hold[0] * v));
        CellMatrices { k: make(&cell.k, &k3), k_nu: make(&cell.k_nu, &k3_nu) }
    }

    /// Derivative of the stiffness in [`Grips::layered`] by number `slot` of effect `effect`; `None` where there is none.
    fn layered_slope(&self, c: &ClampCell, k: &M24, nu: f64, [effect, slot]: [usize; 2]) -> Option<Box<M24>> {
        let slope = changes::hold_slope(self.plan, self.physics, &self.spot, effect, slot)?;
        if slope[0] == 0.0 && slope[1] == 0.0 {
            return None;
        }
        let (hold, h) = (changes::hold(self.plan, self.physics, &self.spot), self.plan.body.cut().grid.h);
        let [k3, _] = self.layer(c, nu);
        let (own, by_layer) = (layered(k, &k3, h, hold[1], false), layered(k, &k3, h, hold[1], true));
        Some(Box::new(std::array::from_fn(|i| slope[0] * own[i] + hold[0] * slope[1] * by_layer[i])))
    }

    fn layer(&self, c: &ClampCell, nu: f64) -> [Box<M24>; 2] {
        layer_matrix(c, c.free(&self.plan.body).fraction, nu)
    }
}

/// One clamp of one member, cell by cell.
#[derive(Debug)]
pub struct Grip {
    /// What is held, in increasing order of cells.
    pub cells: Vec<ClampCell>,
    /// Matrices of the cells, layer included.
    pub matrices: Vec<CellMatrices>,
    /// Where the edge is shifted, those without what that frees or takes of the cells' own stiffness: never negative.
    pub convex: Option<Vec<CellMatrices>>,
    /// Those without layer.
    stiff: Vec<CellMatrices>,
    /// Derivative of the stiffness by the shift of the edge [1/m]; `None` away from the edge.
    by_edge: Vec<Option<Box<M24>>>,
}

impl Grip {
    /// Every clamp with the layers that effects put in and the edges that they shift, or `None` when no effect acts on clamps.
    /// `elements` are those at the member's Poisson's ratio.
    pub fn all(plan: &Plan, physics: &Physics, elements: &Elements) -> Option<Vec<Grip>> {
        let shift = changes::edge(plan, physics);
        let grips = Grips::new(plan, physics, 0.0);
        acted(plan).then(|| (0..plan.clamps.len()).map(|i| grips.grip(i, shift, elements)).collect())
    }

    /// Derivative of the stiffness by number `slot` of effect `effect`, as a function of the held cell's number, `None` where a cell has
    /// none; `None` altogether for effects that leave clamps alone.
    pub fn matrix_slopes<'a>(
        &'a self,
        grips: &'a Grips,
        nu: f64,
        [effect, slot]: [usize; 2],
    ) -> Option<impl Fn(usize) -> Option<Box<M24>> + 'a> {
        let edge = changes::edge_slope(grips.plan, grips.physics, effect, slot);
        let acts = edge.is_some() || changes::hold_slope(grips.plan, grips.physics, &grips.spot, effect, slot).is_some();
        acts.then_some(move |m: usize| match edge {
            Some(slope) => self.by_edge[m].as_ref().map(|k| Box::new(k.map(|v| slope * v))),
            None => grips.layered_slope(&self.cells[m], &self.stiff[m].k, nu, [effect, slot]),
        })
    }
}

impl Grips<'_> {
    fn grip(&self, index: usize, shift: Option<f64>, elements: &Elements) -> Grip {
        let (clamp, body, nu) = (&self.plan.clamps[index], &self.plan.body, elements.nu);
        let held = match shift {
            Some(shift) => clamp.edge.cells(body, &clamp.cells, shift),
            None => clamp.cells.iter().map(|c| Held { now: c.clone(), near: None }).collect(),
        };
        let stiff: Vec<CellMatrices> = match shift {
            Some(_) => held.iter().map(|h| clamp_matrices(body, &h.now, nu)).collect(),
            None => elements.clamps[index].clone(),
        };
        let whole = |c: &ClampCell, stiff: &CellMatrices| {
            let mut m = self.layered(c, stiff, nu);
            if shift.is_some() {
                self.add_freed(clamp, c, elements, &mut m);
            }
            m
        };
        let matrices: Vec<CellMatrices> = held.iter().zip(&stiff).map(|(h, k)| whole(&h.now, k)).collect();
        let by_edge = |(held, now): (&Held, &CellMatrices)| {
            let (further, step) = held.near.as_ref()?;
            let [next, second] = [0, 1].map(|i| whole(&further[i], &clamp_matrices(body, &further[i], nu)).k);
            Some(Box::new(std::array::from_fn(|i| clamp_edge::slope(now.k[i], next[i], second[i], *step))))
        };
        let by_edge = held.iter().zip(&matrices).map(by_edge).collect();
        let convex = shift.map(|_| held.iter().zip(&stiff).map(|(h, k)| self.layered(&h.now, k, nu)).collect());
        Grip { convex, cells: held.into_iter().map(|h| h.now).collect(), matrices, stiff, by_edge }
    }
}

impl Grips<'_> {
    /// Adds what a shifted edge frees of a cell, or takes from it: the matrix of what is free now minus that of what the plan's own edge leaves
    /// free. Elastic forces turn with the cell, these with the clamp; at an edge both turn alike.
    fn add_freed(&self, clamp: &ClampSite, c: &ClampCell, elements: &Elements, m: &mut CellMatrices) {
        if ClampCell::find(&clamp.cells, c.cell).is_some_and(|s| s.held == c.held) {
            return;
        }
        let now = cell_matrices(self.plan, &c.free(&self.plan.body), elements.nu);
        let own = elements.cell(c.cell as usize);
        let taken = |own: &M24, now: &M24, i: usize| (0..3).map(|r| own[25 * (3 * i + r)] - now[25 * (3 * i + r)]).sum::<f64>();
        // A cell that turns a little against the clamp leaves a remainder of either sign. Pinned nodes are held against it as firmly as the
        // cell did: the volume of a sliver alone would hold them too softly.
        let firm: [bool; 8] = std::array::from_fn(|i| taken(&own.k, &now.k, i) > 0.0);
        for (sum, [now, own]) in [(&mut m.k, [&now.k, &own.k]), (&mut m.k_nu, [&now.k_nu, &own.k_nu])] {
            for (s, (now, own)) in sum.iter_mut().zip(now.iter().zip(own.iter())) {
                *s += now - own;
            }
            for (i, pin) in c.pins.iter().enumerate().filter(|(i, _)| firm[*i]) {
                let each = pin * taken(own, now, i) / 3.0;
                (0..3).for_each(|r| sum[25 * (3 * i + r)] += each);
            }
        }
    }
}

/// Cells that a clamp holds at some shift of its edge within the bounds of the effects that shift it, in increasing order; those that it
/// holds as stated where no effect does.
pub fn within_reach(plan: &Plan, clamp: &ClampSite) -> Vec<u32> {
    match changes::furthest_edge(plan) {
        Some(shift) => clamp.edge.cells(&plan.body, &clamp.cells, shift).iter().map(|h| h.now.cell).collect(),
        None => clamp.cells.iter().map(|c| c.cell).collect(),
    }
}
