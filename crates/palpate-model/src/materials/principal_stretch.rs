//! An isotropic material by its principal stretches (Xu, Sin, Zhu & Barbič, *ACM ToG* 34(4), 2015; Hahn et al., Real2Sim, 2019, Eqs. 18–20):
//! ψ = Σ f(s_i) + h(J) with f″ = μ v(ln s) and h″ = w(ln J) (½λ (1 + J⁻²) + μ J⁻²), where v and w are the scene's curves.
//!
//! Both are positive whatever the corners' factors are, so f and h are convex. f′(1) = μ and h′(1) = −μ: at rest there is no stress, and E
//! and ν are the moduli there (f + c ln s and h − c ln J were the same material, so one of the two slopes is a choice). With all
//! factors 1 it is `neo-hookean`.

use super::curve::{Curve, Integrals};
use super::{Gradient, Model, Solid, Stress, cofactors, deformation};

/// Without a corner, as scenes leave it that state none.
static PLAIN: PrincipalStretch = PrincipalStretch { stretch: Curve::FLAT, volume: Curve::FLAT };

pub(super) const MODEL: Model = Model {
    name: "principal-stretch",
    doc: "stiffness follows curves over the principal stretches and the volume",
    law: &PLAIN,
    is_linear: false,
    has_curves: true,
};

/// The law with its two curves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PrincipalStretch {
    /// v: factor on the stiffness along a stretch.
    pub stretch: Curve,
    /// w: factor on the stiffness of the volume.
    pub volume: Curve,
}

/// F = U diag(s) Vᵀ with the logarithms of the stretches.
struct Frame {
    u: Gradient<f64>,
    v: Gradient<f64>,
    s: [f64; 3],
    x: [f64; 3],
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by Jacobi's rotations.
pub(crate) fn eigen(mut a: Gradient<f64>) -> ([f64; 3], Gradient<f64>) {
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // Quadratic from the third sweep on; six leave nothing.
    for _ in 0..6 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
            let (c, s) = (1.0 / t.hypot(1.0), t / t.hypot(1.0));
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            for k in 0..3 {
                (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
            }
            for row in &mut v {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], v)
}

/// `None` where there is no volume left.
fn frame(h: &Gradient<f64>) -> Option<Frame> {
    let f = deformation(h);
    let c = cofactors(&f);
    if (0..3).map(|k| f[0][k] * c[0][k]).sum::<f64>() <= 0.0 {
        return None;
    }
    // Of Green's strain, which keeps the digits of small ones.
    let green = std::array::from_fn(|i| {
        std::array::from_fn(|j| 0.5 * (h[i][j] + h[j][i] + (0..3).map(|k| h[k][i] * h[k][j]).sum::<f64>()))
    });
    let (e, v) = eigen(green);
    let x = e.map(|e| 0.5 * (2.0 * e).ln_1p());
    let s = e.map(|e| (1.0 + 2.0 * e).sqrt());
    let u = std::array::from_fn(|i| std::array::from_fn(|k| (0..3).map(|j| f[i][j] * v[j][k]).sum::<f64>() / s[k]));
    s.iter().all(|s| *s > 0.0).then_some(Frame { u, v, s, x })
}

/// Principal stretches at H; `None` where there is no volume left.
pub fn stretches(h: &Gradient<f64>) -> Option<[f64; 3]> {
    frame(h).map(|f| f.s)
}

/// U diag(p) Vᵀ, row by row.
fn back(frame: &Frame, p: [f64; 3]) -> [f64; 9] {
    std::array::from_fn(|k| (0..3).map(|i| frame.u[k / 3][i] * p[i] * frame.v[k % 3][i]).sum())
}

/// h′(J) less its value −μ at rest, from the volume curve's integrals.
fn pressure(w: &Integrals, lambda: f64, mu: f64) -> f64 {
    0.5 * lambda * (w.up + w.down) + mu * w.down
}

impl PrincipalStretch {
    /// Principal stresses P_i = f′(s_i) + h′(J) J/s_i, from integrals of both curves (a_i, w); `rest` is 1 with their values at rest, μ and −μ.
    fn principal(frame: &Frame, a: [f64; 3], w: &Integrals, rest: f64, lambda: f64, mu: f64) -> [f64; 3] {
        let s = frame.s;
        std::array::from_fn(|i| {
            let others = s[(i + 1) % 3] * s[(i + 2) % 3];
            mu * a[i] + rest * mu * (1.0 - others) + pressure(w, lambda, mu) * others
        })
    }
}

impl Solid for PrincipalStretch {
    fn value(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> f64 {
        let Some(frame) = frame(h) else { return f64::NAN };
        let ln_j: f64 = frame.x.iter().sum();
        let (j, w) = (ln_j.exp(), self.volume.integrals(ln_j));
        let along: f64 = (0..3).map(|i| mu * (frame.s[i] - 1.0 + self.stretch.integrals(frame.x[i]).up_up)).sum();
        along - mu * (j - 1.0) + 0.5 * lambda * (w.up_up + w.down_up) + mu * w.down_up
    }

    fn stress(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Stress {
        let Some(frame) = frame(h) else { return ([f64::NAN; 9], [[f64::NAN; 9]; 9]) };
        let (s, x) = (frame.s, frame.x);
        let ln_j: f64 = x.iter().sum();
        let (j, w) = (ln_j.exp(), self.volume.integrals(ln_j));
        let v = x.map(|x| self.stretch.integrals(x));
        let p = Self::principal(&frame, v.map(|v| v.up), &w, 1.0, lambda, mu);
        let slope = pressure(&w, lambda, mu) - mu;
        let bend = w.value * (0.5 * lambda * (1.0 + 1.0 / (j * j)) + mu / (j * j));
        // Of the diagonal in the frame: Ψ_ij.
        let normal: Gradient<f64> = std::array::from_fn(|a| {
            std::array::from_fn(|b| {
                let both = bend * (j / s[a]) * (j / s[b]);
                if a == b { mu * v[a].value + both } else { both + slope * s[3 - a - b] }
            })
        });
        // Of symmetric and skew parts off it.
        let pair = |a: usize, b: usize| {
            let third = slope * s[3 - a - b];
            let sum = 2.0 * mu + mu * (v[a].up + v[b].up);
            [mu * self.stretch.mean_up(x[a], x[b]) - third, sum / (s[a] + s[b]) + third]
        };
        let mut tangent = [[0.0; 9]; 9];
        for l in 0..9 {
            let e: Gradient<f64> = std::array::from_fn(|a| std::array::from_fn(|b| frame.u[l / 3][a] * frame.v[l % 3][b]));
            let mut d: Gradient<f64> = [[0.0; 3]; 3];
            for a in 0..3 {
                d[a][a] = (0..3).map(|b| normal[a][b] * e[b][b]).sum();
            }
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let [even, odd] = pair(a, b);
                let (m, n) = (0.5 * even * (e[a][b] + e[b][a]), 0.5 * odd * (e[a][b] - e[b][a]));
                (d[a][b], d[b][a]) = (m + n, m - n);
            }
            for k in 0..9 {
                let row = |a: usize| (0..3).map(|b| d[a][b] * frame.v[k % 3][b]).sum::<f64>();
                tangent[k][l] = (0..3).map(|a| frame.u[k / 3][a] * row(a)).sum();
            }
        }
        (back(&frame, p), tangent)
    }

    fn first(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> [f64; 9] {
        let Some(frame) = frame(h) else { return [f64::NAN; 9] };
        let w = self.volume.integrals(frame.x.iter().sum());
        back(&frame, Self::principal(&frame, frame.x.map(|x| self.stretch.integrals(x).up), &w, 1.0, lambda, mu))
    }

    fn by_moduli(&self, h: &Gradient<f64>, _lambda: f64, _mu: f64) -> [[f64; 9]; 2] {
        let Some(frame) = frame(h) else { return [[f64::NAN; 9]; 2] };
        let w = self.volume.integrals(frame.x.iter().sum());
        let a = frame.x.map(|x| self.stretch.integrals(x).up);
        [(1.0, 0.0), (0.0, 1.0)].map(|(l, m)| back(&frame, Self::principal(&frame, a, &w, 1.0, l, m)))
    }

    fn by_curves(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Vec<[f64; 9]> {
        let Some(frame) = frame(h) else { return vec![[f64::NAN; 9]; self.stretch.factors.len() + self.volume.factors.len()] };
        let ln_j: f64 = frame.x.iter().sum();
        let none = Integrals::default();
        let along = (0..self.stretch.factors.len()).map(|k| (frame.x.map(|x| self.stretch.by_factor(k, x).up), none));
        let volume = (0..self.volume.factors.len()).map(|k| ([0.0; 3], self.volume.by_factor(k, ln_j)));
        along.chain(volume).map(|(a, w)| back(&frame, Self::principal(&frame, a, &w, 0.0, lambda, mu))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::neo_hookean::NeoHookean;
    use super::*;
    use crate::mechanics::lame::lame;

    fn law() -> PrincipalStretch {
        PrincipalStretch {
            stretch: Curve::new(vec![0.6, 0.92, 1.25, 1.5], vec![2.5, 0.8, 1.5, 4.0]).unwrap(),
            volume: Curve::new(vec![0.7, 1.4], vec![3.0, 0.5]).unwrap(),
        }
    }

    const TURNED: [Gradient<f64>; 5] = [
        [[0.3, -0.2, 0.1], [0.25, -0.15, 0.05], [-0.1, 0.2, 0.12]],
        [[-0.3, 0.1, 0.0], [0.05, 0.4, -0.2], [0.1, 0.3, -0.1]],
        // Two and three equal stretches, and none of any size.
        [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, -0.1]],
        [[-0.2, 0.0, 0.0], [0.0, -0.2, 0.0], [0.0, 0.0, -0.2]],
        [[1e-9, 2e-9, 0.0], [-1e-9, 0.0, 3e-9], [0.0, 0.0, -2e-9]],
    ];

    /// A1 of Real2Sim's acceptance.
    #[test]
    fn stress_tangent_and_derivatives_by_the_factors_also_where_stretches_are_equal() {
        let (law, (lambda, mu)) = (law(), lame(1.0, 0.4));
        for h in TURNED {
            let (stress, tangent) = law.stress(&h, lambda, mu);
            let d = 1e-5;
            for l in 0..9 {
                let moved = |by: f64| {
                    let mut h = h;
                    h[l / 3][l % 3] += by;
                    h
                };
                let value = |by: f64| law.value(&moved(by), lambda, mu);
                assert!(((value(d) - value(-d)) / (2.0 * d) - stress[l]).abs() < 1e-8, "P {l} {h:?}");
                let [more, less] = [d, -d].map(|by| law.stress(&moved(by), lambda, mu).0);
                for k in 0..9 {
                    let difference = (more[k] - less[k]) / (2.0 * d);
                    // At rest both curves have a corner: the tangent's own slope jumps there, by some 20, which a difference sees half of.
                    let close = if h[0][0].abs() < 1e-6 { 20.0 * d } else { 1e-8 };
                    assert!((difference - tangent[k][l]).abs() < close, "dP {k} {l} {difference} {} {h:?}", tangent[k][l]);
                    assert!((tangent[k][l] - tangent[l][k]).abs() < 1e-12);
                }
            }
            let by_factors = law.by_curves(&h, lambda, mu);
            assert_eq!(by_factors.len(), 6);
            for (n, by) in by_factors.iter().enumerate() {
                let at = |by: f64| {
                    let mut law = law.clone();
                    let first = law.stretch.factors.len();
                    *if n < first { &mut law.stretch.factors[n] } else { &mut law.volume.factors[n - first] } += by;
                    law.stress(&h, lambda, mu).0
                };
                let [more, less] = [at(0.1), at(-0.1)];
                // Linear in the factors: nothing but rounding.
                assert!((0..9).all(|k| ((more[k] - less[k]) / 0.2 - by[k]).abs() < 1e-13), "factor {n}");
            }
            let by = law.by_moduli(&h, lambda, mu);
            assert!((0..9).all(|k| (lambda * by[0][k] + mu * by[1][k] - stress[k]).abs() < 1e-13));
        }
    }

    #[test]
    fn with_factors_of_one_it_is_neo_hookean() {
        let (plain, (lambda, mu)) = (PrincipalStretch::default(), lame(1.0, 0.3));
        for h in TURNED {
            assert!((plain.value(&h, lambda, mu) - NeoHookean.value(&h, lambda, mu)).abs() < 1e-14);
            let ((a, t), (b, r)) = (plain.stress(&h, lambda, mu), NeoHookean.stress(&h, lambda, mu));
            assert!((0..9).all(|k| (a[k] - b[k]).abs() < 1e-14 && (0..9).all(|l| (t[k][l] - r[k][l]).abs() < 1e-13)), "{h:?}");
        }
    }

    #[test]
    fn stretches_are_those_of_the_turned_and_stretched_body() {
        let turn = glam::DMat3::from_axis_angle(glam::DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1);
        let f = turn * glam::DMat3::from_diagonal(glam::DVec3::new(0.7, 1.2, 1.6)) * turn;
        let h = std::array::from_fn(|i| std::array::from_fn(|j| f.col(j)[i] - f64::from(u8::from(i == j))));
        let mut found = stretches(&h).unwrap();
        found.sort_by(f64::total_cmp);
        assert!(found.iter().zip([0.7, 1.2, 1.6]).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
        // Inside out, and flat.
        for by in [-1.5, -1.0] {
            assert_eq!(stretches(&[[by, 0.0, 0.0], [0.0; 3], [0.0; 3]]), None);
        }
    }
}
