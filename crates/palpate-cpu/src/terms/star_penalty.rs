//! What keeps stars of a cloud from moving otherwise than affinely (`palpate_model::space::stars::penalty`).
//!
//! The potential is ½ γ μ_i u·A_i u of every star with θ, and the old state's force with 1 − θ. μ = E/(2 (1 + ν)) carries its derivatives by the
//! modulus, its field and Poisson's ratio. It is elastic: damping in proportion to stiffness leaves it out, because its rate is not objective.

use super::products::{Part, Parts, padded};
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, add_to_diagonal};
use crate::linear::matrix::Matrix;
use crate::linear::simd::wide;
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::stars::penalty::Penalty;
use rayon::prelude::*;

/// Stars that one task treats at least.
const CHUNK: usize = 64;
/// Nodes that one task sums at least.
const NODES: usize = 256;
/// Nodes that one task multiplies.
const PIECE: usize = 512;

/// The term.
pub struct StarPenalty<'a> {
    c: Context<'a>,
    penalty: &'a Penalty,
    /// γ times the shear modulus [Pa], creep included, where no field varies it.
    stiffness: f64,
}

impl<'a> StarPenalty<'a> {
    /// Of one solve.
    pub fn new(c: Context<'a>, penalty: &'a Penalty) -> StarPenalty<'a> {
        StarPenalty { c, penalty, stiffness: penalty.factor * c.young() / (2.0 * (1.0 + c.physics().poisson_ratio)) }
    }

    fn nodes(&self, star: usize) -> &'a [u32] {
        self.c.plan.body.points.mean(star).nodes
    }

    /// γ μ of a star [Pa].
    fn stiffness_of(&self, star: usize) -> f64 {
        self.stiffness * self.c.factor(star)
    }

    /// A u of a star, node by node [m²].
    fn product<'b>(&'b self, star: usize, u: &'b [DVec3]) -> impl Iterator<Item = DVec3> + 'b {
        let nodes = self.nodes(star);
        let row = move |row: &[f64]| row.iter().zip(nodes).map(|(a, n)| *a * u[*n as usize]).sum::<DVec3>();
        self.penalty.of(star).chunks_exact(nodes.len()).map(row)
    }

    /// z·A u of a star.
    fn form(&self, star: usize, z: &[DVec3], u: &[DVec3]) -> f64 {
        self.nodes(star).iter().zip(self.product(star, u)).map(|(n, f)| z[*n as usize].dot(f)).sum()
    }

    /// Σ A of all stars by block, each times its factor on the modulus: the same at every state.
    fn springs(&self) -> &'a [f64] {
        self.c.springs.get_or_init(|| {
            let mut all = vec![0.0; self.c.pattern.blocks.columns.len()];
            for star in 0..self.stars() {
                let factor = self.c.factor(star);
                let places = self.c.places.points.of(star);
                self.penalty.of(star).iter().zip(places).for_each(|(a, place)| all[*place as usize] += factor * a);
            }
            all
        })
    }

    fn stars(&self) -> usize {
        self.c.plan.body.points.len()
    }

    /// A number of every star.
    fn each(&self, of: impl Fn(usize) -> f64 + Sync + Send) -> Vec<f64> {
        (0..self.stars()).into_par_iter().with_min_len(CHUNK).map(of).collect()
    }

    /// Adds `scale` of each star times A u, every node's sum in the order of the stars.
    fn add(&self, scale: impl Fn(usize) -> f64 + Sync, u: &[DVec3], out: &mut [DVec3]) {
        let pattern = self.c.pattern;
        out.par_iter_mut().with_min_len(NODES).enumerate().for_each(|(n, sum)| {
            for (star, i) in &pattern.point_list[pattern.point_rows[n]..pattern.point_rows[n + 1]] {
                let (star, nodes) = (*star as usize, self.nodes(*star as usize));
                let row = &self.penalty.of(star)[usize::from(*i) * nodes.len()..][..nodes.len()];
                *sum += scale(star) * row.iter().zip(nodes).map(|(a, n)| *a * u[*n as usize]).sum::<DVec3>();
            }
        });
    }

    /// θ u₁ + (1 − θ) u₀, which the force is linear in.
    fn mean(&self, u1: &[DVec3]) -> Vec<DVec3> {
        let w = self.c.weights;
        match w.old != 0.0 {
            true => u1.iter().zip(self.c.past.u).map(|(a, b)| w.new * *a + w.old * *b).collect(),
            false => u1.iter().map(|u| w.new * *u).collect(),
        }
    }

    /// Change of the logarithm of a star's shear modulus along `rates`.
    fn ln_along(&self, rates: &Coefficients, star: usize) -> f64 {
        let by_poisson = -rates.physics.poisson_ratio / (1.0 + self.c.physics().poisson_ratio);
        self.c.ln_young_along(rates) + self.c.ln_factor_along(rates, star) + by_poisson
    }
}

/// The term as products: its force is linear.
struct Springs<'a, 'b>(&'b StarPenalty<'a>);

impl Springs<'_, '_> {
    /// Σ A x of a node's row, where `springs` has A. Every fourth block is summed by itself, so no sum waits for the one before.
    #[inline(always)]
    fn row(&self, springs: &[f64], n: usize, x: &[[f64; 4]]) -> DVec3 {
        let blocks = &self.0.c.pattern.blocks;
        let range = blocks.rows[n]..blocks.rows[n + 1];
        let mut sums = [[0.0; 4]; 4];
        for (springs, columns) in springs[range.clone()].chunks(4).zip(blocks.columns[range].chunks(4)) {
            for ((sum, a), b) in sums.iter_mut().zip(springs).zip(columns) {
                let x = &x[*b as usize];
                for r in 0..4 {
                    sum[r] += a * x[r];
                }
            }
        }
        DVec3::from_array([0, 1, 2].map(|r| (sums[0][r] + sums[1][r]) + (sums[2][r] + sums[3][r])))
    }
}

impl Part for Springs<'_, '_> {
    fn add(&self, x: &[DVec3], y: &mut [DVec3]) {
        let (scale, springs, x) = (self.0.stiffness * self.0.c.weights.new, self.0.springs(), padded(x));
        y.par_chunks_mut(PIECE).enumerate().for_each(|(piece, y)| {
            wide(
                #[inline(always)]
                || {
                    for (i, y) in y.iter_mut().enumerate() {
                        *y += scale * self.row(springs, PIECE * piece + i, &x);
                    }
                },
            );
        });
    }
}

impl Term for StarPenalty<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.add(|s| self.stiffness_of(s), &self.mean(u1), out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let w = self.c.weights;
        let old = |s: usize| if w.old != 0.0 { w.old * self.form(s, u1, self.c.past.u) } else { 0.0 };
        self.each(|s| self.stiffness_of(s) * (0.5 * w.new * self.form(s, u1, u1) + old(s))).iter().sum()
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        for star in 0..self.stars() {
            let scale = self.stiffness_of(star) * self.c.weights.new;
            for (a, place) in self.penalty.of(star).iter().zip(self.c.places.points.of(star)) {
                add_to_diagonal(&mut matrix.values[*place as usize], scale * a);
            }
        }
    }

    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        Parts::Free(Box::new(Springs(self)))
    }

    fn by_past(&self, _u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        if let (true, Some(first)) = (self.c.weights.old != 0.0, change.each.first()) {
            self.add(|s| self.c.weights.old * self.stiffness_of(s), first, out);
        }
    }

    fn by_past_transposed(&self, _u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        if let (true, Some(first)) = (self.c.weights.old != 0.0, out.each.first_mut()) {
            self.add(|s| self.c.weights.old * self.stiffness_of(s), z, first);
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        self.add(|s| self.stiffness_of(s) * self.ln_along(rates, s), &self.mean(u1), out);
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        if !(sought.modulus || sought.poisson) {
            return;
        }
        let mean = self.mean(u1);
        let by_ln = self.each(|s| self.stiffness_of(s) * self.form(s, z, &mean));
        if sought.poisson {
            gradient.physics.poisson_ratio -= by_ln.iter().sum::<f64>() / (1.0 + self.c.physics().poisson_ratio);
        }
        if sought.modulus {
            self.c.pull_modulus(by_ln.into_iter().enumerate(), gradient);
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.add(|s| self.stiffness_of(s), &self.mean(u1), &mut out.elastic);
    }
}
