//! The enhanced element: incompatible modes and linear dilatation on the part of the cell inside the body.
//!
//! ε = sym ∇u + Σ α_{a,d} sym(e_d ⊗ e_a) (x_a − x̄_a), the gradients of the bubbles 1 − x_a² freed of their mean over the part
//! inside: a constant stress does no work on them, so the patch test holds on cut cells too. The energy is
//! μ ∫ |dev ε|² + ½ κ ∫ (Π tr ε)² with Π the L2 projection onto {1, x, y, z} over the part inside. Π keeps what bending
//! needs and removes the bilinear dilatations of the trilinear field, which no incompatible mode can undo and which would
//! lock at ν → ½; the linear dilatations can be undone, so only the mean dilatation stays stiff. All gradients are of
//! degree ≤ 1 per variable, so that products are within the reach of the 27 weights. The nine α are condensed.
//!
//! In a sliver the modes' strains vanish with its extent. δ f (1 − f) times the full cell's matrix (f = volume fraction)
//! is added to the block of the α and to Π's Gram matrix: nothing on a full cell, and a sliver tends to the trilinear
//! element with constant dilatation. Both only remove compliance from α or stiffness of the linear
//! dilatation, so K stays positive semi-definite with the rigid motions as its null space.

use super::Law;
use super::modal::{Moments, PLACE, POWER, has, pair};
use crate::cutcells::corotation::M24;

/// δ: small against a half cell's second moments (¼ of the full cell's), large against rounding in a sliver.
pub(super) const REGULARISATION: f64 = 1e-3;

/// Rows of the nine incompatible modes 3 · direction + component against the 24 modal degrees of freedom.
type Rows9 = [[f64; 24]; 9];

/// Matrices in the modal basis.
pub(super) fn assemble(moments: &Moments, fraction: f64, law: &Law, k: &mut M24, dk: &mut M24) {
    let floor = REGULARISATION * moments[0] * (1.0 - fraction).clamp(0.0, 1.0) / 3.0;
    let inside = Inside::new(moments, floor);

    for m in 0..8 {
        for n in 0..8 {
            let (d, _) = if m * n == 0 { ([[0.0; 3]; 3], [[0.0; 3]; 3]) } else { pair(moments, m, n) };
            for a in 0..3 {
                for b in 0..3 {
                    k[24 * (3 * m + a) + 3 * n + b] = d[a][b];
                }
            }
        }
    }
    for (i, (row, drow)) in k.as_chunks_mut::<24>().0.iter_mut().zip(dk.as_chunks_mut::<24>().0).enumerate() {
        let t = inside.dilatation.map(|t| t[i]);
        for j in 0..24 {
            let [t0, t1, t2, t3] = &inside.dilatation;
            let bulk = t[0] * t0[j] + t[1] * t1[j] + t[2] * t2[j] + t[3] * t3[j];
            let shear = row[j];
            row[j] = law.shear[0] * shear + law.bulk[0] * bulk;
            drow[j] = law.shear[1] * shear + law.bulk[1] * bulk;
        }
    }

    let (mut k_au, mut dk_au) = ([[0.0; 24]; 9], [[0.0; 24]; 9]);
    inside.coupling(law, &mut k_au, &mut dk_au);
    let (mut k_aa, mut dk_aa) = ([[0.0; 9]; 9], [[0.0; 9]; 9]);
    inside.block(law, floor, &mut k_aa, &mut dk_aa);
    condense(&mut k_aa, &dk_aa, k_au, dk_au, k, dk);
}

/// Integrals over the part of a cell inside the body that the incompatible modes need.
struct Inside {
    /// `linear[a][b][m]` = ∫ ∂_b(mode m) (x_a − x̄_a).
    linear: [[[f64; 8]; 3]; 3],
    /// Central second moments ∫ (x_a − x̄_a)(x_b − x̄_b).
    central: [[f64; 3]; 3],
    /// Coefficients of Π tr ε on an orthonormal basis: the mean and three linear functions.
    dilatation: [[f64; 24]; 4],
    /// The three linear coefficients for the incompatible mode (a, a); the others have no trace.
    bubble: [[f64; 3]; 3],
}

impl Inside {
    fn new(m: &Moments, floor: f64) -> Inside {
        let volume = m[0];
        let mean = POWER.map(|p| m[p] / volume);
        let mut central = [[0.0; 3]; 3];
        let mut linear = [[[0.0; 8]; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                central[a][b] = m[POWER[a] + POWER[b]] - mean[a] * m[POWER[b]];
                for n in (0..8).filter(|&n| has(n, b)) {
                    let at = PLACE[n] - POWER[b];
                    linear[a][b][n] = m[at + POWER[a]] - mean[a] * m[at];
                }
            }
        }
        let mut gram = central;
        for a in 0..3 {
            gram[a][a] += floor;
        }
        let inverse = cholesky(&mut gram);
        let mut dilatation = [[0.0; 24]; 4];
        for n in 0..8 {
            for c in (0..3).filter(|&c| has(n, c)) {
                dilatation[0][3 * n + c] = m[PLACE[n] - POWER[c]] / volume.sqrt();
                let t = forward(&gram, &inverse, [0, 1, 2].map(|a| linear[a][c][n]));
                for a in 0..3 {
                    dilatation[a + 1][3 * n + c] = t[a];
                }
            }
        }
        let columns = central.map(|column| forward(&gram, &inverse, column));
        let bubble = std::array::from_fn(|a| std::array::from_fn(|b| columns[b][a]));
        Inside { linear, central, dilatation, bubble }
    }

    /// Incompatible against trilinear modes.
    fn coupling(&self, law: &Law, k: &mut Rows9, dk: &mut Rows9) {
        for a in 0..3 {
            for d in 0..3 {
                let e = 3 * a + d;
                for m in 1..8 {
                    let i = 3 * m;
                    let mut shear = [0.0; 3];
                    shear[d] += 0.5 * self.linear[a][a][m];
                    shear[a] += 0.5 * self.linear[a][d][m];
                    if a == d {
                        for c in 0..3 {
                            shear[c] -= self.linear[a][c][m] / 3.0;
                        }
                    }
                    for c in 0..3 {
                        k[e][i + c] = law.shear[0] * shear[c];
                        dk[e][i + c] = law.shear[1] * shear[c];
                    }
                }
            }
            let e = 4 * a;
            for i in 0..24 {
                let [_, t1, t2, t3] = &self.dilatation;
                let bulk = self.bubble[0][a] * t1[i] + self.bubble[1][a] * t2[i] + self.bubble[2][a] * t3[i];
                k[e][i] += law.bulk[0] * bulk;
                dk[e][i] += law.bulk[1] * bulk;
            }
        }
    }

    /// Incompatible modes among themselves, regularised; of the full cell this block is diagonal.
    fn block(&self, law: &Law, floor: f64, k: &mut [[f64; 9]; 9], dk: &mut [[f64; 9]; 9]) {
        for a in 0..3 {
            for b in 0..3 {
                let g = self.central[a][b];
                for c in 0..3 {
                    for d in 0..3 {
                        let equal = f64::from(u8::from(c == d && a == b)) + f64::from(u8::from(d == a && b == c));
                        let traces = f64::from(u8::from(c == a && d == b));
                        let shear = (0.5 * equal - traces / 3.0) * g;
                        let bulk = traces * (0..3).map(|l| self.bubble[l][a] * self.bubble[l][b]).sum::<f64>();
                        k[3 * a + c][3 * b + d] = law.shear[0] * shear + law.bulk[0] * bulk;
                        dk[3 * a + c][3 * b + d] = law.shear[1] * shear + law.bulk[1] * bulk;
                    }
                }
            }
            for c in 0..3 {
                let e = 3 * a + c;
                let (shear, bulk) = if a == c { (floor * 2.0 / 3.0, floor) } else { (floor * 0.5, 0.0) };
                k[e][e] += law.shear[0] * shear + law.bulk[0] * bulk;
                dk[e][e] += law.shear[1] * shear + law.bulk[1] * bulk;
            }
        }
    }
}

/// K ← K − K_ua K_aa⁻¹ K_au, and the derivative [1 Xᵀ] dK [1; X] with X = −K_aa⁻¹ K_au.
fn condense(k_aa: &mut [[f64; 9]; 9], dk_aa: &[[f64; 9]; 9], k_au: Rows9, dk_au: Rows9, k: &mut M24, dk: &mut M24) {
    let inverse = cholesky(k_aa);
    let mut w = k_au;
    for r in 0..9 {
        for s in 0..r {
            subtract(&mut w, r, s, k_aa[r][s]);
        }
        w[r].iter_mut().for_each(|w| *w *= inverse[r]);
    }
    add_products(k, &w, &w, -1.0);
    // X = −L⁻ᵀ W, and Y = dK_au + ½ dK_aa X, so that dK changes by XᵀY + YᵀX (to_corners adds the transpose).
    let mut x = w.map(|row| row.map(|w| -w));
    for r in (0..9).rev() {
        for s in r + 1..9 {
            subtract(&mut x, r, s, k_aa[s][r]);
        }
        x[r].iter_mut().for_each(|x| *x *= inverse[r]);
    }
    let mut y = dk_au;
    for r in 0..9 {
        for s in 0..9 {
            for i in 0..24 {
                y[r][i] += 0.5 * dk_aa[r][s] * x[s][i];
            }
        }
    }
    add_products(dk, &x, &y, 2.0);
}

/// rows\[r\] −= factor · rows\[s\].
fn subtract(rows: &mut Rows9, r: usize, s: usize, factor: f64) {
    let other = rows[s];
    for i in 0..24 {
        rows[r][i] -= factor * other[i];
    }
}

/// K += factor · AᵀB.
fn add_products(k: &mut M24, a: &Rows9, b: &Rows9, factor: f64) {
    for (i, row) in k.as_chunks_mut::<24>().0.iter_mut().enumerate() {
        for r in 0..9 {
            let s = factor * a[r][i];
            for j in 0..24 {
                row[j] += s * b[r][j];
            }
        }
    }
}

/// Lower Cholesky factor in place; returns the inverses of its diagonal.
///
/// A pivot lost in rounding, or negative because weights do not belong to a volume, drops its mode (inverse 0).
fn cholesky<const N: usize>(a: &mut [[f64; N]; N]) -> [f64; N] {
    let mut inverse = [0.0; N];
    for j in 0..N {
        let diagonal = a[j][j];
        let pivot = diagonal - (0..j).map(|l| a[j][l] * a[j][l]).sum::<f64>();
        // 1e-14: a hundred times the rounding of one pivot.
        inverse[j] = if pivot > 1e-14 * diagonal { 1.0 / pivot.sqrt() } else { 0.0 };
        for i in j + 1..N {
            let sum = (0..j).map(|l| a[i][l] * a[j][l]).sum::<f64>();
            a[i][j] = (a[i][j] - sum) * inverse[j];
        }
    }
    inverse
}

/// L⁻¹ b.
fn forward(l: &[[f64; 3]; 3], inverse: &[f64; 3], mut b: [f64; 3]) -> [f64; 3] {
    for i in 0..3 {
        for j in 0..i {
            b[i] -= l[i][j] * b[j];
        }
        b[i] *= inverse[i];
    }
    b
}
