//! Laws of cells on tetrahedra: every element gives them its mean deformation, F at the point that has its mean, and its volume.
//!
//! With ε = S − I of F = R S, a = ½ ε:C:ε/E and d that of ε₁ − ε̃, ε̃ = Σ w ε(x_past), the incremental potential is
//! E V [θ ψ(a, ε₁) + φ(d, a₀) + (1 − θ) P_ψ(F₀):F₁]: what `elastic_cells::laws` has for cells, where q takes the place of ε. All derivatives follow from
//! those of a law by the chain rule, first to ε (`Slopes`) and then to F ([`Stretch`]).

mod slopes;

use super::elastic_cells::laws::CellActing;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_blocks};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::materials::Gradient;
use palpate_model::materials::stretching::Stretch;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::stencil::Stencil;
use rayon::prelude::*;
use slopes::{At, Laws, Six, Slopes};

/// Elements that one task treats at least.
const CHUNK: usize = 16;

/// The term.
pub struct TetLaws<'a> {
    c: Context<'a>,
    laws: Laws<'a>,
    /// Young's modulus [Pa], creep included.
    young: f64,
    /// ε̃ of every element; empty in a static problem.
    past: Vec<Six>,
}

/// An element: number, mean, and what turns densities over E into J.
#[derive(Clone, Copy)]
struct Element<'a> {
    e: usize,
    s: Stencil<'a>,
    scale: f64,
}

fn rows(m: DMat3) -> Gradient<f64> {
    std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i]))
}

fn flat(m: DMat3) -> [f64; 9] {
    std::array::from_fn(|k| m.col(k % 3)[k / 3])
}

fn matrix_of(v: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(&std::array::from_fn(|k| v[3 * (k % 3) + k / 3]))
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// a + s b.
fn plus<const N: usize>(a: [f64; N], s: f64, b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|k| a[k] + s * b[k])
}

fn product<const N: usize>(m: &[[f64; N]; N], v: &[f64; N]) -> [f64; N] {
    m.map(|row| dot(&row, v))
}

fn transposed(m: &[[f64; 6]; 6], v: &Six) -> Six {
    std::array::from_fn(|k| (0..6).map(|c| m[c][k] * v[c]).sum())
}

impl<'a> TetLaws<'a> {
    /// Takes the past's strains.
    pub fn new(c: Context<'a>) -> TetLaws<'a> {
        let nu = c.physics().poisson_ratio;
        let laws = Laws {
            all: &c.altered.laws,
            lame: [lame(1.0, nu), lame_by_nu(1.0, nu)],
            rate: c.inertia.map_or(0.0, |t| t.rate),
            new: c.weights.new,
        };
        let mut term = TetLaws { c, laws, young: c.young(), past: Vec::new() };
        if c.inertia.is_some() {
            let sum = |e: Element| {
                c.past.each.iter().fold([0.0; 6], |sum, (w, u)| plus(sum, *w, Stretch::new(&rows(e.s.gradient_of(u))).value))
            };
            term.past = term.each(sum);
        }
        term
    }

    fn element(&self, e: usize) -> Element<'a> {
        let points = &self.c.plan.body.points;
        Element { e, s: points.mean(e), scale: self.young * self.c.factor(e) * points.element_volume(e) }
    }

    /// A value of every element.
    fn each<T: Send>(&self, of: impl Fn(Element<'a>) -> T + Sync + Send) -> Vec<T> {
        (0..self.c.plan.body.elements()).into_par_iter().with_min_len(CHUNK).map(|e| of(self.element(e))).collect()
    }

    /// Adds P g of every element to its nodes, where `of` gives P times the volume: element by element.
    fn gather(&self, of: impl Fn(Element<'a>) -> [f64; 9] + Sync + Send, out: &mut [DVec3]) {
        for (p, s) in self.each(of).iter().zip(self.c.plan.body.points.means()) {
            s.spread_gradient(matrix_of(p), out);
        }
    }

    /// The stretch of an element's mean at a displacement.
    fn stretch(&self, el: Element, u: &[DVec3]) -> Stretch {
        Stretch::new(&rows(el.s.gradient_of(u)))
    }

    /// The laws at the new state.
    fn now(&self, el: Element, u1: &[DVec3]) -> (Stretch, Slopes) {
        let new = self.stretch(el, u1);
        let slopes = self.laws.slopes(&new.value, self.past.get(el.e));
        (new, slopes)
    }

    /// The old state's own stress P_ψ(F₀) over E.
    fn old_stress(&self, el: Element) -> [f64; 9] {
        let old = self.stretch(el, self.c.past.u);
        old.back(&self.laws.energy_slopes(&old.value).0)
    }

    /// Whole stress over E, the old state's share included.
    fn stress(&self, el: Element, u1: &[DVec3]) -> [f64; 9] {
        let (new, slopes) = self.now(el, u1);
        let p = new.back(&slopes.first);
        if self.c.weights.old == 0.0 { p } else { plus(p, self.c.weights.old, self.old_stress(el)) }
    }

    /// Derivative of P_ψ at a displacement, times a change of F.
    fn own_rate(&self, el: Element, u: &[DVec3], df: &[f64; 9]) -> [f64; 9] {
        let h = rows(el.s.gradient_of(u));
        let at = Stretch::new(&h);
        let (first, second) = self.laws.energy_slopes(&at.value);
        plus(at.back(&product(&second, &at.along(df))), 1.0, product(&Stretch::bend(&h, &first), df))
    }

    fn add_force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        self.gather(|el| self.stress(el, u1).map(|p| el.scale * p), out);
    }

    /// Stress over E that changes of ∂(θ ψ + φ)/∂ε₁ and of ∂ψ/∂ε₀ give.
    fn work(&self, el: Element, u1: &[DVec3], of: impl Fn(&At) -> Six) -> [f64; 9] {
        let new = self.stretch(el, u1);
        let mut p = new.back(&of(&At { strain: &new.value, past: self.past.get(el.e), weight: self.c.weights.new }));
        if self.c.weights.old != 0.0 {
            let old = self.stretch(el, self.c.past.u);
            p = plus(p, self.c.weights.old, old.back(&of(&At { strain: &old.value, past: None, weight: 1.0 })));
        }
        p
    }
}

impl Term for TetLaws<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.add_force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let of = |el: Element| {
            let h = el.s.gradient_of(u1);
            let value = self.laws.potential(&self.stretch(el, u1).value, self.past.get(el.e));
            let old = if self.c.weights.old == 0.0 { 0.0 } else { self.c.weights.old * dot(&self.old_stress(el), &flat(h)) };
            el.scale * (value + old)
        };
        self.each(of).iter().sum()
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        let of = |el: Element| {
            let h = rows(el.s.gradient_of(u1));
            let (new, slopes) = self.now(el, u1);
            let bend = Stretch::bend(&h, &slopes.first);
            let image: [[f64; 6]; 9] = std::array::from_fn(|l| product(&slopes.second, &new.slopes.map(|row| row[l])));
            let entry = |k: usize, l: usize| bend[k][l] + (0..6).map(|c| new.slopes[c][k] * image[l][c]).sum::<f64>();
            let mut t: [[f64; 9]; 9] = std::array::from_fn(|k| std::array::from_fn(|l| el.scale * entry(k, l)));
            if curvature != Curvature::Exact {
                crate::linear::dense::without_negative_eigenvalues(&mut t);
            }
            t
        };
        let points = &self.c.plan.body.points;
        for (e, t) in self.each(of).iter().enumerate() {
            add_blocks(points.mean(e).gradient, self.c.places.points.of(points.mean_point(e)), t, matrix);
        }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        for (i, ((weight, u), d)) in self.c.past.each.iter().zip(change.each).enumerate() {
            let of = |el: Element| {
                let (new, slopes) = self.now(el, u1);
                let df = flat(el.s.gradient_of(d));
                let strain = self.stretch(el, u).along(&df).map(|s| weight * s);
                let mut p = new.back(&product(&slopes.by_past, &strain));
                if self.c.weights.old != 0.0 && i == 0 {
                    p = plus(p, self.c.weights.old, self.own_rate(el, u, &df));
                }
                p.map(|p| el.scale * p)
            };
            self.gather(of, out);
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        for (i, ((weight, u), to)) in self.c.past.each.iter().zip(&mut out.each).enumerate() {
            let of = |el: Element| {
                let (new, slopes) = self.now(el, u1);
                let dz = flat(el.s.gradient_of(z));
                let strain = transposed(&slopes.by_past, &new.along(&dz)).map(|s| weight * s);
                let mut p = self.stretch(el, u).back(&strain);
                if self.c.weights.old != 0.0 && i == 0 {
                    p = plus(p, self.c.weights.old, self.own_rate(el, u, &dz));
                }
                p.map(|p| el.scale * p)
            };
            self.gather(of, to);
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (ln_young, d) = (self.c.ln_young_along(rates), &rates.physics);
        let moved = |l: &&CellActing| d.effects[l.effect].iter().any(|r| *r != 0.0);
        let moving: Vec<&CellActing> = self.laws.all.iter().filter(moved).collect();
        let of = |el: Element| {
            let ln = ln_young + self.c.ln_factor_along(rates, el.e);
            let mut p = if ln == 0.0 { [0.0; 9] } else { self.stress(el, u1).map(|p| ln * p) };
            if d.poisson_ratio != 0.0 {
                p = plus(p, d.poisson_ratio, self.work(el, u1, |at| self.laws.by_poisson(at)));
            }
            for l in &moving {
                for (slot, rate) in d.effects[l.effect].iter().enumerate().filter(|(_, r)| **r != 0.0) {
                    p = plus(p, *rate, self.work(el, u1, |at| self.laws.by_number(l, slot, at)));
                }
            }
            p.map(|p| el.scale * p)
        };
        self.gather(of, out);
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let asked: Vec<&CellActing> = self.laws.all.iter().filter(|l| sought.effects[l.effect]).collect();
        let of = |el: Element| {
            let dz = flat(el.s.gradient_of(z)).map(|z| el.scale * z);
            let ln = if sought.modulus { dot(&dz, &self.stress(el, u1)) } else { 0.0 };
            let poisson = match sought.poisson {
                true => dot(&dz, &self.work(el, u1, |at| self.laws.by_poisson(at))),
                false => 0.0,
            };
            let number = |l: &CellActing, slot: usize| dot(&dz, &self.work(el, u1, |at| self.laws.by_number(l, slot, at)));
            let numbers: Vec<f64> =
                asked.iter().flat_map(|l| (0..l.p.len()).map(move |slot| (l, slot))).map(|(l, s)| number(l, s)).collect();
            (ln, poisson, numbers)
        };
        let all = self.each(of);
        for (_, poisson, numbers) in &all {
            gradient.physics.poisson_ratio += poisson;
            let slots = asked.iter().flat_map(|l| (0..l.p.len()).map(|slot| (l.effect, slot)));
            numbers.iter().zip(slots).for_each(|(g, (effect, slot))| gradient.physics.effects[effect][slot] += g);
        }
        if sought.modulus {
            self.c.pull_modulus(all.iter().map(|a| a.0).enumerate(), gradient);
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.add_force(u1, &mut out.elastic);
    }
}
