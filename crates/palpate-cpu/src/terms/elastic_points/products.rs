//! The points' tangent times a vector, without a matrix: gradient, modulus and gather of every point. Sums are those of the tangent in an order of
//! their own, always the same.

use super::{ElasticPoints, Point};
use crate::linear::simd::wide;
use crate::terms::products::{Part, padded};
use glam::DVec3;
use rayon::prelude::*;

/// Points or nodes that one task treats.
const PIECE: usize = 512;

/// ∂P/∂F of all points times their volumes, entry (r, c) of both matrices at 3 c + r.
pub(super) struct Moduli<'a, 'b> {
    term: &'b ElasticPoints<'a>,
    tangents: Vec<[[f64; 9]; 9]>,
}

impl<'a, 'b> Moduli<'a, 'b> {
    pub(super) fn new(term: &'b ElasticPoints<'a>, u1: &[DVec3]) -> Moduli<'a, 'b> {
        let turned = |k: usize| 3 * (k % 3) + k / 3;
        let of = |p: Point| {
            let t = term.tangent_of(&p, u1);
            std::array::from_fn(|k| std::array::from_fn(|l| t[turned(k)][turned(l)] * p.v))
        };
        Moduli { term, tangents: term.each(of) }
    }

    /// Change of a point's stress along x, column by column.
    #[inline(always)]
    fn stress(&self, e: usize, x: &[[f64; 4]]) -> [[f64; 4]; 3] {
        let s = self.term.stencils.get(e);
        let mut h = [[0.0; 4]; 3];
        for (n, g) in s.nodes.iter().zip(s.gradient) {
            let x = &x[*n as usize];
            let g = g.to_array();
            for c in 0..3 {
                for r in 0..4 {
                    h[c][r] += g[c] * x[r];
                }
            }
        }
        // The tangent is symmetric: columns are rows.
        let mut flat = [0.0; 9];
        for (l, row) in self.tangents[e].iter().enumerate() {
            for k in 0..9 {
                flat[k] += row[k] * h[l / 3][l % 3];
            }
        }
        [[flat[0], flat[1], flat[2], 0.0], [flat[3], flat[4], flat[5], 0.0], [flat[6], flat[7], flat[8], 0.0]]
    }
}

/// Σ P g of the points around a node.
#[inline(always)]
fn gathered(term: &ElasticPoints, stresses: &[[[f64; 4]; 3]], n: usize) -> DVec3 {
    let pattern = term.c.pattern;
    let mut sum = [0.0; 4];
    for (e, i) in &pattern.point_list[pattern.point_rows[n]..pattern.point_rows[n + 1]] {
        let (p, g) = (&stresses[*e as usize], term.stencils.get(*e as usize).gradient[usize::from(*i)]);
        for r in 0..4 {
            sum[r] += p[0][r] * g.x + p[1][r] * g.y + p[2][r] * g.z;
        }
    }
    DVec3::new(sum[0], sum[1], sum[2])
}

impl Part for Moduli<'_, '_> {
    fn add(&self, x: &[DVec3], y: &mut [DVec3]) {
        let x = padded(x);
        let mut stresses = vec![[[0.0; 4]; 3]; self.tangents.len()];
        stresses.par_chunks_mut(PIECE).enumerate().for_each(|(piece, out)| {
            wide(
                #[inline(always)]
                || {
                    for (i, s) in out.iter_mut().enumerate() {
                        *s = self.stress(PIECE * piece + i, &x);
                    }
                },
            );
        });
        y.par_chunks_mut(PIECE).enumerate().for_each(|(piece, y)| {
            wide(
                #[inline(always)]
                || {
                    for (i, y) in y.iter_mut().enumerate() {
                        *y += gathered(self.term, &stresses, PIECE * piece + i);
                    }
                },
            );
        });
    }
}
