//! Elastic and viscous force of points that stand for a volume each: the material at F itself.
//!
//! The potential is `V [θ ψ(F₁) + (1 − θ) P(F₀):F₁ + (β/ℓ) ψ_lin(G₁ − G̃) + φ(|G₁ − G̃|²)]` with Green's strain 2G = H + Hᵀ + HᵀH,
//! G̃ = Σ w G(x_past) and φ the material's viscosity: rigid motion neither stores nor dissipates.
//!
//! Where an element has several points, each has its [`Share`] of the Lamé parameters, in ψ and ψ_lin alike.
//!
//! What a point gives is computed side by side and summed by the points around a node in their order, so bits do not depend on threads.

mod blocks;

use super::assembly::assemble;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use blocks::Tangents;
use glam::{DMat3, DVec3};
use palpate_model::materials::Gradient;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::points::Share;
use palpate_model::space::stencil::Stencil;
use rayon::prelude::*;

/// Points that one task treats at least.
const CHUNK: usize = 64;
/// Nodes that one task sums at least.
const NODES: usize = 256;

/// The term.
pub struct ElasticPoints<'a> {
    c: Context<'a>,
    /// Of every share, λ and μ over E, and their derivatives by Poisson's ratio.
    lame: [[(f64, f64); 2]; 3],
    /// Young's modulus [Pa], creep included.
    young: f64,
    /// G̃ of every point; empty in a static problem.
    past: Vec<DMat3>,
    /// The material's viscosity, and 1/ℓ [1/s]; `None` without one and in a static problem.
    flow: Option<(Viscosity, f64)>,
}

/// A point: number and element, place and gradient, volume [m³], Lamé parameters [Pa], and as [`ElasticPoints::lame`] has them.
#[derive(Clone, Copy)]
struct Point<'a> {
    e: usize,
    element: usize,
    s: Stencil<'a>,
    v: f64,
    moduli: (f64, f64),
    lame: [(f64, f64); 2],
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
        let lame = Share::ALL.map(|s| s.of(lame(1.0, nu), lame_by_nu(1.0, nu)));
        let mut term = ElasticPoints { c, lame, young: c.young(), past: Vec::new(), flow: None };
        if c.inertia.is_some() {
            let sum = |p: Point| c.past.each.iter().map(|(w, u)| green(p.s.gradient_of(u)) * *w).sum::<DMat3>();
            term.past = term.each(sum);
        }
        term.flow = c.physics().viscosity.zip(c.inertia.map(|t| t.rate));
        term
    }

    fn point(&self, e: usize) -> Point<'a> {
        let points = &self.c.plan.body.points;
        let (element, lame) = (points.element_of(e), self.lame[points.share(e) as usize]);
        let moduli = scaled(lame[0], self.young * self.c.factor(element));
        Point { e, element, s: points.stencils.get(e), v: points.volume[e], moduli, lame }
    }

    /// A value of every point.
    fn each<T: Send>(&self, of: impl Fn(Point<'a>) -> T + Sync + Send) -> Vec<T> {
        (0..self.c.plan.body.points.len()).into_par_iter().with_min_len(CHUNK).map(|e| of(self.point(e))).collect()
    }

    /// Adds P g of every point to its nodes, where `of` gives P times the volume: every node's sum in the order of the points.
    fn gather(&self, of: impl Fn(Point<'a>) -> DMat3 + Sync + Send, out: &mut [DVec3]) {
        let (stresses, pattern, stencils) = (self.each(of), self.c.pattern, &self.c.plan.body.points.stencils);
        out.par_iter_mut().with_min_len(NODES).enumerate().for_each(|(n, sum)| {
            for (e, i) in &pattern.point_list[pattern.point_rows[n]..pattern.point_rows[n + 1]] {
                *sum += stresses[*e as usize] * stencils.get(*e as usize).gradient[usize::from(*i)];
            }
        });
    }

    /// First Piola–Kirchhoff stress at a displacement, elastic [Pa].
    fn stress(&self, s: Stencil, u: &[DVec3], (lambda, mu): (f64, f64)) -> DMat3 {
        matrix_of(&self.c.law().stress(&rows(s.gradient_of(u)), lambda, mu).0)
    }

    /// The viscous part for a damping of one over the length of the solve, F S with S = C (G₁ − G̃) [Pa].
    fn viscous(&self, e: usize, h: DMat3, moduli: (f64, f64)) -> DMat3 {
        let Some(past) = self.past.get(e) else { return DMat3::ZERO };
        (h + DMat3::IDENTITY) * linear_stress(green(h) - *past, moduli)
    }

    /// The viscosity of a point, and 1/ℓ; an element's mean has none beside its local points.
    fn flow_of(&self, e: usize) -> Option<(Viscosity, f64)> {
        self.flow.filter(|_| self.c.plan.body.points.share(e) != Share::Mean)
    }

    /// The material's viscous stress S = ∂φ/∂G [Pa].
    fn flow_stress(&self, e: usize, h: DMat3) -> DMat3 {
        let Some((law, rate)) = self.flow_of(e) else { return DMat3::ZERO };
        let g = green(h) - self.past[e];
        g * (2.0 * law.loss(contract(g, g), rate)[1])
    }

    /// Change of S when G₁ changes by `dg`; symmetric.
    fn flow_rate(&self, e: usize, h: DMat3, dg: DMat3) -> DMat3 {
        let Some((law, rate)) = self.flow_of(e) else { return DMat3::ZERO };
        let g = green(h) - self.past[e];
        let [_, first, second] = law.loss(contract(g, g), rate);
        dg * (2.0 * first) + g * (4.0 * second * contract(g, dg))
    }

    /// Derivatives of the viscous stress by η and h.
    fn by_flow(&self, e: usize, h: DMat3) -> [DMat3; 2] {
        let Some((law, rate)) = self.flow_of(e) else { return [DMat3::ZERO; 2] };
        let g = green(h) - self.past[e];
        law.by_numbers(contract(g, g), rate).map(|by| (h + DMat3::IDENTITY) * g * (2.0 * by))
    }

    /// Whole stress that a modulus scales at u₁, the old state's share included [Pa].
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
        let of = |Point { e, s, v, moduli, .. }: Point| {
            let h = s.gradient_of(u1);
            (self.total(e, s, u1, moduli) + (h + DMat3::IDENTITY) * self.flow_stress(e, h)) * v
        };
        self.gather(of, out);
    }

    /// ∂P/∂F : δ of the elastic stress at a displacement.
    fn stress_rate(&self, s: Stencil, u: &[DVec3], (lambda, mu): (f64, f64), dh: DMat3) -> DMat3 {
        let tangent = self.c.law().stress(&rows(s.gradient_of(u)), lambda, mu).1;
        let d = rows(dh);
        matrix_of(&std::array::from_fn(|k| (0..9).map(|l| tangent[k][l] * d[l / 3][l % 3]).sum()))
    }

    /// Derivatives of the whole stress by the factors of the material's curves.
    fn by_curves(&self, s: Stencil, u1: &[DVec3], (lambda, mu): (f64, f64)) -> Vec<DMat3> {
        let (w, law) = (&self.c.weights, self.c.law());
        let at = |u: &[DVec3]| law.by_curves(&rows(s.gradient_of(u)), lambda, mu);
        let mut all: Vec<DMat3> = at(u1).iter().map(|p| matrix_of(p) * w.new).collect();
        if w.old != 0.0 {
            all.iter_mut().zip(at(self.c.past.u)).for_each(|(p, old)| *p += matrix_of(&old) * w.old);
        }
        all
    }

    /// Derivative of the whole stress by Poisson's ratio, over E.
    fn by_poisson(&self, Point { e, s, lame: [(lambda, mu), by_nu], .. }: Point, u1: &[DVec3]) -> DMat3 {
        let w = &self.c.weights;
        let elastic = |u: &[DVec3]| {
            let [by_lambda, by_mu] = self.c.law().by_moduli(&rows(s.gradient_of(u)), lambda, mu);
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
        let of = |Point { e, s, v, moduli: (lambda, mu), .. }: Point| {
            let h = s.gradient_of(u1);
            let mut psi = w.new * self.c.law().value(&rows(h), lambda, mu);
            if w.old != 0.0 {
                psi += w.old * contract(self.stress(s, self.c.past.u, (lambda, mu)), h);
            }
            if let (Some(past), true) = (self.past.get(e), w.rate != 0.0) {
                let g = green(h) - *past;
                psi += 0.5 * w.rate * contract(g, linear_stress(g, (lambda, mu)));
            }
            if let Some((law, rate)) = self.flow_of(e) {
                let g = green(h) - self.past[e];
                psi += law.loss(contract(g, g), rate)[0];
            }
            v * psi
        };
        self.each(of).iter().sum()
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        assemble(&Tangents { term: self, u1, curvature }, self.c.pattern, matrix);
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        let w = &self.c.weights;
        for (i, ((weight, u), d)) in self.c.past.each.iter().zip(change.each).enumerate() {
            let of = |Point { e, s, v, moduli, .. }: Point| {
                let (h, dh) = (s.gradient_of(u1), s.gradient_of(d));
                let dg = green_rate(s.gradient_of(u) + DMat3::IDENTITY, dh) * *weight;
                let stress = linear_stress(dg, moduli) * w.rate + self.flow_rate(e, h, dg);
                let mut p = (h + DMat3::IDENTITY) * stress * -1.0;
                if w.old != 0.0 && i == 0 {
                    p += self.stress_rate(s, u, moduli, dh) * w.old;
                }
                p * v
            };
            if w.sees_past() || self.flow.is_some() {
                self.gather(of, out);
            }
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        let w = &self.c.weights;
        for (i, ((weight, u), to)) in self.c.past.each.iter().zip(&mut out.each).enumerate() {
            let of = |Point { e, s, v, moduli, .. }: Point| {
                let (h, dz) = (s.gradient_of(u1), s.gradient_of(z));
                let dg = green_rate(h + DMat3::IDENTITY, dz);
                let stress = linear_stress(dg, moduli) * w.rate + self.flow_rate(e, h, dg);
                let mut p = (s.gradient_of(u) + DMat3::IDENTITY) * stress * -*weight;
                if w.old != 0.0 && i == 0 {
                    p += self.stress_rate(s, u, moduli, dz) * w.old;
                }
                p * v
            };
            if w.sees_past() || self.flow.is_some() {
                self.gather(of, to);
            }
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (ln_young, d) = (self.c.ln_young_along(rates), &rates.physics);
        let damping = d.stiffness_damping * self.c.inertia.map_or(0.0, |t| t.rate);
        let flow = d.viscosity.filter(|_| self.flow.is_some());
        let curves: Vec<f64> = d.curves.iter().flatten().copied().collect();
        let curves = if curves.iter().any(|r| *r != 0.0) { curves } else { Vec::new() };
        let of = |p: Point| {
            let Point { e, element, s, v, moduli, .. } = p;
            let ln = ln_young + self.c.ln_factor_along(rates, element);
            let mut stress = if ln == 0.0 { DMat3::ZERO } else { self.total(e, s, u1, moduli) * ln };
            if d.poisson_ratio != 0.0 {
                stress += self.by_poisson(p, u1) * (d.poisson_ratio * self.young * self.c.factor(element));
            }
            if damping != 0.0 {
                stress += self.viscous(e, s.gradient_of(u1), moduli) * damping;
            }
            if !curves.is_empty() {
                stress += self.by_curves(s, u1, moduli).iter().zip(&curves).map(|(p, rate)| *p * *rate).sum::<DMat3>();
            }
            if let Some(rates) = flow {
                let [by_coefficient, by_exponent] = self.by_flow(e, s.gradient_of(u1));
                stress += by_coefficient * rates.coefficient + by_exponent * rates.exponent;
            }
            stress * v
        };
        self.gather(of, out);
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let rate = self.c.inertia.map_or(0.0, |t| t.rate);
        let flows = sought.viscosity && self.flow.is_some();
        // By the logarithm of the modulus, Poisson's ratio, damping and the viscosity's numbers.
        let of = |p: Point| {
            let Point { e, element, s, v, moduli, .. } = p;
            let dz = s.gradient_of(z) * v;
            let along = |wanted: bool, p: &dyn Fn() -> DMat3| if wanted { contract(dz, p()) } else { 0.0 };
            let [by_coefficient, by_exponent] =
                if flows { self.by_flow(e, s.gradient_of(u1)).map(|p| contract(dz, p)) } else { [0.0; 2] };
            [
                along(sought.modulus, &|| self.total(e, s, u1, moduli)),
                self.young * self.c.factor(element) * along(sought.poisson, &|| self.by_poisson(p, u1)),
                rate * along(sought.damping[1], &|| self.viscous(e, s.gradient_of(u1), moduli)),
                by_coefficient,
                by_exponent,
            ]
        };
        let all = self.each(of);
        for [_, by_poisson, by_damping, by_coefficient, by_exponent] in &all {
            gradient.physics.poisson_ratio += by_poisson;
            gradient.physics.stiffness_damping += by_damping;
            if let Some(v) = gradient.physics.viscosity.as_mut().filter(|_| flows) {
                v.coefficient += by_coefficient;
                v.exponent += by_exponent;
            }
        }
        if sought.curves {
            let of = |Point { s, v, moduli, .. }: Point| {
                let dz = s.gradient_of(z) * v;
                self.by_curves(s, u1, moduli).into_iter().map(|p| contract(dz, p)).collect::<Vec<_>>()
            };
            self.each(of).iter().for_each(|by| self.c.pull_curves(by, gradient));
        }
        if sought.modulus {
            let points = &self.c.plan.body.points;
            self.c.pull_modulus(all.iter().enumerate().map(|(e, g)| (points.element_of(e), g[0])), gradient);
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.add_force(u1, &mut out.elastic);
    }
}
