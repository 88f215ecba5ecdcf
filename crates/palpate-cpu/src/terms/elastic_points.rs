//! Elastic and viscous force of points that stand for a volume each: the material at F itself.
//!
//! The potential is `V [θ ψ(F₁) + (1 − θ) P(F₀):F₁ + (β/ℓ) ψ_lin(G₁ − G̃)]` with Green's strain 2G = H + Hᵀ + HᵀH and G̃ = Σ w G(x_past): rigid
//! motion neither stores nor dissipates.

use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::materials::Gradient;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::stencil::Stencil;

/// The term.
pub struct ElasticPoints<'a> {
    c: Context<'a>,
    /// λ and μ over E, and their derivatives by Poisson's ratio.
    lame: [(f64, f64); 2],
    /// Young's modulus [Pa], creep included.
    young: f64,
    /// G̃ of every point; empty without damping.
    past: Vec<DMat3>,
}

/// Rows of a matrix, as materials take them.
fn rows(m: DMat3) -> Gradient<f64> {
    std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i]))
}

/// A flattened matrix, row by row, as one.
fn matrix_of(v: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&std::array::from_fn(|k| v[3 * (k % 3) + k / 3]))
}

fn contract(a: DMat3, b: DMat3) -> f64 {
    (0..3).map(|c| a.col(c).dot(b.col(c))).sum()
}

/// Green's strain of a displacement gradient.
fn green(h: DMat3) -> DMat3 {
    (h + h.transpose() + h.transpose() * h) * 0.5
}

/// Change of Green's strain when H changes by `dh`.
fn green_rate(f: DMat3, dh: DMat3) -> DMat3 {
    let half = f.transpose() * dh;
    (half + half.transpose()) * 0.5
}

/// λ tr(G) I + 2μ G.
fn linear_stress(g: DMat3, (lambda, mu): (f64, f64)) -> DMat3 {
    let trace = g.x_axis.x + g.y_axis.y + g.z_axis.z;
    DMat3::IDENTITY * (lambda * trace) + g * (2.0 * mu)
}

fn scaled((lambda, mu): (f64, f64), by: f64) -> (f64, f64) {
    (lambda * by, mu * by)
}

impl<'a> ElasticPoints<'a> {
    /// Takes the past's strains.
    pub fn new(c: Context<'a>) -> ElasticPoints<'a> {
        let nu = c.physics().poisson_ratio;
        let mut term = ElasticPoints { c, lame: [lame(1.0, nu), lame_by_nu(1.0, nu)], young: c.young(), past: Vec::new() };
        if c.inertia.is_some() {
            let sum = |s: Stencil| c.past.each.iter().map(|(w, u)| green(s.gradient_of(u)) * *w).sum::<DMat3>();
            term.past = c.plan.body.points.stencils.iter().map(sum).collect();
        }
        term
    }

    /// Every point: number, stencil, volume, and Lamé parameters [Pa].
    fn each(&self) -> impl Iterator<Item = (usize, Stencil<'a>, f64, (f64, f64))> + '_ {
        let points = &self.c.plan.body.points;
        points.stencils.iter().zip(&points.volume).enumerate().map(|(e, (s, v))| {
            let young = self.young * self.c.factor(e);
            (e, s, *v, scaled(self.lame[0], young))
        })
    }

    /// First Piola–Kirchhoff stress at a displacement, elastic [Pa].
    fn stress(&self, s: Stencil, u: &[DVec3], (lambda, mu): (f64, f64)) -> DMat3 {
        matrix_of(&self.c.plan.model.law.stress(&rows(s.gradient_of(u)), lambda, mu).0)
    }

    /// The viscous part for a damping of one over the length of the solve, F S with S = C (G₁ − G̃) [Pa].
    fn viscous(&self, e: usize, h: DMat3, moduli: (f64, f64)) -> DMat3 {
        let Some(past) = self.past.get(e) else { return DMat3::ZERO };
        (h + DMat3::IDENTITY) * linear_stress(green(h) - *past, moduli)
    }

    /// Whole stress at u₁, the old state's share included [Pa].
    fn total(&self, e: usize, s: Stencil, u1: &[DVec3], moduli: (f64, f64)) -> DMat3 {
        let w = &self.c.weights;
        let mut p = self.stress(s, u1, moduli) * w.new;
        if w.old != 0.0 {
            p += self.stress(s, self.c.past.u, moduli) * w.old;
        }
        if w.rate != 0.0 {
            p += self.viscous(e, s.gradient_of(u1), moduli) * w.rate;
        }
        p
    }

    fn add_force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        for (e, s, v, moduli) in self.each() {
            s.spread_gradient(self.total(e, s, u1, moduli) * v, out);
        }
    }

    /// ∂P/∂F : δ of the elastic stress at a displacement.
    fn stress_rate(&self, s: Stencil, u: &[DVec3], (lambda, mu): (f64, f64), dh: DMat3) -> DMat3 {
        let tangent = self.c.plan.model.law.stress(&rows(s.gradient_of(u)), lambda, mu).1;
        let d = rows(dh);
        matrix_of(&std::array::from_fn(|k| (0..9).map(|l| tangent[k][l] * d[l / 3][l % 3]).sum()))
    }

    /// Derivative of the whole stress by Poisson's ratio, over E.
    fn by_poisson(&self, e: usize, s: Stencil, u1: &[DVec3]) -> DMat3 {
        let (w, (lambda, mu), by_nu) = (&self.c.weights, self.lame[0], self.lame[1]);
        let elastic = |u: &[DVec3]| {
            let [by_lambda, by_mu] = self.c.plan.model.law.by_moduli(&rows(s.gradient_of(u)), lambda, mu);
            matrix_of(&std::array::from_fn(|k| by_nu.0 * by_lambda[k] + by_nu.1 * by_mu[k]))
        };
        let mut p = elastic(u1) * w.new;
        if w.old != 0.0 {
            p += elastic(self.c.past.u) * w.old;
        }
        p + self.viscous(e, s.gradient_of(u1), by_nu) * w.rate
    }
}

impl Term for ElasticPoints<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.add_force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let w = &self.c.weights;
        let of = |(e, s, v, (lambda, mu)): (usize, Stencil, f64, (f64, f64))| {
            let h = s.gradient_of(u1);
            let mut psi = w.new * self.c.plan.model.law.value(&rows(h), lambda, mu);
            if w.old != 0.0 {
                psi += w.old * contract(self.stress(s, self.c.past.u, (lambda, mu)), h);
            }
            if let (Some(past), true) = (self.past.get(e), w.rate != 0.0) {
                let g = green(h) - *past;
                psi += 0.5 * w.rate * contract(g, linear_stress(g, (lambda, mu)));
            }
            v * psi
        };
        self.each().map(of).sum()
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        let w = &self.c.weights;
        for (e, s, v, (lambda, mu)) in self.each() {
            let h = s.gradient_of(u1);
            let f = h + DMat3::IDENTITY;
            let mut tangent = self.c.plan.model.law.stress(&rows(h), lambda, mu).1.map(|r| r.map(|t| t * w.new));
            if let (Some(past), true) = (self.past.get(e), w.rate != 0.0) {
                let held = linear_stress(green(h) - *past, (lambda, mu));
                for l in 0..9 {
                    let mut unit = [0.0; 9];
                    unit[l] = 1.0;
                    let dh = matrix_of(&unit);
                    let change = rows(dh * held + f * linear_stress(green_rate(f, dh), (lambda, mu)));
                    (0..9).for_each(|k| tangent[k][l] += w.rate * change[k / 3][k % 3]);
                }
            }
            if curvature != Curvature::Exact {
                crate::linear::dense::without_negative_eigenvalues(&mut tangent);
            }
            let places = self.c.places.points.of(e);
            let n = s.nodes.len();
            for (b, place) in places.iter().enumerate() {
                let (ga, gb) = (s.gradient[b / n], s.gradient[b % n]);
                let entry = |i: usize, j: usize| -> f64 {
                    (0..3).map(|k| (0..3).map(|l| tangent[3 * i + k][3 * j + l] * gb[l]).sum::<f64>() * ga[k]).sum()
                };
                let block = DMat3::from_cols_array(&std::array::from_fn(|k| entry(k % 3, k / 3)));
                matrix.values[*place as usize] += block * v;
            }
        }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        let w = &self.c.weights;
        for (i, ((weight, u), d)) in self.c.past.each.iter().zip(change.each).enumerate() {
            for (_, s, v, moduli) in self.each().filter(|_| w.sees_past()) {
                let (h, dh) = (s.gradient_of(u1), s.gradient_of(d));
                let f0 = s.gradient_of(u) + DMat3::IDENTITY;
                let mut p = (h + DMat3::IDENTITY) * linear_stress(green_rate(f0, dh), moduli) * (-w.rate * weight);
                if w.old != 0.0 && i == 0 {
                    p += self.stress_rate(s, u, moduli, dh) * w.old;
                }
                s.spread_gradient(p * v, out);
            }
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        let w = &self.c.weights;
        for (i, ((weight, u), to)) in self.c.past.each.iter().zip(&mut out.each).enumerate() {
            for (_, s, v, moduli) in self.each().filter(|_| w.sees_past()) {
                let (f, dz) = (s.gradient_of(u1) + DMat3::IDENTITY, s.gradient_of(z));
                let f0 = s.gradient_of(u) + DMat3::IDENTITY;
                let mut p = f0 * linear_stress(green_rate(f, dz), moduli) * (-w.rate * weight);
                if w.old != 0.0 && i == 0 {
                    p += self.stress_rate(s, u, moduli, dz) * w.old;
                }
                s.spread_gradient(p * v, to);
            }
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (ln_young, d) = (self.c.ln_young_along(rates), &rates.physics);
        let damping = d.stiffness_damping * self.c.inertia.map_or(0.0, |t| t.rate);
        for (e, s, v, moduli) in self.each() {
            let ln = ln_young + self.c.ln_factor_along(rates, e);
            let mut p = if ln == 0.0 { DMat3::ZERO } else { self.total(e, s, u1, moduli) * ln };
            if d.poisson_ratio != 0.0 {
                p += self.by_poisson(e, s, u1) * (d.poisson_ratio * self.young * self.c.factor(e));
            }
            if damping != 0.0 {
                p += self.viscous(e, s.gradient_of(u1), moduli) * damping;
            }
            s.spread_gradient(p * v, out);
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let rate = self.c.inertia.map_or(0.0, |t| t.rate);
        let mut by_ln = Vec::new();
        for (e, s, v, moduli) in self.each() {
            let dz = s.gradient_of(z) * v;
            if sought.modulus {
                by_ln.push((e, contract(dz, self.total(e, s, u1, moduli))));
            }
            if sought.poisson {
                gradient.physics.poisson_ratio += self.young * self.c.factor(e) * contract(dz, self.by_poisson(e, s, u1));
            }
            if sought.damping[1] {
                gradient.physics.stiffness_damping += rate * contract(dz, self.viscous(e, s.gradient_of(u1), moduli));
            }
        }
        if sought.modulus {
            self.c.pull_modulus(by_ln.into_iter(), gradient);
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.add_force(u1, &mut out.elastic);
    }
}
