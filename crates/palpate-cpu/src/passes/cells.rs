//! Elastic and viscous force of the cells, its derivatives by both states, and its energy.
//!
//! With q = Rᵀ(x − x_c) − X the body-frame displacement of a cell's corners, K its matrix and E Young's modulus, the force on
//! the new state x₁ is the gradient by x₁ of
//! `E [θ ½ q₁ᵀKq₁ + (β/2Δt) (q₁−q₀)ᵀK(q₁−q₀)] + (1−θ) f(x₀)·x₁`,
//! which is the θ-scheme of Weiss et al. 2020 (Eq. 14, with the sign corrected) written objectively: rigid motion costs nothing.

use crate::linear::simd::wide;
use crate::linear::vector::Nodes;
use glam::DVec3;
use palpate_model::cutcells::corotation::{CellPose, M24, V24, multiply};
use palpate_model::cutcells::elements::Elements;
use palpate_model::space::body::Body;
use palpate_model::space::pattern::Pattern;
use rayon::prelude::*;

/// Cells that one task treats in a row.
pub(super) const CHUNK: usize = 64;

/// Eight vectors, one per corner.
pub type Corners = [DVec3; 8];

/// How the two states enter the force.
#[derive(Clone, Copy, Debug)]
pub struct Mix {
    /// Weight of the new state's elastic force.
    pub new: f64,
    /// Weight of the old state's elastic force.
    pub old: f64,
    /// β/Δt: weight of the change between them.
    pub rate: f64,
}

impl Mix {
    /// The elastic force of one state alone.
    pub const STATIC: Mix = Mix { new: 1.0, old: 0.0, rate: 0.0 };

    /// Factors of q₁ and q₀ in the new pose's force.
    pub(super) fn factors(&self) -> (f64, f64) {
        (self.new + self.rate, -self.rate)
    }
}

/// Positions of a cell's corners at displacement `u`.
pub fn corners(body: &Body, e: usize, u: &[DVec3]) -> Corners {
    body.cells[e].nodes.map(|n| body.nodes[n as usize] + u[n as usize])
}

pub(super) fn pick(body: &Body, e: usize, v: &[DVec3]) -> Corners {
    body.cells[e].nodes.map(|n| v[n as usize])
}

#[inline(always)]
pub(super) fn times(k: &M24, q: &V24, scale: f64) -> V24 {
    multiply(k, q).map(|y| scale * y)
}

pub(super) fn dot24(a: &V24, b: &V24) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The two poses of a cell; without the old one where the balance does not see it.
struct Poses {
    new: CellPose,
    old: Option<CellPose>,
}

impl Poses {
    #[inline(always)]
    fn new(mix: &Mix, h: f64, x1: &Corners, x0: &Corners) -> Poses {
        let needs_old = mix.old != 0.0 || mix.rate != 0.0;
        Poses { new: CellPose::new(x1, h), old: needs_old.then(|| CellPose::new(x0, h)) }
    }

    /// Body-frame force that goes with the new pose, and the one that goes with the old pose.
    #[inline(always)]
    fn stress(&self, mix: &Mix, k: &M24, e: f64) -> (V24, Option<V24>) {
        let (a, b) = mix.factors();
        let zero = [0.0; 24];
        let q0 = self.old.as_ref().map_or(&zero, |p| &p.q);
        let combined: V24 = std::array::from_fn(|i| a * self.new.q[i] + b * q0[i]);
        let old = (mix.old != 0.0).then(|| times(k, q0, e * mix.old));
        (times(k, &combined, e), old)
    }

    #[inline(always)]
    fn force(&self, y: &(V24, Option<V24>)) -> Corners {
        let mut f = self.new.force(&y.0);
        if let (Some(old), Some(y0)) = (&self.old, &y.1) {
            let g = old.force(y0);
            for i in 0..8 {
                f[i] += g[i];
            }
        }
        f
    }
}

/// Which matrix a force is made with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrices {
    /// The stiffness.
    Stiffness,
    /// Its derivative by Poisson's ratio.
    ByPoisson,
}

/// Elasticity of one member: what all passes below share.
#[derive(Clone, Copy)]
pub struct Elasticity<'a> {
    /// The body.
    pub body: &'a Body,
    /// Who neighbours whom.
    pub pattern: &'a Pattern,
    /// Matrices at E = 1.
    pub elements: &'a Elements,
    /// Young's modulus [Pa].
    pub young: f64,
    /// Factor on it per cell, where effects change it.
    pub modulus: Option<&'a [f64]>,
    /// Every cell in the stress-free shape, where effects change that.
    pub rest: Option<&'a [CellPose]>,
}

impl<'a> Elasticity<'a> {
    fn matrix(&self, e: usize, which: Matrices) -> &'a M24 {
        let m = self.elements.cell(e);
        match which {
            Matrices::Stiffness => &m.k,
            Matrices::ByPoisson => &m.k_nu,
        }
    }

    #[inline(always)]
    fn poses(&self, mix: &Mix, e: usize, u1: &[DVec3], u0: &[DVec3]) -> Poses {
        let mut poses = Poses::new(mix, self.body.grid.h, &corners(self.body, e, u1), &corners(self.body, e, u0));
        self.shift(e, &mut poses.new);
        poses.old.iter_mut().for_each(|p| self.shift(e, p));
        poses
    }

    /// Measures a cell's deformation from the stress-free shape.
    #[inline(always)]
    pub(super) fn shift(&self, e: usize, pose: &mut CellPose) {
        if let Some(rest) = self.rest {
            pose.q.iter_mut().zip(&rest[e].q).for_each(|(q, w)| *q -= w);
        }
    }

    /// Stiffness of a cell at E = 1 Pa.
    pub(super) fn stiffness(&self, e: usize) -> &'a M24 {
        self.matrix(e, Matrices::Stiffness)
    }

    /// Its derivative by Poisson's ratio.
    pub(super) fn by_poisson(&self, e: usize) -> &'a M24 {
        self.matrix(e, Matrices::ByPoisson)
    }

    /// A cell in both states, for laws of cells.
    pub(super) fn both(&self, mix: &Mix, e: usize, u1: &[DVec3], u0: &[DVec3]) -> (CellPose, Option<CellPose>) {
        let poses = self.poses(mix, e, u1, u0);
        (poses.new, poses.old)
    }

    /// Factor on Young's modulus in a cell.
    pub(super) fn factor(&self, e: usize) -> f64 {
        self.modulus.map_or(1.0, |m| m[e])
    }

    /// Young's modulus in a cell [Pa].
    pub(super) fn young_of(&self, e: usize) -> f64 {
        self.young * self.factor(e)
    }

    /// A value of every cell.
    pub(super) fn each_cell<T: Clone + Default + Send>(&self, cell: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        let mut values = vec![T::default(); self.body.cells.len()];
        values.par_chunks_mut(CHUNK).enumerate().for_each(|(c, values)| {
            wide(
                #[inline(always)]
                || {
                    for (i, value) in values.iter_mut().enumerate() {
                        *value = cell(CHUNK * c + i);
                    }
                },
            );
        });
        values
    }

    /// Adds per-cell corner vectors to nodes, always in the same order.
    pub(super) fn gather(&self, cell: impl Fn(usize) -> Corners + Sync + Send, out: &mut [DVec3]) {
        let parts = self.each_cell(cell);
        self.sum_corners(|e, i| parts[e][i], out);
    }

    /// Adds vectors given by cell and corner to nodes, always in the same order.
    pub(super) fn sum_corners(&self, part: impl Fn(usize, usize) -> DVec3 + Sync, out: &mut [DVec3]) {
        let p = self.pattern;
        let sum = |a: usize, v: &mut DVec3| {
            for &(e, i) in &p.cell_list[p.cell_rows[a]..p.cell_rows[a + 1]] {
                *v += part(e as usize, i as usize);
            }
        };
        out.par_iter_mut().with_min_len(2048).enumerate().for_each(|(a, v)| sum(a, v));
    }

    /// Adds the force (left side of the balance) with modulus `young`, which may differ from the member's own (1 gives the
    /// derivative by Young's modulus).
    pub fn force(&self, mix: &Mix, which: Matrices, young: f64, u1: &[DVec3], u0: &[DVec3], out: &mut [DVec3]) {
        self.gather(
            #[inline(always)]
            |e| {
                let poses = self.poses(mix, e, u1, u0);
                let young = young * self.factor(e);
                let mut f = poses.force(&poses.stress(mix, self.matrix(e, which), young));
                if which == Matrices::Stiffness {
                    self.add_guard(mix, e, &poses.new, young, &mut f);
                }
                f
            },
            out,
        );
    }

    /// Derivative by the old state, for one cell: `b` Pᵀ_to E K P_from d, and the symmetric share of the
    /// old state's own force. `[from, to]` is [old, new]; the other way round it is the transpose.
    fn cell_by_old(
        &self,
        mix: &Mix,
        k: &M24,
        old: &CellPose,
        [from, to]: [&CellPose; 2],
        [young, b]: [f64; 2],
        d: &Corners,
    ) -> Corners {
        let mut f = to.force(&times(k, &from.strain_rate(d), young * b));
        if mix.old != 0.0 {
            let y0 = times(k, &old.q, young * mix.old);
            let g = old.hessian_product(k, young * mix.old, &y0, d);
            for i in 0..8 {
                f[i] += g[i];
            }
        }
        f
    }

    /// Adds (∂force/∂u₀) du₀.
    pub fn by_old(&self, mix: &Mix, u1: &[DVec3], u0: &[DVec3], du0: &[DVec3], out: &mut [DVec3]) {
        self.gather(
            #[inline(always)]
            |e| {
                let poses = self.poses(mix, e, u1, u0);
                let (k, young) = (self.matrix(e, Matrices::Stiffness), self.young_of(e));
                let d = pick(self.body, e, du0);
                let b = mix.factors().1;
                if let Some(old) = &poses.old {
                    self.cell_by_old(mix, k, old, [old, &poses.new], [young, b], &d)
                } else {
                    [DVec3::ZERO; 8]
                }
            },
            out,
        );
    }

    /// Adds (∂force/∂u₀)ᵀ z.
    pub fn by_old_transposed(&self, mix: &Mix, u1: &[DVec3], u0: &[DVec3], z: &[DVec3], out: &mut [DVec3]) {
        self.gather(
            #[inline(always)]
            |e| {
                let poses = self.poses(mix, e, u1, u0);
                let (k, young) = (self.matrix(e, Matrices::Stiffness), self.young_of(e));
                let d = pick(self.body, e, z);
                let b = mix.factors().1;
                if let Some(old) = &poses.old {
                    self.cell_by_old(mix, k, old, [&poses.new, old], [young, b], &d)
                } else {
                    [DVec3::ZERO; 8]
                }
            },
            out,
        );
    }

    /// Adds the force's derivative by a change `dw` [m] of the stress-free shape at the nodes.
    pub fn by_rest(&self, mix: &Mix, u1: &[DVec3], u0: &[DVec3], dw: &[DVec3], out: &mut [DVec3]) {
        let Some(rest) = self.rest else { return };
        self.gather(
            |e| {
                let poses = self.poses(mix, e, u1, u0);
                let ds = rest[e].strain_rate(&pick(self.body, e, dw));
                let y = times(self.matrix(e, Matrices::Stiffness), &ds, -self.young_of(e));
                // The rate's part does not see it: both states shift alike.
                let mut f = poses.new.force(&y.map(|y| mix.new * y));
                if let (Some(old), true) = (&poses.old, mix.old != 0.0) {
                    for (f, g) in f.iter_mut().zip(old.force(&y)) {
                        *f += mix.old * g;
                    }
                }
                f
            },
            out,
        );
    }
}

/// A zero vector for `n` nodes.
pub fn zeros(n: usize) -> Nodes {
    vec![DVec3::ZERO; n]
}
