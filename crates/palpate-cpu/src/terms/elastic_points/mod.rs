//! Elastic and viscous force of points that stand for a volume each: the material at F itself.
//!
//! The potential is `V [θ ψ(F₁) + (1 − θ) P(F₀):F₁ + (β/ℓ) ψ_lin(G₁ − G̃) + φ(|G₁ − G̃|²)]` with Green's strain 2G = H + Hᵀ + HᵀH,
//! G̃ = Σ w G(x_past) and φ the material's viscosity: rigid motion neither stores nor dissipates.
//!
//! Where an element has several points, each has its [`Share`] of the Lamé parameters, in ψ and ψ_lin alike. Where effects give the body another
//! stress-free shape, F, gradients and volumes are those that [`unstrained`] has.
//!
//! What a point gives is computed side by side and summed by the points around a node in their order, so bits do not depend on threads.

mod blocks;
mod products;

use super::assembly::assemble;
use super::products::Parts;
use super::unstrained;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use blocks::Tangents;
use glam::{DMat3, DVec3};
use palpate_model::materials::Gradient;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::points::Share;
use palpate_model::space::stencil::{Stencil, Stencils};
use products::Moduli;
use rayon::prelude::*;

/// Points that one task treats at least.
const CHUNK: usize = 64;
/// Nodes that one task sums at least.
const NODES: usize = 256;

/// The term.
pub struct ElasticPoints<'a> {
    c: Context<'a>,
    /// Places and gradients of the points.
    stencils: &'a Stencils,
    /// Of every share, λ and μ over E, and their derivatives by Poisson's ratio.
    lame: [[(f64, f64); 2]; 3],
    /// Young's modulus [Pa], creep included.
    young: f64,
    /// G̃ of every point; empty in a static problem.
    past: Vec<DMat3>,
    /// The old state's own stress at every point, which no Newton iteration changes; empty where it has no weight.
    old: Vec<DMat3>,
    /// The material's viscosity, and 1/ℓ [1/s]; `None` without one and in a static problem.
    flow: Option<(Viscosity, f64)>,
}

/// A point: number and element, place and gradient, what is taken off a displacement's gradient, volume [m³], Lamé parameters [Pa], and as
/// [`ElasticPoints::lame`] has them.
#[derive(Clone, Copy)]
struct Point<'a> {
    e: usize,
    element: usize,
    s: Stencil<'a>,
    shift: DMat3,
    v: f64,
    moduli: (f64, f64),
    lame: [(f64, f64); 2],
}

impl Point<'_> {
    /// H = F − I at a displacement.
    fn h(&self, u: &[DVec3]) -> DMat3 {
        self.s.gradient_of(u) - self.shift
    }
}

/// Rows of a matrix, as materials take them.
fn rows(m: DMat3) -> Gradient<f64> {
    std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i]))
}

/// A flattened matrix, row by row, as one.
fn matrix_of(v: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&std::array::from_fn(|k| v[3 * (k % 3) + k / 3]))
}

/// A tangent, row by row of both matrices, times a change.
fn applied(tangent: &[[f64; 9]; 9], change: DMat3) -> DMat3 {
    let d = rows(change);
    matrix_of(&std::array::from_fn(|k| (0..9).map(|l| tangent[k][l] * d[l / 3][l % 3]).sum()))
}

/// A : B.
pub(super) fn contract(a: DMat3, b: DMat3) -> f64 {
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
        let stencils = c.altered.points.as_ref().map_or(&c.plan.body.points.stencils, |p| &p.stencils);
        let mut term = ElasticPoints { c, stencils, lame, young: c.young(), past: Vec::new(), old: Vec::new(), flow: None };
        if c.inertia.is_some() {
            let sum = |p: Point| c.past.each.iter().map(|(w, u)| green(p.h(u)) * *w).sum::<DMat3>();
            term.past = term.each(sum);
        }
        if c.weights.old != 0.0 {
            term.old = term.each(|p: Point| term.stress(p.h(c.past.u), p.moduli));
        }
        term.flow = c.physics().viscosity.zip(c.inertia.map(|t| t.rate));
        term
    }

    fn point(&self, e: usize) -> Point<'a> {
        let points = &self.c.plan.body.points;
        let (element, lame) = (points.element_of(e), self.lame[points.share(e) as usize]);
        let moduli = scaled(lame[0], self.young * self.c.factor(element));
        let (shift, v) = self.c.altered.points.as_ref().map_or((DMat3::ZERO, points.volume[e]), |p| (p.shift[e], p.volume[e]));
        Point { e, element, s: self.stencils.get(e), shift, v, moduli, lame }
    }

    /// A value of every point.
    fn each<T: Send>(&self, of: impl Fn(Point<'a>) -> T + Sync + Send) -> Vec<T> {
        (0..self.c.plan.body.points.len()).into_par_iter().with_min_len(CHUNK).map(|e| of(self.point(e))).collect()
    }

    /// Adds P g of every point to its nodes, where `of` gives P times the volume: every node's sum in the order of the points.
    fn gather(&self, of: impl Fn(Point<'a>) -> DMat3 + Sync + Send, out: &mut [DVec3]) {
        let (stresses, pattern, stencils) = (self.each(of), self.c.pattern, self.stencils);
        out.par_iter_mut().with_min_len(NODES).enumerate().for_each(|(n, sum)| {
            for (e, i) in &pattern.point_list[pattern.point_rows[n]..pattern.point_rows[n + 1]] {
                *sum += stresses[*e as usize] * stencils.get(*e as usize).gradient[usize::from(*i)];
            }
        });
    }

    /// First Piola–Kirchhoff stress, elastic [Pa].
    fn stress(&self, h: DMat3, (lambda, mu): (f64, f64)) -> DMat3 {
        matrix_of(&self.c.law().first(&rows(h), lambda, mu))
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
    fn total(&self, p: Point, u1: &[DVec3]) -> DMat3 {
        let (w, h) = (self.c.weights_of(p.element), p.h(u1));
        let mut stress = self.stress(h, p.moduli) * w.new;
        if w.old != 0.0 {
            stress += self.old[p.e] * w.old;
        }
        if w.rate != 0.0 {
            stress += self.viscous(p.e, h, p.moduli) * w.rate;
        }
        stress
    }

    /// The same with what the material's viscosity adds.
    fn whole(&self, p: Point, u1: &[DVec3]) -> DMat3 {
        let h = p.h(u1);
        self.total(p, u1) + (h + DMat3::IDENTITY) * self.flow_stress(p.e, h)
    }

    fn add_force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        self.gather(|p| self.whole(p, u1) * p.v, out);
    }

    /// ∂P/∂F : δ of the elastic stress.
    fn stress_rate(&self, h: DMat3, (lambda, mu): (f64, f64), dh: DMat3) -> DMat3 {
        applied(&self.c.law().stress(&rows(h), lambda, mu).1, dh)
    }

    /// Derivatives of the whole stress by the factors of the material's curves.
    fn by_curves(&self, p: Point, u1: &[DVec3]) -> Vec<DMat3> {
        let (w, law, (lambda, mu)) = (&self.c.weights, self.c.law(), p.moduli);
        let at = |u: &[DVec3]| law.by_curves(&rows(p.h(u)), lambda, mu);
        let mut all: Vec<DMat3> = at(u1).iter().map(|p| matrix_of(p) * w.new).collect();
        if w.old != 0.0 {
            all.iter_mut().zip(at(self.c.past.u)).for_each(|(p, old)| *p += matrix_of(&old) * w.old);
        }
        all
    }

    /// Derivative of the whole stress by Poisson's ratio, over E.
    fn by_poisson(&self, point: Point, u1: &[DVec3]) -> DMat3 {
        let (w, [(lambda, mu), by_nu]) = (self.c.weights_of(point.element), point.lame);
        let elastic = |u: &[DVec3]| {
            let [by_lambda, by_mu] = self.c.law().by_moduli(&rows(point.h(u)), lambda, mu);
            matrix_of(&std::array::from_fn(|k| by_nu.0 * by_lambda[k] + by_nu.1 * by_mu[k]))
        };
        let mut p = elastic(u1) * w.new;
        if w.old != 0.0 {
            p += elastic(self.c.past.u) * w.old;
        }
        p + self.viscous(point.e, point.h(u1), by_nu) * w.rate
    }

    /// True where the force depends on the past.
    fn sees_past(&self) -> bool {
        self.c.weights.sees_past() || self.flow.is_some()
    }

    /// Change of the whole stress when F at past state `i` changes by `dh`.
    fn along_past(&self, p: Point, i: usize, u1: &[DVec3], dh: DMat3) -> DMat3 {
        let (w, (weight, u), h) = (self.c.weights_of(p.element), self.c.past.each[i], p.h(u1));
        let before = p.h(u);
        let dg = green_rate(before + DMat3::IDENTITY, dh) * weight;
        let stress = linear_stress(dg, p.moduli) * w.rate + self.flow_rate(p.e, h, dg);
        let mut change = (h + DMat3::IDENTITY) * stress * -1.0;
        if w.old != 0.0 && i == 0 {
            change += self.stress_rate(before, p.moduli, dh) * w.old;
        }
        change
    }

    /// Its transpose.
    fn pull_past(&self, p: Point, i: usize, u1: &[DVec3], dz: DMat3) -> DMat3 {
        let (w, (weight, u), h) = (self.c.weights_of(p.element), self.c.past.each[i], p.h(u1));
        let before = p.h(u);
        let dg = green_rate(h + DMat3::IDENTITY, dz);
        let stress = linear_stress(dg, p.moduli) * w.rate + self.flow_rate(p.e, h, dg);
        let mut pulled = (before + DMat3::IDENTITY) * stress * -weight;
        if w.old != 0.0 && i == 0 {
            pulled += self.stress_rate(before, p.moduli, dz) * w.old;
        }
        pulled
    }

    /// Past states that the force depends on.
    fn pasts(&self) -> std::ops::Range<usize> {
        0..if self.sees_past() { self.c.past.each.len() } else { 0 }
    }

    /// Change of the whole stress when the stress-free shape moves by `dw`.
    fn along_rest(&self, p: Point, u1: &[DVec3], dw: &[DVec3]) -> DMat3 {
        let l = p.s.gradient_of(dw);
        let away = |u: &[DVec3]| (p.h(u) + DMat3::IDENTITY) * l * -1.0;
        let past = self.pasts().map(|i| self.along_past(p, i, u1, away(self.c.past.each[i].1)));
        let change = applied(&self.tangent_of(&p, u1), away(u1)) + past.sum::<DMat3>();
        unstrained::moved(l, self.whole(p, u1), change)
    }

    /// Its transpose, before it goes to the nodes.
    fn pull_rest(&self, p: Point, u1: &[DVec3], z: &[DVec3]) -> DMat3 {
        let dz = p.s.gradient_of(z);
        let f = |u: &[DVec3]| p.h(u) + DMat3::IDENTITY;
        let new = std::iter::once((f(u1), applied(&self.tangent_of(&p, u1), dz)));
        let past = self.pasts().map(|i| (f(self.c.past.each[i].1), self.pull_past(p, i, u1, dz)));
        unstrained::pulled(dz, self.whole(p, u1), new.chain(past))
    }
}

impl Term for ElasticPoints<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.add_force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let of = |p: Point| {
            let (Point { e, v, moduli: (lambda, mu), .. }, h) = (p, p.h(u1));
            let w = self.c.weights_of(p.element);
            let mut psi = w.new * self.c.law().value(&rows(h), lambda, mu);
            if w.old != 0.0 {
                psi += w.old * contract(self.old[e], h);
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

    fn products<'b>(&'b self, u1: &[DVec3]) -> Parts<'b> {
        Parts::Free(Box::new(Moduli::new(self, u1)))
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        for i in self.pasts() {
            self.gather(|p| self.along_past(p, i, u1, p.s.gradient_of(change.each[i])) * p.v, out);
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        for i in self.pasts() {
            self.gather(|p| self.pull_past(p, i, u1, p.s.gradient_of(z)) * p.v, &mut out.each[i]);
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (ln_young, d) = (self.c.ln_young_along(rates), &rates.physics);
        let rate = self.c.inertia.map_or(0.0, |t| t.rate);
        let flow = d.viscosity.filter(|_| self.flow.is_some());
        let curves: Vec<f64> = d.curves.iter().flatten().copied().collect();
        let curves = if curves.iter().any(|r| *r != 0.0) { curves } else { Vec::new() };
        let rest = rates.changes.rest.as_deref().filter(|_| self.c.altered.points.is_some());
        let of = |p: Point| {
            let (Point { e, element, v, moduli, .. }, h) = (p, p.h(u1));
            let ln = ln_young + self.c.ln_factor_along(rates, element);
            let mut stress = if ln == 0.0 { DMat3::ZERO } else { self.total(p, u1) * ln };
            if d.poisson_ratio != 0.0 {
                stress += self.by_poisson(p, u1) * (d.poisson_ratio * self.young * self.c.factor(element));
            }
            let damping = rate * self.c.damping_along(rates, element);
            if damping != 0.0 {
                stress += self.viscous(e, h, moduli) * damping;
            }
            if !curves.is_empty() {
                stress += self.by_curves(p, u1).iter().zip(&curves).map(|(p, rate)| *p * *rate).sum::<DMat3>();
            }
            if let Some(rates) = flow {
                let [by_coefficient, by_exponent] = self.by_flow(e, h);
                stress += by_coefficient * rates.coefficient + by_exponent * rates.exponent;
            }
            if let Some(dw) = rest {
                stress += self.along_rest(p, u1, dw);
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
            let (Point { e, element, v, moduli, .. }, h) = (p, p.h(u1));
            let dz = p.s.gradient_of(z) * v;
            let along = |wanted: bool, p: &dyn Fn() -> DMat3| if wanted { contract(dz, p()) } else { 0.0 };
            let [by_coefficient, by_exponent] = if flows { self.by_flow(e, h).map(|p| contract(dz, p)) } else { [0.0; 2] };
            [
                along(sought.modulus, &|| self.total(p, u1)),
                self.young * self.c.factor(element) * along(sought.poisson, &|| self.by_poisson(p, u1)),
                rate * along(sought.damping[1], &|| self.viscous(e, h, moduli)),
                by_coefficient,
                by_exponent,
            ]
        };
        let all = self.each(of);
        let points = &self.c.plan.body.points;
        self.c.pull_damping(all.iter().enumerate().map(|(e, g)| (points.element_of(e), g[2])), gradient);
        for [_, by_poisson, _, by_coefficient, by_exponent] in &all {
            gradient.physics.poisson_ratio += by_poisson;
            if let Some(v) = gradient.physics.viscosity.as_mut().filter(|_| flows) {
                v.coefficient += by_coefficient;
                v.exponent += by_exponent;
            }
        }
        if sought.curves {
            let of = |p: Point| {
                let dz = p.s.gradient_of(z) * p.v;
                self.by_curves(p, u1).into_iter().map(|p| contract(dz, p)).collect::<Vec<_>>()
            };
            self.each(of).iter().for_each(|by| self.c.pull_curves(by, gradient));
        }
        if let (Some(out), true) = (&mut gradient.changes.rest, self.c.altered.points.is_some()) {
            self.gather(|p| self.pull_rest(p, u1, z) * p.v, out);
        }
        if sought.modulus {
            self.c.pull_modulus(all.iter().enumerate().map(|(e, g)| (points.element_of(e), g[0])), gradient);
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.add_force(u1, &mut out.elastic);
    }
}
