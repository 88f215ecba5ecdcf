//! What laws of cells say of a strain: potential and its derivatives by ε₁ and ε̃, over E.

use super::{dot, plus};
use crate::terms::Curvature;
use crate::terms::elastic_cells::laws::material::{linear_stress, linear_tangent};
use crate::terms::elastic_cells::laws::{CellActing, input};
use palpate_model::effects::cell::{ENERGY, Part};
use palpate_model::materials::stretching::PAIRS;

/// xx, yy, zz, yz, zx, xy.
pub(super) type Six = [f64; 6];

/// The laws of a solve.
#[derive(Clone, Copy)]
pub(super) struct Laws<'a> {
    pub(super) all: &'a [CellActing],
    /// λ and μ over E, and their derivatives by Poisson's ratio.
    pub(super) lame: [(f64, f64); 2],
    /// 1/ℓ [1/s]; 0 in a static problem.
    pub(super) rate: f64,
    /// Weight of the new state.
    pub(super) new: f64,
}

/// Where changes of derivatives are taken: a strain, the past where what is lost counts, and the weight of the energy.
pub(super) struct At<'b> {
    pub(super) strain: &'b Six,
    pub(super) past: Option<&'b Six>,
    pub(super) weight: f64,
}

/// Derivatives of θ ψ + φ.
#[derive(Clone, Copy)]
pub(super) struct Slopes {
    /// By ε₁.
    pub(super) first: Six,
    /// By ε₁ twice.
    pub(super) second: [Six; 6],
    /// By ε₁, then by ε̃.
    pub(super) by_past: [Six; 6],
}

/// C ε over E for these Lamé parameters.
fn stress(strain: &Six, lame: (f64, f64)) -> Six {
    let trace = strain[0] + strain[1] + strain[2];
    std::array::from_fn(|c| linear_stress(PAIRS[c], strain[c], trace, lame))
}

/// m + s a bᵀ.
fn outer(m: &mut [Six; 6], s: f64, a: &Six, b: &Six) {
    (0..6).for_each(|c| m[c] = plus(m[c], s * a[c], *b));
}

impl<'a> Laws<'a> {
    /// The laws that are not absent.
    fn acting(&self) -> impl Iterator<Item = &'a CellActing> {
        self.all.iter().filter(|l| !l.absent)
    }

    /// Those that lose something in a step.
    fn losing(&self) -> impl Iterator<Item = &'a CellActing> {
        let part = self.loss();
        self.acting().filter(move |l| l.law.needs(part) > 0)
    }

    fn loss(&self) -> Part {
        Part::Loss { rate: self.rate }
    }

    /// ½ ε:C:ε over E, and all scalars of the energy.
    fn scalars(&self, strain: &Six) -> [f64; ENERGY] {
        let density = 0.5 * dot(strain, &stress(strain, self.lame[0]));
        std::array::from_fn(|k| if k == 0 { density } else { strain[k - 1] })
    }

    /// d and a₀ of a step.
    fn increment(&self, strain: &Six, past: &Six) -> (Six, [f64; 2]) {
        let change = plus(*strain, -1.0, *past);
        let of = |s: &Six| 0.5 * dot(s, &stress(s, self.lame[0]));
        (change, [of(&change), of(past)])
    }

    /// θ ψ + φ.
    pub(super) fn potential(&self, strain: &Six, past: Option<&Six>) -> f64 {
        let s = self.scalars(strain);
        let value = |l: &CellActing, part: Part, scalars: &[f64]| {
            let (z, len) = input(scalars, &l.p);
            l.law.value(part, &z[..len])
        };
        let stored: f64 = self.acting().map(|l| value(l, Part::Energy, &s)).sum();
        let lost: f64 = match past.filter(|_| self.rate > 0.0) {
            Some(past) => self.losing().map(|l| value(l, self.loss(), &self.increment(strain, past).1)).sum(),
            None => 0.0,
        };
        self.new * stored + lost
    }

    /// Derivatives of ψ by ε, first and second.
    pub(super) fn energy_slopes(&self, strain: &Six) -> (Six, [Six; 6]) {
        let (s, by_strain) = (self.scalars(strain), stress(strain, self.lame[0]));
        let (mut first, mut second) = ([0.0; 6], [[0.0; 6]; 6]);
        for l in self.acting() {
            let (z, len) = input(&s, &l.p);
            let needs = l.law.needs(Part::Energy);
            let slope = |i: usize, j: usize| l.law.slopes(Part::Energy, &z[..len], i, j);
            let [by_density, _, twice] = slope(0, 0);
            first = plus(first, by_density, by_strain);
            outer(&mut second, twice, &by_strain, &by_strain);
            for c in 0..6 {
                for d in 0..6 {
                    second[c][d] += by_density * linear_tangent(c, d, self.lame[0]);
                }
            }
            // Of a law that sees the density alone the others are zero.
            for c in 1..needs {
                let [own, _, mixed] = slope(c, 0);
                first[c - 1] += own;
                for d in 0..6 {
                    second[c - 1][d] += mixed * by_strain[d];
                    second[d][c - 1] += mixed * by_strain[d];
                }
                for d in 1..=c {
                    let both = slope(c, d)[2];
                    second[c - 1][d - 1] += both;
                    if c != d {
                        second[d - 1][c - 1] += both;
                    }
                }
            }
        }
        (first, second)
    }

    /// All derivatives of θ ψ + φ; the second ones by the strain with the curvature that is wanted.
    pub(super) fn slopes(&self, curvature: Curvature, strain: &Six, past: Option<&Six>) -> Slopes {
        let (first, second) = self.energy_slopes(strain);
        let mut all = Slopes {
            first: first.map(|f| self.new * f),
            second: second.map(|row| row.map(|s| self.new * s)),
            by_past: [[0.0; 6]; 6],
        };
        let Some(past) = past.filter(|_| self.rate > 0.0) else { return all };
        let (change, scalars) = self.increment(strain, past);
        let (by_change, by_past) = (stress(&change, self.lame[0]), stress(past, self.lame[0]));
        for l in self.losing() {
            let (z, len) = input(&scalars, &l.p);
            let [by_d, _, by_dd] = l.law.slopes(self.loss(), &z[..len], 0, 0);
            let by_da = l.law.slopes(self.loss(), &z[..len], 0, 1)[2];
            all.first = plus(all.first, by_d, by_change);
            outer(&mut all.second, curvature.of_dissipation(by_dd), &by_change, &by_change);
            outer(&mut all.by_past, -by_dd, &by_change, &by_change);
            outer(&mut all.by_past, by_da, &by_change, &by_past);
            for c in 0..6 {
                for d in 0..6 {
                    let linear = by_d * linear_tangent(c, d, self.lame[0]);
                    all.second[c][d] += linear;
                    all.by_past[c][d] -= linear;
                }
            }
        }
        all
    }

    /// Change of the derivatives by ε₁ with Poisson's ratio.
    pub(super) fn by_poisson(&self, &At { strain, past, weight }: &At) -> Six {
        let of = |s: &Six| (stress(s, self.lame[0]), stress(s, self.lame[1]));
        let (by_strain, changed) = of(strain);
        let by_density = 0.5 * dot(strain, &changed);
        let s = self.scalars(strain);
        let mut energy = [0.0; 6];
        for l in self.acting() {
            let (z, len) = input(&s, &l.p);
            let [first, _, twice] = l.law.slopes(Part::Energy, &z[..len], 0, 0);
            energy = plus(plus(energy, first, changed), twice * by_density, by_strain);
            for c in 1..l.law.needs(Part::Energy) {
                energy[c - 1] += l.law.slopes(Part::Energy, &z[..len], c, 0)[2] * by_density;
            }
        }
        let mut all = energy.map(|v| weight * v);
        let Some(past) = past.filter(|_| self.rate > 0.0) else { return all };
        let (change, scalars) = self.increment(strain, past);
        let ((by_change, changed), by_d_nu) = (of(&change), 0.5 * dot(&change, &of(&change).1));
        let by_a_nu = 0.5 * dot(past, &of(past).1);
        for l in self.losing() {
            let (z, len) = input(&scalars, &l.p);
            let [by_d, _, by_dd] = l.law.slopes(self.loss(), &z[..len], 0, 0);
            let by_da = l.law.slopes(self.loss(), &z[..len], 0, 1)[2];
            all = plus(plus(all, by_d, changed), by_dd * by_d_nu + by_da * by_a_nu, by_change);
        }
        all
    }

    /// The same with number `slot` of a law, absent or not.
    pub(super) fn by_number(&self, l: &CellActing, slot: usize, &At { strain, past, weight }: &At) -> Six {
        let mixed = |part: Part, scalars: &[f64], k: usize| {
            let (z, len) = input(scalars, &l.p);
            l.law.slopes(part, &z[..len], k, scalars.len() + slot)[2]
        };
        let s = self.scalars(strain);
        let mut all = stress(strain, self.lame[0]).map(|v| mixed(Part::Energy, &s, 0) * v);
        for c in 1..l.law.needs(Part::Energy) {
            all[c - 1] += mixed(Part::Energy, &s, c);
        }
        all = all.map(|v| weight * v);
        if let Some(past) = past.filter(|_| self.rate > 0.0 && l.law.needs(self.loss()) > 0) {
            let (change, scalars) = self.increment(strain, past);
            all = plus(all, mixed(self.loss(), &scalars, 0), stress(&change, self.lame[0]));
        }
        all
    }
}
