//! Inertia of nodes and point masses, damping in proportion to mass, and weight. Cells have lumped masses; tetrahedra have the whole matrix
//! (`Consistent`).

use super::consistent::{Consistent, add_product};
use super::products::Parts;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_to_diagonal, zeros};
use crate::linear::matrix::Matrix;
use crate::linear::vector::dot;
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};
use rayon::prelude::*;

/// Blocks that one task adds to at least.
const BLOCKS: usize = 4096;

/// The term.
pub struct Inertia<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

/// Mass of every node [kg], point masses left out.
pub(crate) fn masses<'a>(c: &Context<'a>) -> impl Iterator<Item = f64> + 'a {
    let c = *c;
    c.plan.body.node_volume.iter().enumerate().map(move |(i, v)| density(&c, i) * v)
}

/// Density [kg/m³] around a node.
fn density(c: &Context, node: usize) -> f64 {
    c.physics().density * c.coefficients.changes.density.as_ref().map_or(1.0, |d| d[node])
}

/// Sum of the diagonal of the mass matrix [kg], point masses left out.
pub(crate) fn diagonal(c: &Context) -> f64 {
    match c.plan.body.cut {
        Some(_) => masses(c).sum(),
        None => c.pattern.blocks.diagonal.iter().map(|k| c.masses[*k]).sum(),
    }
}

impl<'a> Inertia<'a> {
    /// The mass matrix, element by element, where it is none of numbers on nodes.
    fn consistent(&self) -> Option<Consistent<'a>> {
        self.c.plan.body.cut.is_none().then(|| Consistent::new(self.c.plan, self.c.coefficients))
    }

    /// Adds M a for accelerations a(node) of the body and of the point masses.
    fn add(&self, body: impl Fn(usize) -> DVec3 + Sync, points: impl Fn(usize) -> DVec3, out: &mut [DVec3]) {
        match self.c.plan.body.cut {
            None => add_product(self.c.pattern, self.c.masses, body, out),
            Some(_) => {
                for (i, v) in self.c.plan.body.node_volume.iter().enumerate() {
                    out[i] += density(&self.c, i) * v * body(i);
                }
            }
        }
        self.add_points(&self.c.physics().masses, points, out);
    }

    /// Adds m a of the point masses, for masses `m`.
    fn add_points(&self, m: &[f64], a: impl Fn(usize) -> DVec3, out: &mut [DVec3]) {
        for (site, m) in self.c.plan.masses.iter().zip(m) {
            let mean: DVec3 = site.nodes.iter().zip(site.value).map(|(n, w)| *w * a(*n as usize)).sum();
            site.spread(*m * mean, out);
        }
    }

    /// Acceleration against gravity that forces must bring about at a node [m/s²].
    fn pull(&self, u1: &[DVec3], i: usize) -> DVec3 {
        let (g, past) = (self.c.physics().gravity, &self.c.past);
        self.c.inertia.map_or(-g, |t| t.displacement * (u1[i] - past.u[i]) - t.velocity * past.v[i] - g)
    }

    /// Mean velocity of the solve [m/s]; zero in a static problem.
    fn speed(&self, u1: &[DVec3], i: usize) -> DVec3 {
        self.c.inertia.map_or(DVec3::ZERO, |t| t.rate * (u1[i] - self.c.past.u[i]))
    }

    /// M a at u₁, weight and damping included.
    fn at(&self, u1: &[DVec3], out: &mut [DVec3]) {
        let drag = self.c.physics().mass_damping;
        match self.c.inertia {
            None => self.add(|i| self.pull(u1, i), |i| self.pull(u1, i), out),
            Some(_) => self.add(|i| self.pull(u1, i) + drag * self.speed(u1, i), |i| self.pull(u1, i), out),
        }
    }
}

impl Term for Inertia<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.at(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        // Quadratic and linear: ½ (r(u₁) + r(0))·u₁.
        let mut both = zeros(u1.len());
        self.at(u1, &mut both);
        self.at(&zeros(u1.len()), &mut both);
        0.5 * dot(u1, &both)
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        let Some(t) = self.c.inertia else { return };
        let factor = t.displacement + self.c.physics().mass_damping * t.rate;
        match self.c.plan.body.cut {
            None => {
                let blocks = matrix.values.par_iter_mut().zip(self.c.masses);
                blocks.with_min_len(BLOCKS).for_each(|(block, m)| add_to_diagonal(block, m * factor));
            }
            Some(_) => {
                for (i, m) in masses(&self.c).enumerate() {
                    add_to_diagonal(&mut matrix.values[self.c.pattern.blocks.diagonal[i]], m * factor);
                }
            }
        }
        for (k, (site, m)) in self.c.plan.masses.iter().zip(&self.c.physics().masses).enumerate() {
            let w = site.value;
            for (b, place) in self.c.places.masses.of(k).iter().enumerate() {
                let s = m * t.displacement * w[b / w.len()] * w[b % w.len()];
                add_to_diagonal(&mut matrix.values[*place as usize], s);
            }
        }
    }

    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        // Weight does not depend on where the body is.
        if self.c.inertia.is_none() { Parts::Nothing } else { Parts::Matrix }
    }

    fn by_past(&self, _u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        let Some(t) = self.c.inertia else { return };
        let drag = self.c.physics().mass_damping * t.rate;
        let newton = |i: usize| -t.displacement * change.u[i] - t.velocity * change.v[i];
        self.add(|i| newton(i) - drag * change.u[i], newton, out);
    }

    fn by_past_transposed(&self, _u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        let Some(t) = self.c.inertia else { return };
        let drag = self.c.physics().mass_damping * t.rate;
        self.add(|i| -(t.displacement + drag) * z[i], |i| -t.displacement * z[i], &mut out.u);
        self.add(|i| -t.velocity * z[i], |i| -t.velocity * z[i], &mut out.v);
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (p, d) = (self.c.physics(), &rates.physics);
        let density_rate = |i: usize| {
            let factor = self.c.coefficients.changes.density.as_ref().map_or(1.0, |f| f[i]);
            d.density * factor + rates.changes.density.as_ref().map_or(0.0, |f| p.density * f[i])
        };
        if d.density != 0.0 || rates.changes.density.is_some() {
            let whole = |i: usize| self.pull(u1, i) + p.mass_damping * self.speed(u1, i);
            match self.consistent() {
                Some(m) => m.along(rates).add(whole, out),
                None => {
                    for (i, v) in self.c.plan.body.node_volume.iter().enumerate() {
                        out[i] += density_rate(i) * v * whole(i);
                    }
                }
            }
        }
        if d.mass_damping != 0.0 {
            self.add(|i| d.mass_damping * self.speed(u1, i), |_| DVec3::ZERO, out);
        }
        if d.gravity != DVec3::ZERO {
            self.add(|_| -d.gravity, |_| -d.gravity, out);
        }
        if d.masses.iter().any(|m| *m != 0.0) {
            self.add_points(&d.masses, |i| self.pull(u1, i), out);
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let p = self.c.physics();
        if let Some(m) = self.consistent() {
            if sought.density {
                m.pull_density(z, |i| self.pull(u1, i) + p.mass_damping * self.speed(u1, i), gradient);
            }
            let mut momentum = zeros(z.len());
            add_product(self.c.pattern, self.c.masses, |i| z[i], &mut momentum);
            if sought.damping[0] {
                gradient.physics.mass_damping += momentum.iter().enumerate().map(|(i, z)| z.dot(self.speed(u1, i))).sum::<f64>();
            }
            gradient.physics.gravity -= momentum.iter().sum::<DVec3>();
        }
        let lumped = if self.c.plan.body.cut.is_some() { &self.c.plan.body.node_volume[..] } else { &[] };
        for (i, v) in lumped.iter().enumerate() {
            if sought.density {
                let g = v * z[i].dot(self.pull(u1, i) + p.mass_damping * self.speed(u1, i));
                gradient.physics.density += self.c.coefficients.changes.density.as_ref().map_or(1.0, |f| f[i]) * g;
                if let Some(factor) = &mut gradient.changes.density {
                    factor[i] += p.density * g;
                }
            }
            let m = density(&self.c, i) * v;
            if sought.damping[0] {
                gradient.physics.mass_damping += m * z[i].dot(self.speed(u1, i));
            }
            gradient.physics.gravity -= m * z[i];
        }
        for (k, (site, m)) in self.c.plan.masses.iter().zip(&p.masses).enumerate() {
            let mean = |v: &dyn Fn(usize) -> DVec3| -> DVec3 {
                site.nodes.iter().zip(site.value).map(|(n, w)| *w * v(*n as usize)).sum()
            };
            let z = mean(&|i| z[i]);
            gradient.physics.masses[k] += z.dot(mean(&|i| self.pull(u1, i)));
            gradient.physics.gravity -= *m * z;
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        let g = self.c.physics().gravity;
        self.add(|_| g, |_| g, &mut out.weight);
        if let Some(t) = self.c.inertia {
            let v = self.c.past.v;
            self.add(|i| t.velocity * v[i], |i| t.velocity * v[i], &mut out.momentum);
        }
        let _ = u1;
    }
}
