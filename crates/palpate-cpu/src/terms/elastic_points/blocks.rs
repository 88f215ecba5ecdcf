//! The points' tangents block by block, for the assembly of the matrix: those of an element have the same nodes and are summed before they go there.

use super::{ElasticPoints, Point, contract, green, linear_stress, rows};
use crate::terms::Curvature;
use crate::terms::assembly::Elements;
use glam::{DMat3, DVec3};

/// Points with what their tangents are taken at.
pub(super) struct Tangents<'a, 'b> {
    pub(super) term: &'b ElasticPoints<'a>,
    pub(super) u1: &'b [DVec3],
    pub(super) curvature: Curvature,
}

impl ElasticPoints<'_> {
    /// ∂P/∂F of a point at the new state [Pa].
    pub(super) fn tangent_of(&self, point: &Point, u1: &[DVec3]) -> [[f64; 9]; 9] {
        self.tangent_with(Curvature::Exact, point, u1)
    }

    /// The same with the curvature of dissipation that is wanted.
    fn tangent_with(&self, curvature: Curvature, point: &Point, u1: &[DVec3]) -> [[f64; 9]; 9] {
        let (w, Point { e, moduli: (lambda, mu), .. }) = (self.c.weights_of(point.element), point);
        let h = point.h(u1);
        let f = h + DMat3::IDENTITY;
        let mut tangent = self.c.law().stress(&rows(h), *lambda, *mu).1.map(|r| r.map(|t| t * w.new));
        if let (Some(past), true) = (self.past.get(*e), w.rate != 0.0) {
            let held = linear_stress(green(h) - *past, (*lambda, *mu)) * w.rate;
            add_rate(&mut tangent, f, held, (*lambda * w.rate, *mu * w.rate));
        }
        if let Some((law, rate)) = self.flow_of(*e) {
            // S = 2 φ′ g, and along dG 2 φ′ dG + 4 φ″ g (g : dG), where g : dG = F g : dF.
            let g = green(h) - self.past[*e];
            let [_, first, second] = law.loss(contract(g, g), rate);
            add_rate(&mut tangent, f, g * (2.0 * first), (0.0, first));
            let (along, second) = (rows(f * g), curvature.of_dissipation(second));
            for (k, row) in tangent.iter_mut().enumerate() {
                (0..9).for_each(|l| row[l] += 4.0 * second * along[k / 3][k % 3] * along[l / 3][l % 3]);
            }
        }
        tangent
    }
}

impl Tangents<'_, '_> {
    /// The same times the point's volume, with the curvature that is wanted.
    fn tangent(&self, point: &Point) -> [[f64; 9]; 9] {
        let mut tangent = self.term.tangent_with(self.curvature, point, self.u1);
        if !self.curvature.keeps() {
            crate::linear::dense::without_negative_eigenvalues(&mut tangent);
        }
        tangent.map(|r| r.map(|t| t * point.v))
    }
}

impl Elements for Tangents<'_, '_> {
    type Scratch = Vec<DMat3>;

    fn count(&self) -> usize {
        self.term.c.plan.body.points.elements()
    }

    fn nodes(&self, e: usize) -> &[u32] {
        self.term.c.plan.body.points.mean(e).nodes
    }

    fn places(&self, e: usize) -> &[u32] {
        self.term.c.places.points.of(self.term.c.plan.body.points.mean_point(e))
    }

    fn scratch(&self) -> Self::Scratch {
        Vec::new()
    }

    /// The tangent is symmetric: blocks below the diagonal are those above it, transposed.
    fn blocks(&self, e: usize, sum: &mut Self::Scratch, mut put: impl FnMut(usize, usize, DMat3)) {
        let points = &self.term.c.plan.body.points;
        let (last, n) = (points.mean_point(e), points.mean(e).nodes.len());
        sum.clear();
        sum.resize(n * n, DMat3::ZERO);
        for k in last + 1 - points.per_element..=last {
            let point = self.term.point(k);
            let tangent = self.tangent(&point);
            for (j, gb) in point.s.gradient.iter().enumerate() {
                // Contracted with one gradient for all of the other nodes.
                let part = |row: &[f64; 9], c: usize| row[3 * c] * gb.x + row[3 * c + 1] * gb.y + row[3 * c + 2] * gb.z;
                let half: [[DVec3; 3]; 3] = std::array::from_fn(|r| {
                    std::array::from_fn(|c| DVec3::from_array([0, 1, 2].map(|k| part(&tangent[3 * r + k], c))))
                });
                for (i, ga) in point.s.gradient.iter().enumerate().take(j + 1) {
                    let column = |c: usize| DVec3::new(half[0][c].dot(*ga), half[1][c].dot(*ga), half[2][c].dot(*ga));
                    sum[n * i + j] += DMat3::from_cols(column(0), column(1), column(2));
                }
            }
        }
        for j in 0..n {
            for i in 0..j {
                put(i, j, sum[n * i + j]);
                put(j, i, sum[n * i + j].transpose());
            }
            put(j, j, sum[n * j + j]);
        }
    }
}

/// Adds the derivative by F of the stress F S, where S changes by λ tr(dG) I + 2μ dG with Green's strain: along dF it is
/// dF S + λ F (F : dF) + μ (F Fᵀ dF + F dFᵀ F).
fn add_rate(tangent: &mut [[f64; 9]; 9], f: DMat3, stress: DMat3, (lambda, mu): (f64, f64)) {
    let (square, f, s) = (rows(f * f.transpose()), rows(f), rows(stress));
    for (p, row) in tangent.iter_mut().enumerate() {
        let (i, k) = (p / 3, p % 3);
        for (q, entry) in row.iter_mut().enumerate() {
            let (a, b) = (q / 3, q % 3);
            *entry += lambda * f[i][k] * f[a][b] + mu * f[i][b] * f[a][k];
            if b == k {
                *entry += mu * square[i][a];
            }
            if i == a {
                *entry += s[b][k];
            }
        }
    }
}
