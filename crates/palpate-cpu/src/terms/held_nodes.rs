//! Nodes that clamps hold, of bodies without cells: a stiff spring draws each to where its clamp wants it, A X + b. The stiffness is the
//! plan's and no parameter.

use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_to_diagonal};
use crate::linear::matrix::Matrix;
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::clamp_pose;

/// The prescribed motion is a smooth curve: central differences over a microsecond leave about 1e-10 of its derivative by time.
const MOMENT: f64 = 1e-6;

/// The term.
pub struct HeldNodes<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

impl HeldNodes<'_> {
    /// Hands every held node to `visit`: number, stiffness, and where it is wanted at a time on the recording's clock [m].
    fn each(&self, time: f64, mut visit: impl FnMut(usize, f64, DVec3)) {
        for clamp in &self.c.plan.clamps {
            let (a, b) = clamp_pose(clamp.motion.as_ref(), time);
            for (n, stiffness) in &clamp.nodes {
                let n = *n as usize;
                visit(n, *stiffness, a * self.c.plan.body.nodes[n] + b);
            }
        }
    }

    /// Adds the springs' forces at the new state.
    fn force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        self.each(self.c.time, |n, k, wanted| out[n] += k * (self.c.plan.body.nodes[n] + u1[n] - wanted));
    }

    /// Velocity of the place where a node is wanted, times its stiffness: minus the force's derivative by time.
    fn moves(&self, mut visit: impl FnMut(usize, DVec3)) {
        for sign in [1.0, -1.0] {
            self.each(self.c.time + sign * MOMENT, |n, k, wanted| visit(n, sign * k / (2.0 * MOMENT) * wanted));
        }
    }
}

impl Term for HeldNodes<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let mut w = 0.0;
        self.each(self.c.time, |n, k, wanted| w += 0.5 * k * (self.c.plan.body.nodes[n] + u1[n] - wanted).length_squared());
        w
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        let diagonal = &self.c.pattern.blocks.diagonal;
        self.each(self.c.time, |n, k, _| add_to_diagonal(&mut matrix.values[diagonal[n]], k));
    }

    fn by_past(&self, _u1: &[DVec3], _change: &PastChange, _out: &mut [DVec3]) {
        // What is held follows its clamp at the new state alone.
    }

    fn by_past_transposed(&self, _u1: &[DVec3], _z: &[DVec3], _out: &mut PastGradient) {}

    fn by_coefficients(&self, _u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        if rates.physics.start != 0.0 {
            self.moves(|n, v| out[n] -= rates.physics.start * v);
        }
    }

    fn by_coefficients_transposed(&self, _u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        if sought.start {
            self.moves(|n, v| gradient.physics.start -= z[n].dot(v));
        }
    }

    fn forces(&self, _u1: &[DVec3], _out: &mut Forces) {
        // As large as the springs are stiff, which says nothing of the forces that the body bears.
    }
}
