//! Nodes that clamps hold, of bodies without cells: a stiff spring draws each to where its clamp wants it, A (X + W) + b, where W is the
//! displacement of the stress-free shape. The stiffness is the
//! plan's and no parameter, but for a layer of thickness ℓ that gives way ([`palpate_model::effects`], "compliant-clamp"): the layer is in series with
//! the spring, S/ℓ with S = (λ + 2μ) times the area that the node stands for. Effects move what is wanted as they move the clamps of cells.

use super::products::{Part, Parts};
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_to_diagonal};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::params::changes::{hold, hold_slope};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::params::grips::{Grips, Pose, acted};
use palpate_model::plan::clamp_pose;

/// The prescribed motion is a smooth curve: central differences over a microsecond leave about 1e-10 of its derivative by time.
const MOMENT: f64 = 1e-6;

/// The term.
pub struct HeldNodes<'a> {
    c: Context<'a>,
    /// The clamps where effects act on them.
    grips: Option<Grips<'a>>,
    /// Thickness of the layer [m].
    layer: f64,
    /// (λ + 2μ) [Pa], and its derivative by Poisson's ratio over itself.
    firm: (f64, f64),
}

/// A held node.
#[derive(Clone, Copy)]
struct Held {
    clamp: usize,
    node: usize,
    /// Rest position [m].
    rest: DVec3,
    /// The same in the stress-free shape, which is what a clamp holds [m].
    whole: DVec3,
    /// Of the spring with its layer [N/m], and its derivatives by the layer's thickness and by the logarithm of S.
    stiffness: f64,
    by_layer: f64,
    by_firm: f64,
}

impl<'a> HeldNodes<'a> {
    /// The clamps at the new state.
    pub fn new(c: Context<'a>) -> HeldNodes<'a> {
        let (plan, physics) = (c.plan, c.physics());
        let grips = acted(plan).then(|| Grips::new(plan, physics, c.time - physics.start));
        let layer = grips.map_or(0.0, |g| hold(plan, physics, &g.spot)[1]);
        let [(lambda, mu), (lambda_nu, mu_nu)] = [lame(1.0, physics.poisson_ratio), lame_by_nu(1.0, physics.poisson_ratio)];
        let whole = lambda + 2.0 * mu;
        HeldNodes { c, grips, layer, firm: (c.young() * whole, (lambda_nu + 2.0 * mu_nu) / whole) }
    }

    /// Every held node, clamp by clamp.
    fn held(&self) -> impl Iterator<Item = Held> + '_ {
        let of = move |(i, clamp): (usize, &'a palpate_model::plan::ClampSite)| {
            clamp.nodes.iter().zip(&clamp.areas).map(move |((n, k), area)| (i, *n as usize, *k, *area))
        };
        self.c.plan.clamps.iter().enumerate().flat_map(of).map(|(clamp, node, k, area)| {
            let rest = self.c.plan.body.nodes[node];
            let whole = rest + self.c.coefficients.changes.rest.as_ref().map_or(DVec3::ZERO, |w| w[node]);
            if self.grips.is_none() {
                return Held { clamp, node, rest, whole, stiffness: k, by_layer: 0.0, by_firm: 0.0 };
            }
            // k S/(S + k ℓ).
            let s = self.firm.0 * area;
            let sum = s + k * self.layer;
            Held {
                clamp,
                node,
                rest,
                whole,
                stiffness: k * s / sum,
                by_layer: -k * k * s / (sum * sum),
                by_firm: k * k * self.layer * s / (sum * sum),
            }
        })
    }

    /// Where clamps want what they hold at a time on the recording's clock, A and b.
    fn poses(&self, time: f64) -> Vec<Pose> {
        let pose = |i: usize| match &self.grips {
            Some(grips) => grips.pose(i, time),
            None => clamp_pose(self.c.plan.clamps[i].motion.as_ref(), time),
        };
        (0..self.c.plan.clamps.len()).map(pose).collect()
    }

    /// Every held node with its way to where it is wanted, backwards [m].
    fn away<'b>(&'b self, u1: &'b [DVec3]) -> impl Iterator<Item = (Held, DVec3)> + 'b {
        let poses = self.poses(self.c.time);
        self.held().map(move |h| {
            let (a, b) = poses[h.clamp];
            (h, h.rest + u1[h.node] - (a * h.whole + b))
        })
    }

    /// Minus the force's derivative by time at every held node: the velocity of what is wanted, times the stiffness.
    fn moves(&self, mut visit: impl FnMut(usize, DVec3)) {
        for sign in [1.0, -1.0] {
            let poses = self.poses(self.c.time + sign * MOMENT);
            for h in self.held() {
                let (a, b) = poses[h.clamp];
                visit(h.node, sign * h.stiffness / (2.0 * MOMENT) * (a * h.whole + b));
            }
        }
    }

    /// Change of the force at every held node with number `slot` of an effect; nothing for effects that leave clamps alone.
    fn by_number(&self, u1: &[DVec3], effect: usize, slot: usize, mut visit: impl FnMut(usize, DVec3)) {
        let Some(grips) = &self.grips else { return };
        let Some(slope) = hold_slope(self.c.plan, self.c.physics(), &grips.spot, effect, slot) else { return };
        let poses: Vec<Option<Pose>> =
            (0..self.c.plan.clamps.len()).map(|i| grips.pose_slope(i, self.c.time, effect, slot)).collect();
        for (h, away) in self.away(u1) {
            let moved = poses[h.clamp].map_or(DVec3::ZERO, |(a, b)| a * h.whole + b);
            visit(h.node, slope[1] * h.by_layer * away - h.stiffness * moved);
        }
    }

    /// Change of the force at every held node with the logarithm of S.
    fn by_firm(&self, u1: &[DVec3], mut visit: impl FnMut(usize, DVec3)) {
        if self.layer != 0.0 {
            self.away(u1).for_each(|(h, away)| visit(h.node, h.by_firm * away));
        }
    }

    /// A of every held node's clamp, times the stiffness: minus the force's derivative by the stress-free shape there.
    fn by_rest(&self, mut visit: impl FnMut(usize, DMat3)) {
        let poses = self.poses(self.c.time);
        self.held().for_each(|h| visit(h.node, poses[h.clamp].0 * h.stiffness));
    }

    /// Numbers of all effects: effect and slot.
    fn numbers(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.c.physics().effects.iter().enumerate().flat_map(|(e, p)| (0..p.len()).map(move |slot| (e, slot)))
    }
}

/// Nodes and the stiffness of their springs [N/m].
struct Springs(Vec<(usize, f64)>);

impl Part for Springs {
    fn add(&self, x: &[DVec3], y: &mut [DVec3]) {
        self.0.iter().for_each(|(n, k)| y[*n] += *k * x[*n]);
    }
}

impl Term for HeldNodes<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.away(u1).for_each(|(h, away)| out[h.node] += h.stiffness * away);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        self.away(u1).map(|(h, away)| 0.5 * h.stiffness * away.length_squared()).sum()
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        let diagonal = &self.c.pattern.blocks.diagonal;
        self.held().for_each(|h| add_to_diagonal(&mut matrix.values[diagonal[h.node]], h.stiffness));
    }

    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        Parts::Free(Box::new(Springs(self.held().map(|h| (h.node, h.stiffness)).collect())))
    }

    fn by_past(&self, _u1: &[DVec3], _change: &PastChange, _out: &mut [DVec3]) {
        // What is held follows its clamp at the new state alone.
    }

    fn by_past_transposed(&self, _u1: &[DVec3], _z: &[DVec3], _out: &mut PastGradient) {}

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let d = &rates.physics;
        if d.start != 0.0 {
            self.moves(|n, v| out[n] -= d.start * v);
        }
        for (effect, slot) in self.numbers().filter(|(e, slot)| d.effects[*e][*slot] != 0.0) {
            self.by_number(u1, effect, slot, |n, f| out[n] += d.effects[effect][slot] * f);
        }
        if let Some(dw) = &rates.changes.rest {
            self.by_rest(|n, a| out[n] -= a * dw[n]);
        }
        let firmer = self.c.ln_young_along(rates) + self.firm.1 * d.poisson_ratio;
        if firmer != 0.0 {
            self.by_firm(u1, |n, f| out[n] += firmer * f);
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        if sought.start {
            self.moves(|n, v| gradient.physics.start -= z[n].dot(v));
        }
        for (effect, slot) in self.numbers().filter(|(e, _)| sought.effects[*e]) {
            self.by_number(u1, effect, slot, |n, f| gradient.physics.effects[effect][slot] += z[n].dot(f));
        }
        if let Some(rest) = &mut gradient.changes.rest {
            self.by_rest(|n, a| rest[n] -= a.transpose() * z[n]);
        }
        if sought.modulus || sought.poisson {
            let mut firmer = 0.0;
            self.by_firm(u1, |n, f| firmer += z[n].dot(f));
            gradient.physics.poisson_ratio += self.firm.1 * firmer;
            self.c.pull_young(firmer, gradient);
        }
    }

    fn forces(&self, _u1: &[DVec3], _out: &mut Forces) {
        // As large as the springs are stiff, which says nothing of the forces that the body bears.
    }
}
