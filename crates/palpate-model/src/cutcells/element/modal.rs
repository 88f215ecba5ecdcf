//! Trilinear displacement in its modal basis 1, x, y, xy, z, xz, yz, xyz on [−1, 1]³.
//!
//! Mode m is the product of the axes in its bit mask, so a gradient is again one mode and an integral over products
//! of gradients is one moment of the cell's inside. Degrees of freedom: 3 · mask + component.

use super::Law;
use crate::cutcells::corotation::M24;

/// Moments ∫ x^i y^j z^k over the part inside, divided by the cell's volume; entry i + 3j + 9k, exponents 0 to 2.
pub(super) type Moments = [f64; 27];

/// Place in [`Moments`] of one more power of each axis.
pub(super) const POWER: [usize; 3] = [1, 3, 9];

/// Place of mode m in [`Moments`].
pub(super) const PLACE: [usize; 8] = [0, 1, 3, 4, 9, 10, 12, 13];

/// Whether mode m depends on axis a.
pub(super) const fn has(m: usize, a: usize) -> bool {
    m >> a & 1 == 1
}

/// Moments of Gauss-point weights (x fastest).
pub(super) fn moments(weights: &[f64; 27]) -> Moments {
    // Abscissae of the three-point Gauss rule on [−1, 1]: −√0.6, 0, √0.6.
    let root = 0.6f64.sqrt();
    let mut m = *weights;
    for stride in POWER {
        for start in (0..27).filter(|i| i / stride % 3 == 0) {
            let (a, b, c) = (m[start], m[start + stride], m[start + 2 * stride]);
            m[start] = a + b + c;
            m[start + stride] = root * (c - a);
            m[start + 2 * stride] = 0.6 * (c + a);
        }
    }
    m
}

/// Replaces the integral by the sum over corners v with weights ∫ N_v, which sees every square as one.
pub(super) fn corner_rule(m: &mut Moments) {
    for i in 0..27 {
        let mut source = i;
        for stride in POWER {
            if i / stride % 3 == 2 {
                source -= 2 * stride;
            }
        }
        m[i] = m[source];
    }
}

/// D and V of two modes: D = ∫ dev ε : dev ε′ and V = ∫ tr ε tr ε′ for every pair of components.
pub(super) fn pair(moments: &Moments, m: usize, n: usize) -> ([[f64; 3]; 3], [[f64; 3]; 3]) {
    let mut s = [[0.0; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            if has(m, a) && has(n, b) {
                s[a][b] = moments[PLACE[m] + PLACE[n] - POWER[a] - POWER[b]];
            }
        }
    }
    let along = 0.5 * (s[0][0] + s[1][1] + s[2][2]);
    let mut d = [[0.0; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            d[a][b] = 0.5 * s[b][a] - s[a][b] / 3.0;
        }
        d[a][a] += along;
    }
    (d, s)
}

/// Matrices of the exactly integrated trilinear element in the modal basis.
pub(super) fn assemble(moments: &Moments, law: &Law, k: &mut M24, dk: &mut M24) {
    k.fill(0.0);
    dk.fill(0.0);
    for m in 1..8 {
        for n in 1..8 {
            let (d, v) = pair(moments, m, n);
            for a in 0..3 {
                for b in 0..3 {
                    let at = 24 * (3 * m + a) + 3 * n + b;
                    k[at] = law.shear[0] * d[a][b] + law.bulk[0] * v[a][b];
                    dk[at] = law.shear[1] * d[a][b] + law.bulk[1] * v[a][b];
                }
            }
        }
    }
}

/// From modal coefficients to corner displacements of a cell with edge `h`, made exactly symmetric.
///
/// Coefficient m is ⅛ Σ_i σ_i^m u_i: a Walsh–Hadamard transform of both sides. Integrals gain h³ for the volume and
/// (2/h)² for the two gradients.
pub(super) fn to_corners(k: &mut M24, h: f64) {
    let scale = 4.0 * h / 64.0;
    butterflies(k);
    let half = *k;
    transpose(&half, k);
    butterflies(k);
    let rows = *k;
    transpose(&rows, k);
    for i in 0..576 {
        k[i] = 0.5 * scale * (k[i] + rows[i]);
    }
}

fn transpose(m: &M24, out: &mut M24) {
    for i in 0..24 {
        for j in 0..24 {
            out[24 * i + j] = m[24 * j + i];
        }
    }
}

/// Σ_m σ_i^m over the row index; σ_i^m = product of the corner's signs on the axes of mode m.
fn butterflies(k: &mut M24) {
    for axis in 0..3 {
        // Rows of modes that differ in one axis lie this far apart.
        let length = 72 << axis;
        for pair in k.chunks_exact_mut(2 * length) {
            let (low, high) = pair.split_at_mut(length);
            for (a, b) in low.iter_mut().zip(high) {
                (*a, *b) = (*a - *b, *a + *b);
            }
        }
    }
}
