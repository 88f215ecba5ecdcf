//! What draws the body: a function of the displacement with a gradient and a positive semidefinite curvature.

use crate::costs::{Along, Compared, Look};
use crate::linear::vector::Nodes;
use crate::world::{Member, Shared};
use glam::DVec3;
use palpate_engine::tracking::Share;
use palpate_model::observation::ReadingKind;
use palpate_model::space::body::Body;

/// A cost D, linearised at one displacement.
pub trait Pulls {
    /// D(u), up to a constant.
    fn value(&self, u: &[DVec3]) -> f64;
    /// dD/du at the displacement of the linearisation [1/m].
    fn gradient(&self) -> Nodes;
    /// JᵀWJ v.
    fn product(&self, v: &[DVec3]) -> Nodes;
}

/// The cost of a fit.
pub struct ByCost<'a> {
    shared: &'a Shared,
    member: &'a Member,
    compared: Compared,
}

impl<'a> ByCost<'a> {
    pub fn new(shared: &'a Shared, member: &'a Member, frame: usize, u: &[DVec3]) -> ByCost<'a> {
        ByCost { shared, member, compared: member.compare(shared, frame, u.to_vec()) }
    }

    fn look(&self) -> Look<'a> {
        self.member.look(self.shared, self.compared.frame)
    }

    /// Effects on the measurement have derivatives as well, which nobody asks for here.
    fn aside(&self) -> Vec<f64> {
        vec![0.0; self.member.theta.len()]
    }
}

impl Pulls for ByCost<'_> {
    fn value(&self, u: &[DVec3]) -> f64 {
        self.member.compare(self.shared, self.compared.frame, u.to_vec()).sums.cost
    }

    fn gradient(&self) -> Nodes {
        self.compared.gradient(self.look(), 1.0, &mut self.aside())
    }

    fn product(&self, v: &[DVec3]) -> Nodes {
        let du = [v.to_vec()];
        self.compared.product(self.look(), Along { directions: &[], du: &du }, 1.0, &mut self.aside())
    }
}

/// The upper bound that the mixture's shares make of its cost: `½ Σ_k P_k |s_k(u) − Q_k/P_k|²/σ²` with the noise σ of a reading. The
/// spread decides who belongs to whom, the noise what that weighs: with the spread for both a stiff body keeps it wide, and wide it pulls weakly.
pub struct ByMixture<'a> {
    body: &'a Body,
    /// Places with a share, P_k/σ², and where they are drawn to.
    drawn: Vec<(usize, f64, DVec3)>,
    at: Vec<DVec3>,
}

impl<'a> ByMixture<'a> {
    pub fn new(body: &'a Body, shares: &[Share], look: Look, u: &[DVec3]) -> ByMixture<'a> {
        let noise = look.observation.noise(ReadingKind::Depth);
        let some = |(k, s): (usize, &Share)| (s.0 > 0.0).then(|| (k, s.0 / (noise * noise), s.1 / s.0));
        ByMixture { body, drawn: shares.iter().enumerate().filter_map(some).collect(), at: u.to_vec() }
    }

    fn away(&self, u: &[DVec3], k: usize, goal: DVec3) -> DVec3 {
        self.body.patches[k].point + self.body.surface.get(k).at(u) - goal
    }

    fn spread(&self, force: impl Fn(usize, DVec3) -> DVec3) -> Nodes {
        let mut out = vec![DVec3::ZERO; self.body.nodes.len()];
        for (k, weight, goal) in &self.drawn {
            self.body.surface.get(*k).spread(*weight * force(*k, *goal), &mut out);
        }
        out
    }
}

impl Pulls for ByMixture<'_> {
    fn value(&self, u: &[DVec3]) -> f64 {
        self.drawn.iter().map(|(k, weight, goal)| 0.5 * weight * self.away(u, *k, *goal).length_squared()).sum()
    }

    fn gradient(&self) -> Nodes {
        self.spread(|k, goal| self.away(&self.at, k, goal))
    }

    fn product(&self, v: &[DVec3]) -> Nodes {
        self.spread(|k, _| self.body.surface.get(k).at(v))
    }
}
