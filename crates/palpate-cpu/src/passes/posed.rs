//! What one solve of a balance keeps of its cells: the old state's share, which never changes in it, and the poses of the last
//! residual, which the tangent at the same displacement takes over.

use crate::linear::simd::wide;
use crate::linear::vector::{Nodes, dot};
use crate::passes::cells::{CHUNK, Corners, Elasticity, Mix, corners, dot24, times, zeros};
use faer::{Mat, Side};
use glam::DVec3;
use palpate_model::cutcells::corotation::{CellPose, M24, V24};
use rayon::prelude::*;

/// Distance from the jump of the rotation (8/9 at rest) below which a cell's tangent may be far from positive definite: flattened to
/// half.
const SQUEEZED: f64 = 0.7;

/// How the tangent treats negative curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// As it is.
    Exact,
    /// Without the negative eigenvalues of squeezed cells (Teran, Sifakis, Irving & Fedkiw, Robust quasistatic finite elements and
    /// flesh simulation, SCA 2005).
    Tamed,
    /// Without all parts that may be indefinite: the second derivative of the rotation.
    Convex,
}

/// The old state's share in the elastic force; depends on the old state and the mix alone.
#[derive(Clone, Debug, Default)]
pub struct Before {
    /// q₀ of every cell [m]; empty where the balance does not see the old state.
    q: Vec<V24>,
    /// (1 − θ) f(x₀) `[N]` [N]; empty where the old state has no force of its own.
    force: Nodes,
}

/// A cell at the new displacement.
#[derive(Clone, Copy, Debug)]
pub struct Posed {
    /// Its pose.
    pose: CellPose,
    /// Body-frame stress forces that go with the pose [N].
    stress: V24,
    /// Forces on its corners, without the old state's own [N].
    force: Corners,
}

impl Elasticity<'_> {
    /// Computes the old state's share.
    pub fn before(&self, mix: &Mix, u0: &[DVec3]) -> Before {
        let h = self.body.grid.h;
        let cells = self.body.cells.len();
        let shifted = |mut pose: CellPose, e: usize| {
            self.shift(e, &mut pose);
            pose
        };
        if mix.old == 0.0 && mix.rate == 0.0 {
            return Before::default();
        }
        let mut q = vec![[0.0; 24]; cells];
        let mut own: Vec<Corners> = vec![[DVec3::ZERO; 8]; cells];
        q.par_chunks_mut(CHUNK).zip(own.par_chunks_mut(CHUNK)).enumerate().for_each(|(c, (q, own))| {
            wide(
                #[inline(always)]
                || {
                    for i in 0..q.len() {
                        let e = CHUNK * c + i;
                        let pose = shifted(CellPose::new(&corners(self.body, e, u0), h), e);
                        q[i] = pose.q;
                        if mix.old != 0.0 {
                            own[i] = pose.force(&times(self.stiffness(e), &pose.q, self.young_of(e) * mix.old));
                        }
                    }
                },
            );
        });
        let mut force = Vec::new();
        if mix.old != 0.0 {
            force = zeros(u0.len());
            self.sum_corners(|e, i| own[e][i], &mut force);
        }
        Before { q, force }
    }

    #[inline(always)]
    fn pose(&self, e: usize, u1: &[DVec3]) -> CellPose {
        let mut pose = CellPose::new(&corners(self.body, e, u1), self.body.grid.h);
        self.shift(e, &mut pose);
        pose
    }

    #[inline(always)]
    fn posed(&self, mix: &Mix, before: &Before, e: usize, u1: &[DVec3]) -> Posed {
        let pose = self.pose(e, u1);
        let (a, b) = mix.factors();
        let mut q = pose.q.map(|q| a * q);
        if let Some(old) = before.q.get(e) {
            for i in 0..24 {
                q[i] += b * old[i];
            }
        }
        let stress = times(self.stiffness(e), &q, self.young_of(e));
        let mut force = pose.force(&stress);
        self.add_guard(mix, e, &pose, self.young_of(e), &mut force);
        Posed { pose, stress, force }
    }

    /// Adds the elastic force at `u1`, and keeps what the tangent there needs in `posed`, one entry per cell.
    pub fn force_from(&self, mix: &Mix, before: &Before, u1: &[DVec3], posed: &mut Vec<Posed>, out: &mut [DVec3]) {
        let cells = self.body.cells.len();
        if posed.len() != cells {
            posed.clear();
            posed.resize(cells, self.posed(mix, before, 0, u1));
        }
        posed.par_chunks_mut(CHUNK).enumerate().for_each(|(c, posed)| {
            wide(
                #[inline(always)]
                || {
                    for (i, posed) in posed.iter_mut().enumerate() {
                        *posed = self.posed(mix, before, CHUNK * c + i, u1);
                    }
                },
            );
        });
        self.add_forces(before, posed, out);
    }

    /// Adds the elastic force that `posed` was made with.
    pub fn add_forces(&self, before: &Before, posed: &[Posed], out: &mut [DVec3]) {
        self.sum_corners(|e, i| posed[e].force[i], out);
        out.iter_mut().zip(&before.force).for_each(|(v, f)| *v += *f);
    }

    /// Incremental potential whose gradient by u₁ is the elastic force, up to a constant [J].
    pub fn potential(&self, mix: &Mix, before: &Before, u1: &[DVec3]) -> f64 {
        let (a, b) = mix.factors();
        let cells = self.each_cell(
            #[inline(always)]
            |e| {
                let pose = self.pose(e, u1);
                let q = pose.q;
                let kq = times(self.stiffness(e), &q, self.young_of(e));
                let guard = pose.guard().map_or(0.0, |g| self.guard_scale(mix, e, self.young_of(e)) * g.energy);
                guard + 0.5 * a * dot24(&q, &kq) + before.q.get(e).map_or(0.0, |old| b * dot24(old, &kq))
            },
        );
        cells.iter().sum::<f64>() + dot(&u1[..before.force.len()], &before.force)
    }

    /// Derivative of cell e's force by the new state, world frame: blocks (i, j ≥ i) of the symmetric 24 × 24 matrix.
    #[inline(always)]
    pub fn upper_tangent(&self, mix: &Mix, posed: &[Posed], e: usize, curvature: Curvature, out: &mut M24) {
        let Posed { pose, stress, .. } = &posed[e];
        let convex = curvature == Curvature::Convex;
        let second = (!convex).then_some(stress);
        pose.upper_hessian(self.stiffness(e), self.young_of(e) * mix.factors().0, second, out);
        if let Some(guard) = pose.guard() {
            guard.add_hessian(self.guard_scale(mix, e, self.young_of(e)), convex, out);
        }
        if curvature == Curvature::Tamed && pose.distance() < SQUEEZED {
            tame(out);
        }
    }

    /// E V of a cell times the weight of the new state, with modulus `young` [J]. The guard against inversion acts at the new state
    /// only, like contact.
    #[inline(always)]
    fn guard_scale(&self, mix: &Mix, e: usize, young: f64) -> f64 {
        mix.new * young * self.body.cells[e].fraction * self.body.grid.h.powi(3)
    }

    /// Adds the force of the guard against inversion.
    #[inline(always)]
    pub(super) fn add_guard(&self, mix: &Mix, e: usize, pose: &CellPose, young: f64, out: &mut Corners) {
        if let Some(guard) = pose.guard() {
            let scale = self.guard_scale(mix, e, young);
            out.iter_mut().zip(guard.force()).for_each(|(f, g)| *f += scale * g);
        }
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
