//! Elastic and viscous force of the cells.
//!
//! With q = Rᵀ(x − x_c) − X the body-frame displacement of a cell's corners, K its matrix and E Young's modulus, the force on
//! the new state x₁ is the gradient by x₁ of
//! `E [θ ½ q₁ᵀKq₁ + (β/2ℓ) (q₁−q̃)ᵀK(q₁−q̃)] + (1−θ) f(x₀)·x₁`, q̃ = Σ w q(x_past),
//! which is the θ-scheme of Weiss et al. 2020 (Eq. 14, with the sign corrected) written objectively: rigid motion costs nothing.

mod before;
pub mod blocks;
mod derivatives;
pub mod laws;

use super::assembly::assemble;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, Weights, zeros};
use crate::linear::matrix::Matrix;
use crate::linear::simd::wide;
use crate::linear::vector::Nodes;
use before::Before;
use blocks::Tangents;
use faer::{Mat, Side};
use glam::DVec3;
use laws::{CellLaws, LawState};
use palpate_model::cutcells::corotation::{CellPose, M24, V24, multiply};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::body::Body;
use rayon::prelude::*;

/// Cells that one task treats in a row.
const CHUNK: usize = 64;

/// Distance from the jump of the rotation (8/9 at rest) below which a cell's tangent may be far from positive definite: flattened to
/// half.
const SQUEEZED: f64 = 0.7;

/// Eight vectors, one per corner.
pub type Corners = [DVec3; 8];

/// Positions of a cell's corners at displacement `u`.
pub fn corners(body: &Body, e: usize, u: &[DVec3]) -> Corners {
    body.cells()[e].nodes.map(|n| body.nodes[n as usize] + u[n as usize])
}

fn pick(body: &Body, e: usize, v: &[DVec3]) -> Corners {
    body.cells()[e].nodes.map(|n| v[n as usize])
}

#[inline(always)]
fn times(k: &M24, q: &V24, scale: f64) -> V24 {
    multiply(k, q).map(|y| scale * y)
}

#[inline(always)]
fn dot24(a: &V24, b: &V24) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl Weights {
    /// Factors of q₁ and q̃ in the force of the new pose.
    fn factors(&self) -> (f64, f64) {
        (self.new + self.rate, -self.rate)
    }
}

/// The cells of one member: what the files of this folder share.
#[derive(Clone, Copy)]
pub(crate) struct Cells<'a> {
    pub(crate) c: Context<'a>,
    /// Young's modulus [Pa], creep included.
    young: f64,
}

impl<'a> Cells<'a> {
    pub(crate) fn new(c: Context<'a>) -> Cells<'a> {
        Cells { c, young: c.young() }
    }

    fn body(&self) -> &'a Body {
        &self.c.plan.body
    }

    /// Stiffness of a cell at E = 1 Pa.
    #[inline(always)]
    fn stiffness(&self, e: usize) -> &'a M24 {
        &self.c.elements.cell(e).k
    }

    /// Its derivative by Poisson's ratio.
    fn by_poisson(&self, e: usize) -> &'a M24 {
        &self.c.elements.cell(e).k_nu
    }

    /// Young's modulus in a cell [Pa].
    #[inline(always)]
    fn young_of(&self, e: usize) -> f64 {
        self.young * self.c.factor(e)
    }

    /// A cell at a displacement, its deformation measured from the stress-free shape.
    #[inline(always)]
    fn pose(&self, e: usize, u: &[DVec3]) -> CellPose {
        let mut pose = CellPose::new(&corners(self.body(), e, u), self.body().cut().grid.h);
        if let Some(rest) = &self.c.altered.rest {
            pose.q.iter_mut().zip(&rest[e].q).for_each(|(q, w)| *q -= w);
        }
        pose
    }

    /// E V of a cell times the weight of the new state [J]. The guard against inversion acts at the new state only, like contact.
    #[inline(always)]
    fn guard_scale(&self, e: usize) -> f64 {
        self.c.weights.new * self.young_of(e) * self.body().cells()[e].fraction * self.body().cut().grid.h.powi(3)
    }

    /// A value of every cell.
    fn each_cell<T: Clone + Default + Send>(&self, cell: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        let mut values = vec![T::default(); self.body().cells().len()];
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
    fn gather(&self, cell: impl Fn(usize) -> Corners + Sync + Send, out: &mut [DVec3]) {
        let parts = self.each_cell(cell);
        self.sum_corners(|e, i| parts[e][i], out);
    }

    /// Adds vectors given by cell and corner to nodes, always in the same order.
    fn sum_corners(&self, part: impl Fn(usize, usize) -> DVec3 + Sync, out: &mut [DVec3]) {
        let p = self.c.pattern;
        let sum = |a: usize, v: &mut DVec3| {
            for &(e, i) in &p.cell_list[p.cell_rows[a]..p.cell_rows[a + 1]] {
                *v += part(e as usize, i as usize);
            }
        };
        out.par_iter_mut().with_min_len(2048).enumerate().for_each(|(a, v)| sum(a, v));
    }
}

/// A cell at the new displacement.
#[derive(Clone, Copy, Debug)]
struct Posed {
    /// Its pose.
    pose: CellPose,
    /// Body-frame stress forces that go with the pose [N].
    stress: V24,
    /// Forces on its corners, without the old state's own [N].
    force: Corners,
}

/// Memory that a solve keeps of a cell at the new displacement [B].
pub(crate) const POSED: usize = size_of::<Posed>();

/// The term.
pub struct ElasticCells<'a> {
    cells: Cells<'a>,
    before: Before,
    /// Of the displacement that the last residual was computed at.
    posed: Vec<Posed>,
    /// What acts beyond linear elasticity, its state at that displacement, and its force at the old state.
    laws: Option<CellLaws<'a>>,
    lawful: Vec<LawState>,
    old_laws: Nodes,
}

impl<'a> ElasticCells<'a> {
    /// Computes the past's share.
    pub fn new(c: Context<'a>) -> ElasticCells<'a> {
        let cells = Cells::new(c);
        let laws = Some(CellLaws::new(cells)).filter(CellLaws::act);
        let mut old_laws = Vec::new();
        if let Some(laws) = laws.filter(|_| c.weights.old != 0.0) {
            old_laws = zeros(c.past.u.len());
            laws.add_old_force(&mut old_laws);
        }
        ElasticCells { cells, before: Before::new(&cells), posed: Vec::new(), laws, lawful: Vec::new(), old_laws }
    }

    #[inline(always)]
    fn posed_at(&self, e: usize, u1: &[DVec3]) -> Posed {
        let cells = &self.cells;
        let pose = cells.pose(e, u1);
        let (a, b) = cells.c.weights_of(e).factors();
        let mut q = pose.q.map(|q| a * q);
        if let Some(old) = self.before.q.get(e) {
            for i in 0..24 {
                q[i] += b * old[i];
            }
        }
        let stress = times(cells.stiffness(e), &q, cells.young_of(e));
        let mut force = pose.force(&stress);
        if let Some(guard) = pose.guard() {
            let scale = cells.guard_scale(e);
            force.iter_mut().zip(guard.force()).for_each(|(f, g)| *f += scale * g);
        }
        Posed { pose, stress, force }
    }

    /// Derivative of cell e's force by the new state, world frame: blocks (i, j ≥ i) of the symmetric 24 × 24 matrix.
    #[inline(always)]
    fn upper_tangent(&self, e: usize, curvature: Curvature, out: &mut M24) {
        let Posed { pose, stress, .. } = &self.posed[e];
        let convex = curvature == Curvature::Convex;
        let scale = self.cells.young_of(e) * self.cells.c.weights_of(e).factors().0;
        match (&self.laws, self.lawful.get(e)) {
            (Some(laws), Some(state)) => {
                let both = std::array::from_fn(|i| stress[i] + state.stress[i]);
                match laws.matrix(e, state, scale + state.scale) {
                    Some(k) => pose.upper_hessian(&k, 1.0, (!convex).then_some(&both), out),
                    None => pose.upper_hessian(self.cells.stiffness(e), scale + state.scale, (!convex).then_some(&both), out),
                }
                laws.add_upper_tangent(e, pose, &state.of(curvature), convex.then_some(scale + state.scale), out);
            }
            _ => pose.upper_hessian(self.cells.stiffness(e), scale, (!convex).then_some(stress), out),
        }
        if let Some(guard) = pose.guard() {
            guard.add_hessian(self.cells.guard_scale(e), convex, out);
        }
        if curvature == Curvature::Tamed && pose.distance() < SQUEEZED {
            tame(out);
        }
    }

    /// Adds the elastic force of the last residual, without the laws of cells.
    fn add_forces(&self, out: &mut [DVec3]) {
        self.cells.sum_corners(|e, i| self.posed[e].force[i], out);
        out.iter_mut().zip(&self.before.force).for_each(|(v, f)| *v += *f);
    }
}

impl Term for ElasticCells<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        let mut posed = std::mem::take(&mut self.posed);
        let cells = self.cells.body().cells().len();
        if posed.len() != cells {
            posed.clear();
            posed.resize(cells, self.posed_at(0, u1));
        }
        posed.par_chunks_mut(CHUNK).enumerate().for_each(|(c, posed)| {
            wide(
                #[inline(always)]
                || {
                    for (i, posed) in posed.iter_mut().enumerate() {
                        *posed = self.posed_at(CHUNK * c + i, u1);
                    }
                },
            );
        });
        self.posed = posed;
        self.add_forces(out);
        if let Some(laws) = &self.laws {
            let (lawful, forces): (Vec<LawState>, Vec<Corners>) =
                self.cells.each_cell(|e| laws.state(e, &self.posed[e].pose)).into_iter().unzip();
            self.cells.sum_corners(|e, i| forces[e][i], out);
            out.iter_mut().zip(&self.old_laws).for_each(|(v, f)| *v += *f);
            self.lawful = lawful;
        }
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let parts = self.cells.each_cell(
            #[inline(always)]
            |e| {
                let (a, b) = self.cells.c.weights_of(e).factors();
                let pose = self.cells.pose(e, u1);
                let q = pose.q;
                let kq = times(self.cells.stiffness(e), &q, self.cells.young_of(e));
                let guard = pose.guard().map_or(0.0, |g| self.cells.guard_scale(e) * g.energy);
                guard + 0.5 * a * dot24(&q, &kq) + self.before.q.get(e).map_or(0.0, |old| b * dot24(old, &kq))
            },
        );
        let own = crate::linear::vector::dot(&u1[..self.before.force.len()], &self.before.force);
        let of_laws = self.laws.as_ref().map_or(0.0, |l| l.potential(u1));
        let old = crate::linear::vector::dot(&u1[..self.old_laws.len()], &self.old_laws);
        parts.iter().sum::<f64>() + own + of_laws + old
    }

    fn tangent(&self, _u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        assemble(&Tangents { term: self, curvature }, self.cells.c.pattern, matrix);
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        for (i, d) in change.each.iter().enumerate() {
            self.along_past(i, d, out);
            if let Some(laws) = &self.laws {
                laws.along_past(i, u1, d, out);
            }
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        for (i, to) in out.each.iter_mut().enumerate() {
            self.pull_past(i, z, to);
            if let Some(laws) = &self.laws {
                laws.pull_past(i, u1, z, to);
            }
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        self.along_coefficients(rates, out);
        CellLaws::new(self.cells).along_coefficients(u1, rates, out);
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        self.pull_coefficients(z, sought, gradient);
        CellLaws::new(self.cells).pull_coefficients(u1, z, sought, gradient);
    }

    fn forces(&self, _u1: &[DVec3], out: &mut Forces) {
        self.add_forces(&mut out.elastic);
    }
}

/// Removes the negative eigenvalues of a symmetric matrix of which the blocks (i, j ≥ i) are given.
#[cold]
fn tame(h: &mut M24) {
    let a = Mat::from_fn(24, 24, |i, j| h[24 * i.min(j) + i.max(j)]);
    // An eigenvalue problem that does not converge holds NaN; then the residual says so.
    let Ok(eigen) = a.self_adjoint_eigen(Side::Lower) else { return };
    for k in 0..24 {
        let value = eigen.S()[k];
        if value < 0.0 {
            let v = eigen.U().col(k);
            for i in 0..24 {
                for j in 0..24 {
                    h[24 * i + j] -= value * v[i] * v[j];
                }
            }
        }
    }
}
