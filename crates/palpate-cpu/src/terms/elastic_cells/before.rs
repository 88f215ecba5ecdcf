//! The past's share in the elastic force, which never changes in a solve.

use super::{CHUNK, Cells, Corners, times};
use crate::linear::simd::wide;
use crate::linear::vector::Nodes;
use crate::terms::zeros;
use glam::DVec3;
use palpate_model::cutcells::corotation::V24;
use rayon::prelude::*;

/// What the past states leave; depends on them and the weights alone.
#[derive(Clone, Debug, Default)]
pub(super) struct Before {
    /// q̃ = Σ w q(x_past) of every cell [m]; empty where the force does not see the past.
    pub q: Vec<V24>,
    /// (1 − θ) f(x₀) `[N]` [N]; empty where the old state has no force of its own.
    pub force: Nodes,
}

impl Before {
    pub(super) fn new(cells: &Cells) -> Before {
        let (weights, past) = (&cells.c.weights, &cells.c.past);
        if !weights.sees_past() {
            return Before::default();
        }
        let count = cells.body().cells().len();
        let mut q = vec![[0.0; 24]; count];
        let mut own: Vec<Corners> = vec![[DVec3::ZERO; 8]; count];
        q.par_chunks_mut(CHUNK).zip(own.par_chunks_mut(CHUNK)).enumerate().for_each(|(c, (q, own))| {
            wide(
                #[inline(always)]
                || {
                    for i in 0..q.len() {
                        let e = CHUNK * c + i;
                        for (weight, u) in past.each {
                            let pose = cells.pose(e, u);
                            for k in 0..24 {
                                q[i][k] += weight * pose.q[k];
                            }
                            if weights.old != 0.0 {
                                own[i] = pose.force(&times(cells.stiffness(e), &pose.q, cells.young_of(e) * weights.old));
                            }
                        }
                    }
                },
            );
        });
        let mut force = Vec::new();
        if weights.old != 0.0 {
            force = zeros(past.u.len());
            cells.sum_corners(|e, i| own[e][i], &mut force);
        }
        Before { q, force }
    }
}
