//! Laws of cells on tetrahedra: every element gives them its mean deformation, F at the point that has its mean, and its volume.
//!
//! With ε = S − I of F = R S, a = ½ ε:C:ε/E and d that of ε₁ − ε̃, ε̃ = Σ w ε(x_past), the incremental potential is
//! E V [θ ψ(a, ε₁) + φ(d, a₀) + (1 − θ) P_ψ(F₀):F₁]: what `elastic_cells::laws` has for cells, where q takes the place of ε. All derivatives follow from
//! those of a law by the chain rule, first to ε (`Slopes`) and then to F ([`Stretch`]).

mod slopes;

use super::elastic_cells::laws::CellActing;
use super::unstrained;
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

/// An element: number, mean, what is taken off a displacement's gradient, and what turns densities over E into J.
#[derive(Clone, Copy)]
struct Element<'a> {
    e: usize,
    s: Stencil<'a>,
    shift: DMat3,
    scale: f64,
}

impl Element<'_> {
    /// H = F − I at a displacement.
    fn h(&self, u: &[DVec3]) -> Gradient<f64> {
        rows(self.s.gradient_of(u) - self.shift)
    }

    /// F at a displacement.
    fn f(&self, u: &[DVec3]) -> DMat3 {
        self.s.gradient_of(u) - self.shift + DMat3::IDENTITY
    }
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
            let sum = |e: Element| c.past.each.iter().fold([0.0; 6], |sum, (w, u)| plus(sum, *w, Stretch::new(&e.h(u)).value));
            term.past = term.each(sum);
        }
        term
    }

    fn element(&self, e: usize) -> Element<'a> {
        let points = &self.c.plan.body.points;
        let (mean, young) = (points.mean_point(e), self.young * self.c.factor(e));
        match &self.c.altered.points {
            None => Element { e, s: points.mean(e), shift: DMat3::ZERO, scale: young * points.volume[mean] },
            Some(p) => Element { e, s: p.stencils.get(mean), shift: p.shift[mean], scale: young * p.volume[mean] },
        }
    }

    /// A value of every element.
    fn each<T: Send>(&self, of: impl Fn(Element<'a>) -> T + Sync + Send) -> Vec<T> {
        (0..self.c.plan.body.elements()).into_par_iter().with_min_len(CHUNK).map(|e| of(self.element(e))).collect()
    }

    /// Adds P g of every element to its nodes, where `of` gives P times the volume: element by element.
    fn gather(&self, of: impl Fn(Element<'a>) -> [f64; 9] + Sync + Send, out: &mut [DVec3]) {
        for (e, p) in self.each(of).iter().enumerate() {
            self.element(e).s.spread_gradient(matrix_of(p), out);
        }
    }

    /// The stretch of an element's mean at a displacement.
    fn stretch(&self, el: Element, u: &[DVec3]) -> Stretch {
        Stretch::new(&el.h(u))
    }

    /// The laws at the new state.
    fn now(&self, el: Element, u1: &[DVec3]) -> (Stretch, Slopes) {
        let new = self.stretch(el, u1);
        let slopes = self.laws.slopes(Curvature::Exact, &new.value, self.past.get(el.e));
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
        let h = el.h(u);
        let at = Stretch::new(&h);
        let (first, second) = self.laws.energy_slopes(&at.value);
        plus(at.back(&product(&second, &at.along(df))), 1.0, product(&Stretch::bend(&h, &first), df))
    }

    /// Change of the whole stress over E when F at the new state changes; symmetric.
    fn along_new(&self, el: Element, u1: &[DVec3], df: &[f64; 9]) -> [f64; 9] {
        let (new, slopes) = self.now(el, u1);
        let p = new.back(&product(&slopes.second, &new.along(df)));
        plus(p, 1.0, product(&Stretch::bend(&el.h(u1), &slopes.first), df))
    }

    /// The same with past state `i`.
    fn along_past(&self, el: Element, i: usize, u1: &[DVec3], df: &[f64; 9]) -> [f64; 9] {
        let ((new, slopes), (weight, u)) = (self.now(el, u1), self.c.past.each[i]);
        let strain = self.stretch(el, u).along(df).map(|s| weight * s);
        let p = new.back(&product(&slopes.by_past, &strain));
        self.with_own(el, i, df, p)
    }

    /// Its transpose.
    fn pull_past(&self, el: Element, i: usize, u1: &[DVec3], dz: &[f64; 9]) -> [f64; 9] {
        let ((new, slopes), (weight, u)) = (self.now(el, u1), self.c.past.each[i]);
        let strain = transposed(&slopes.by_past, &new.along(dz)).map(|s| weight * s);
        let p = self.stretch(el, u).back(&strain);
        self.with_own(el, i, dz, p)
    }

    /// Adds what the old state's own stress changes by, which is symmetric.
    fn with_own(&self, el: Element, i: usize, df: &[f64; 9], p: [f64; 9]) -> [f64; 9] {
        match self.c.weights.old != 0.0 && i == 0 {
            true => plus(p, self.c.weights.old, self.own_rate(el, self.c.past.each[i].1, df)),
            false => p,
        }
    }

    /// Change of the whole stress over E when the stress-free shape moves by `dw`.
    fn along_rest(&self, el: Element, u1: &[DVec3], dw: &[DVec3]) -> [f64; 9] {
        let l = el.s.gradient_of(dw);
        let away = |u: &[DVec3]| flat(el.f(u) * l * -1.0);
        let past = (0..self.c.past.each.len()).map(|i| self.along_past(el, i, u1, &away(self.c.past.each[i].1)));
        let change = past.fold(self.along_new(el, u1, &away(u1)), |sum, p| plus(sum, 1.0, p));
        flat(unstrained::moved(l, matrix_of(&self.stress(el, u1)), matrix_of(&change)))
    }

    /// Its transpose, before it goes to the nodes.
    fn pull_rest(&self, el: Element, u1: &[DVec3], z: &[DVec3]) -> [f64; 9] {
        let dz = el.s.gradient_of(z);
        let new = std::iter::once((el.f(u1), self.along_new(el, u1, &flat(dz))));
        let past = (0..self.c.past.each.len()).map(|i| (el.f(self.c.past.each[i].1), self.pull_past(el, i, u1, &flat(dz))));
        let states = new.chain(past).map(|(f, p)| (f, matrix_of(&p)));
        flat(unstrained::pulled(dz, matrix_of(&self.stress(el, u1)), states))
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
            let h = flat(el.f(u1) - DMat3::IDENTITY);
            let value = self.laws.potential(&self.stretch(el, u1).value, self.past.get(el.e));
            let old = if self.c.weights.old == 0.0 { 0.0 } else { self.c.weights.old * dot(&self.old_stress(el), &h) };
            el.scale * (value + old)
        };
        self.each(of).iter().sum()
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        let of = |el: Element| {
            let new = self.stretch(el, u1);
            let slopes = self.laws.slopes(curvature, &new.value, self.past.get(el.e));
            let bend = Stretch::bend(&el.h(u1), &slopes.first);
            let image: [[f64; 6]; 9] = std::array::from_fn(|l| product(&slopes.second, &new.slopes.map(|row| row[l])));
            let entry = |k: usize, l: usize| bend[k][l] + (0..6).map(|c| new.slopes[c][k] * image[l][c]).sum::<f64>();
            let mut t: [[f64; 9]; 9] = std::array::from_fn(|k| std::array::from_fn(|l| el.scale * entry(k, l)));
            if !curvature.keeps() {
                crate::linear::dense::without_negative_eigenvalues(&mut t);
            }
            t
        };
        let points = &self.c.plan.body.points;
        for (e, t) in self.each(of).iter().enumerate() {
            add_blocks(self.element(e).s.gradient, self.c.places.points.of(points.mean_point(e)), t, matrix);
        }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        for (i, d) in change.each.iter().enumerate() {
            let of = |el: Element| self.along_past(el, i, u1, &flat(el.s.gradient_of(d))).map(|p| el.scale * p);
            self.gather(of, out);
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        for (i, to) in out.each.iter_mut().enumerate() {
            let of = |el: Element| self.pull_past(el, i, u1, &flat(el.s.gradient_of(z))).map(|p| el.scale * p);
            self.gather(of, to);
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (ln_young, d) = (self.c.ln_young_along(rates), &rates.physics);
        let moved = |l: &&CellActing| d.effects[l.effect].iter().any(|r| *r != 0.0);
        let moving: Vec<&CellActing> = self.laws.all.iter().filter(moved).collect();
        let rest = rates.changes.rest.as_deref().filter(|_| self.c.altered.points.is_some());
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
            if let Some(dw) = rest {
                p = plus(p, 1.0, self.along_rest(el, u1, dw));
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
        if let (Some(out), true) = (&mut gradient.changes.rest, self.c.altered.points.is_some()) {
            self.gather(|el| self.pull_rest(el, u1, z).map(|p| el.scale * p), out);
        }
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
