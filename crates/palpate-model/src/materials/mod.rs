//! Materials: energy per rest volume at one deformation gradient F. One file and one line of [`ALL`] each; a twin of the same name in
//! `shaders/materials/` gives it to the GPU.
//!
//! A material is written for any number type in the displacement gradient H = F − I, in an order that cancels nothing: so its derivatives
//! are exact also at strains of 1e-5 in single precision, where |F|² − 3 has lost half its digits.
//!
//! On cut cells a material adds to the enhanced, corotated linear element V [ψ(ε) − ψ_lin(ε)] with ε the mean strain over the part of the cell
//! that deforms, U − I where F is uniform. What ψ_lin takes away is no more than the element has
//! ([`crate::cutcells::elements::Elements::gradient`]). Bending modes stay the linear ones, so nothing locks, and weights of cut cells that are
//! negative do no harm. At points of stencils ψ is taken at F itself.

mod corotated_linear;
pub mod curve;
mod neo_hookean;
mod neo_hookean_log;
pub mod principal_stretch;
mod stable_neo_hookean;
pub mod stretching;
pub mod viscosity;

use crate::effects::law::Number;
use num_dual::HyperDual64;

/// A 3 × 3 matrix of numbers, row by row.
pub type Gradient<D> = [[D; 3]; 3];

/// A material model of the registry.
pub struct Model {
    /// Name in scene files, `[material] model = "…"`.
    pub name: &'static str,
    /// One sentence for `--help` and reports.
    pub doc: &'static str,
    /// Its law.
    pub law: &'static dyn Solid,
    /// True for the material that the elements of cut cells are made of.
    pub is_linear: bool,
    /// True where scenes state curves of the stiffness ([`curve`]).
    pub has_curves: bool,
}

impl Model {
    /// True where the GPU has it: of curves, which are numbers of their own, it knows nothing yet.
    pub fn has_twin(&self) -> bool {
        !self.has_curves
    }
}

impl std::fmt::Debug for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Model {
    fn eq(&self, other: &Model) -> bool {
        self.name == other.name
    }
}

/// All materials; the first is the default.
pub static ALL: &[Model] =
    &[corotated_linear::MODEL, neo_hookean::MODEL, neo_hookean_log::MODEL, stable_neo_hookean::MODEL, principal_stretch::MODEL];

/// The material of this name.
pub fn find(name: &str) -> Option<&'static Model> {
    ALL.iter().find(|m| m.name == name)
}

/// A material's law. Implement this; derivatives follow.
pub trait Hyperelastic: Sync {
    /// ψ [J/m³] at H for Lamé parameters λ and μ [Pa]; not a number where the material does not exist (det F ≤ 0 for those with a barrier).
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D;

    /// [`Solid::stress`] by formula, for materials that are worth one: several times as fast as dual numbers.
    fn stress_by_formula(&self, _h: &Gradient<f64>, _lambda: f64, _mu: f64) -> Option<Stress> {
        None
    }

    /// [`Solid::first`] likewise.
    fn first_by_formula(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Option<[f64; 9]> {
        self.stress_by_formula(h, lambda, mu).map(|s| s.0)
    }

    /// True where ψ is linear in λ and μ: then [`Solid::by_moduli`] are the stresses at moduli of one and zero.
    fn is_linear_in_moduli(&self) -> bool {
        false
    }
}

/// P [Pa] and ∂P/∂F [Pa], matrices flattened row by row.
pub type Stress = ([f64; 9], [[f64; 9]; 9]);

/// A [`Hyperelastic`] law with its derivatives, without its type. Matrices are flattened row by row.
pub trait Solid: Sync {
    /// ψ [J/m³].
    fn value(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> f64;
    /// First Piola–Kirchhoff stress P = ∂ψ/∂F [Pa] and its derivative ∂P/∂F [Pa].
    fn stress(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Stress;
    /// P alone, which forces need more often than its derivative.
    fn first(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> [f64; 9] {
        self.stress(h, lambda, mu).0
    }
    /// ∂P/∂λ and ∂P/∂μ.
    fn by_moduli(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> [[f64; 9]; 2];
    /// ∂P/∂(factor) for every corner of the curves of a material that has some.
    fn by_curves(&self, _h: &Gradient<f64>, _lambda: f64, _mu: f64) -> Vec<[f64; 9]> {
        Vec::new()
    }
}

impl<L: Hyperelastic> Solid for L {
    fn value(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> f64 {
        self.energy(h, lambda, mu)
    }

    fn stress(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> Stress {
        self.stress_by_formula(h, lambda, mu).unwrap_or_else(|| by_dual_numbers(self, h, lambda, mu))
    }

    fn first(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> [f64; 9] {
        self.first_by_formula(h, lambda, mu).unwrap_or_else(|| self.stress(h, lambda, mu).0)
    }

    fn by_moduli(&self, h: &Gradient<f64>, lambda: f64, mu: f64) -> [[f64; 9]; 2] {
        if self.is_linear_in_moduli() {
            return [self.first(h, 1.0, 0.0), self.first(h, 0.0, 1.0)];
        }
        let mut lifted = h.map(|row| row.map(HyperDual64::from));
        let mut out = [[0.0; 9]; 2];
        for k in 0..9 {
            lifted[k / 3][k % 3].eps1 = 1.0;
            for (m, out) in out.iter_mut().enumerate() {
                let (mut l, mut g) = (HyperDual64::from(lambda), HyperDual64::from(mu));
                if m == 0 {
                    l.eps2 = 1.0
                } else {
                    g.eps2 = 1.0
                }
                out[k] = self.energy(&lifted, l, g).eps1eps2;
            }
            lifted[k / 3][k % 3].eps1 = 0.0;
        }
        out
    }
}

/// Stress and tangent from the energy alone.
fn by_dual_numbers<L: Hyperelastic + ?Sized>(law: &L, h: &Gradient<f64>, lambda: f64, mu: f64) -> Stress {
    let mut lifted = h.map(|row| row.map(HyperDual64::from));
    let (mut first, mut second) = ([0.0; 9], [[0.0; 9]; 9]);
    for a in 0..9 {
        for b in 0..=a {
            lifted[a / 3][a % 3].eps1 = 1.0;
            lifted[b / 3][b % 3].eps2 = 1.0;
            let v = law.energy(&lifted, HyperDual64::from(lambda), HyperDual64::from(mu));
            lifted[a / 3][a % 3].eps1 = 0.0;
            lifted[b / 3][b % 3].eps2 = 0.0;
            first[a] = v.eps1;
            (second[a][b], second[b][a]) = (v.eps1eps2, v.eps1eps2);
        }
    }
    (first, second)
}

/// ½λ tr²ε + μ ε:ε of a symmetric ε.
pub fn linear<D: Number>(e: &Gradient<D>, lambda: D, mu: D) -> D {
    let trace = e[0][0] + e[1][1] + e[2][2];
    trace * trace * lambda * 0.5 + squares(e) * mu
}

/// Σ H_ij².
fn squares<D: Number>(h: &Gradient<D>) -> D {
    h.iter().flatten().fold(D::from(0.0), |sum, v| sum + *v * *v)
}

/// Parts of J − 1 = tr H + c + det H: the trace, c = ½(tr²H − tr H²), and the determinant.
fn volume_parts<D: Number>(h: &Gradient<D>) -> [D; 3] {
    let minor = |i: usize, j: usize| h[i][i] * h[j][j] - h[i][j] * h[j][i];
    let det = h[0][0] * (h[1][1] * h[2][2] - h[1][2] * h[2][1]) - h[0][1] * (h[1][0] * h[2][2] - h[1][2] * h[2][0])
        + h[0][2] * (h[1][0] * h[2][1] - h[1][1] * h[2][0]);
    [h[0][0] + h[1][1] + h[2][2], minor(0, 1) + minor(1, 2) + minor(2, 0), det]
}

/// x − ln(1 + x), whose derivative is x/(1 + x).
fn minus_ln1p<D: Number>(x: D) -> D {
    x - x.ln_1p()
}

/// Shear energy per μ that all neo-Hookean materials share: ½(|F|² − 3) − ln J = ½|H|² − c − det H + (j − ln(1 + j)).
fn shear<D: Number>(h: &Gradient<D>, [_, c, det]: [D; 3], j: D) -> D {
    squares(h) * 0.5 - c - det + minus_ln1p(j)
}

/// A deformation as materials of ψ = μ · shear + U(J) see it. With G = F⁻ᵀ, p = J U′ and q = J p′:
/// P = μ (F − G) + p G, where F − G = G (HᵀH + H + Hᵀ) loses no digits at small strains, and ∂P[δ] = μ δ + (μ − p) G δᵀ G + q (G : δ) G.
struct Barrier {
    g: Gradient<f64>,
    mu: f64,
    p: f64,
    q: f64,
}

impl Barrier {
    /// At H, for p and q as functions of j = J − 1.
    fn new(h: &Gradient<f64>, mu: f64, pressure: impl Fn(f64) -> [f64; 2]) -> Barrier {
        let [trace, c, det] = volume_parts(h);
        let j = trace + c + det;
        let g = cofactors(&deformation(h)).map(|row| row.map(|v| v / (1.0 + j)));
        let [p, q] = if j > -1.0 { pressure(j) } else { [f64::NAN; 2] };
        Barrier { g, mu, p, q }
    }

    /// P.
    fn first(&self, h: &Gradient<f64>) -> [f64; 9] {
        let twice: Gradient<f64> =
            std::array::from_fn(|a| std::array::from_fn(|b| h[a][b] + h[b][a] + (0..3).map(|k| h[k][a] * h[k][b]).sum::<f64>()));
        std::array::from_fn(|a| {
            let (i, k) = (a / 3, a % 3);
            self.mu * (0..3).map(|m| self.g[i][m] * twice[m][k]).sum::<f64>() + self.p * self.g[i][k]
        })
    }

    /// ∂P/∂F.
    fn second(&self) -> [[f64; 9]; 9] {
        let Barrier { g, mu, p, q } = self;
        let mut second = [[0.0; 9]; 9];
        for (a, row) in second.iter_mut().enumerate() {
            let (i, k) = (a / 3, a % 3);
            for (b, entry) in row.iter_mut().enumerate() {
                let (m, n) = (b / 3, b % 3);
                // (G δᵀ G)_ik for δ = e_m ⊗ e_n is G_in G_mk.
                *entry = (mu - p) * g[i][n] * g[m][k] + q * g[m][n] * g[i][k];
            }
            row[a] += mu;
        }
        second
    }

    fn stress(&self, h: &Gradient<f64>) -> Stress {
        (self.first(h), self.second())
    }
}

/// Cofactors: the inverse's transpose times the determinant.
fn cofactors<D: Number>(m: &Gradient<D>) -> Gradient<D> {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
            m[a][c] * m[b][d] - m[a][d] * m[b][c]
        })
    })
}

/// H + I.
fn deformation<D: Number>(h: &Gradient<D>) -> Gradient<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| h[i][j] + f64::from(u8::from(i == j))))
}

#[cfg(test)]
mod tests;
