//! The ghost penalty (Burman 2010): squared second differences of the displacement on the faces of cut cells, which bound the condition
//! number as a cell's inside goes to zero. Linear in u, and zero for rigid and affine motions.

use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_to_diagonal, zeros};
use crate::linear::matrix::Matrix;
use crate::linear::vector::dot;
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::body::Body;

/// Adds scale · Σ weight (u_a − 2u_b + u_c) of the ghost lines: the product with their matrix.
pub fn ghost_product(body: &Body, scale: f64, u: &[DVec3], out: &mut [DVec3]) {
    for g in body.ghosts() {
        let [a, b, c] = g.nodes.map(|n| n as usize);
        let s = scale * g.weight * (u[a] - 2.0 * u[b] + u[c]);
        out[a] += s;
        out[b] -= 2.0 * s;
        out[c] += s;
    }
}

/// a · (product with `b`) for a unit scale.
fn form(body: &Body, a: &[DVec3], b: &[DVec3]) -> f64 {
    let second = |u: &[DVec3], n: [usize; 3]| u[n[0]] - 2.0 * u[n[1]] + u[n[2]];
    let line = |g: &palpate_model::cutcells::domain::GhostLine| {
        let n = g.nodes.map(|n| n as usize);
        g.weight * second(a, n).dot(second(b, n))
    };
    body.ghosts().iter().map(line).sum()
}

/// The term.
pub struct Ghost<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

impl Ghost<'_> {
    /// Factor of the lines for a shear modulus [Pa]: energies per squared metre.
    fn scale(&self, shear: f64) -> f64 {
        self.c.plan.solver.ghost * self.c.plan.body.cut().grid.h * shear
    }

    fn own_scale(&self) -> f64 {
        self.scale(self.c.physics().youngs_modulus * self.c.elements.shear[0])
    }

    /// Factors of the new state, the past and the stress-free shape, for a unit scale.
    fn factors(&self) -> [f64; 3] {
        let w = &self.c.weights;
        [w.new + w.rate, w.old - w.rate, -(w.new + w.old)]
    }

    /// Adds the force for a scale.
    fn add(&self, scale: f64, u1: &[DVec3], out: &mut [DVec3]) {
        let (body, [new, old, rest]) = (&self.c.plan.body, self.factors());
        ghost_product(body, scale * new, u1, out);
        if old != 0.0 {
            ghost_product(body, scale * old, self.c.past.u, out);
        }
        if let Some(w) = &self.c.coefficients.changes.rest {
            ghost_product(body, scale * rest, w, out);
        }
    }

    /// z · force for a unit scale.
    fn work(&self, u1: &[DVec3], z: &[DVec3]) -> f64 {
        let (body, [new, old, rest]) = (&self.c.plan.body, self.factors());
        let mut w = new * form(body, z, u1);
        if old != 0.0 {
            w += old * form(body, z, self.c.past.u);
        }
        w + self.c.coefficients.changes.rest.as_ref().map_or(0.0, |r| rest * form(body, z, r))
    }
}

impl Term for Ghost<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.add(self.own_scale(), u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let (body, scale, [new, old, rest]) = (&self.c.plan.body, self.own_scale(), self.factors());
        // Quadratic in u₁, linear in the rest.
        let mut gu = zeros(u1.len());
        ghost_product(body, scale * new, u1, &mut gu);
        ghost_product(body, 2.0 * scale * old, self.c.past.u, &mut gu);
        if let Some(w) = &self.c.coefficients.changes.rest {
            ghost_product(body, 2.0 * scale * rest, w, &mut gu);
        }
        0.5 * dot(u1, &gu)
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        let scale = self.own_scale() * self.factors()[0];
        for (block, factor) in &self.c.places.ghosts {
            add_to_diagonal(&mut matrix.values[*block as usize], scale * factor);
        }
    }

    fn by_past(&self, _u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        let old = self.factors()[1];
        if old != 0.0 {
            ghost_product(&self.c.plan.body, self.own_scale() * old, change.u, out);
        }
    }

    fn by_past_transposed(&self, _u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        let old = self.factors()[1];
        if old != 0.0 {
            ghost_product(&self.c.plan.body, self.own_scale() * old, z, &mut out.u);
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (young, [shear, by_nu]) = (self.c.physics().youngs_modulus, self.c.elements.shear);
        let d = &rates.physics;
        let change = d.youngs_modulus * shear + d.poisson_ratio * young * by_nu;
        if change != 0.0 {
            self.add(self.scale(change), u1, out);
        }
        let damping = d.stiffness_damping * self.c.inertia.map_or(0.0, |t| t.rate);
        if damping != 0.0 {
            let scale = self.own_scale() * damping;
            ghost_product(&self.c.plan.body, scale, u1, out);
            ghost_product(&self.c.plan.body, -scale, self.c.past.u, out);
        }
        if let Some(dw) = &rates.changes.rest {
            ghost_product(&self.c.plan.body, self.own_scale() * self.factors()[2], dw, out);
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let (young, [shear, by_nu]) = (self.c.physics().youngs_modulus, self.c.elements.shear);
        if sought.modulus || sought.poisson {
            let work = self.work(u1, z);
            gradient.physics.youngs_modulus += self.scale(shear) * work;
            gradient.physics.poisson_ratio += self.scale(young * by_nu) * work;
        }
        if let (true, Some(t)) = (sought.damping[1], self.c.inertia) {
            let body = &self.c.plan.body;
            gradient.physics.stiffness_damping += self.own_scale() * t.rate * (form(body, z, u1) - form(body, z, self.c.past.u));
        }
        if let Some(rest) = &mut gradient.changes.rest {
            ghost_product(&self.c.plan.body, self.own_scale() * self.factors()[2], z, rest);
        }
    }

    fn forces(&self, _u1: &[DVec3], _out: &mut Forces) {
        // A penalty is no force that others are measured against.
    }
}
