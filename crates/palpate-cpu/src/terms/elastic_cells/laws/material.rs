//! The material of a cut cell where it is not linear: its energy of the mean strain, less the linear one's, over E.

use super::{CellLaws, ENERGY, Slopes};
use palpate_model::materials::stretching::PAIRS;
use palpate_model::materials::{self, Gradient, Solid};

/// The mean strain as a displacement gradient.
fn strain(s: &[f64; ENERGY]) -> Gradient<f64> {
    let [_, xx, yy, zz, yz, zx, xy] = *s;
    [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]
}

/// Entries of a flattened matrix that one component of the strain stands in.
fn entries([a, b]: [usize; 2]) -> impl Iterator<Item = usize> + Clone {
    std::iter::once(3 * a + b).chain((a != b).then_some(3 * b + a))
}

/// Derivative of the linear material's energy by a component of the strain.
pub(in crate::terms) fn linear_stress([a, b]: [usize; 2], strain: f64, trace: f64, (lambda, mu): (f64, f64)) -> f64 {
    if a == b { lambda * trace + 2.0 * mu * strain } else { 4.0 * mu * strain }
}

/// Derivative of that by another component.
pub(in crate::terms) fn linear_tangent(c: usize, d: usize, (lambda, mu): (f64, f64)) -> f64 {
    let normal = |c: usize| PAIRS[c][0] == PAIRS[c][1];
    match (normal(c) && normal(d), c == d) {
        (true, same) => lambda + if same { 2.0 * mu } else { 0.0 },
        (false, true) => 4.0 * mu,
        (false, false) => 0.0,
    }
}

impl CellLaws<'_> {
    /// Second derivatives by the strains such that the sum with the linear material's, `scale` times those for E = 1, has no negative
    /// eigenvalue. That much of the mean strain's energy is in K, so the cell's tangent then has none either.
    pub(super) fn convex(&self, second: [[f64; ENERGY]; ENERGY], scale: f64) -> [[f64; ENERGY]; ENERGY] {
        let linear = |c: usize, d: usize| scale * linear_tangent(c, d, self.lame[0]);
        let mut sum: [[f64; 6]; 6] = std::array::from_fn(|c| std::array::from_fn(|d| second[1 + c][1 + d] + linear(c, d)));
        crate::linear::dense::without_negative_eigenvalues(&mut sum);
        let mut out = second;
        (0..6).for_each(|c| (0..6).for_each(|d| out[1 + c][1 + d] = sum[c][d] - linear(c, d)));
        out
    }

    /// The material's energy density over E beyond the linear one's, at the mean strain in `s`.
    pub(super) fn material_energy(&self, law: &dyn Solid, s: &[f64; ENERGY]) -> f64 {
        let ((lambda, mu), h) = (self.lame[0], strain(s));
        law.value(&h, lambda, mu) - materials::linear(&h, lambda, mu)
    }

    /// Adds its derivatives.
    pub(super) fn add_material(&self, law: &dyn Solid, s: &[f64; ENERGY], slopes: &mut Slopes) {
        let (lambda, mu) = self.lame[0];
        let h = strain(s);
        let (stress, tangent) = law.stress(&h, lambda, mu);
        let trace = h[0][0] + h[1][1] + h[2][2];
        for (c, pair) in PAIRS.iter().enumerate() {
            let (own, linear) = (entries(*pair), linear_stress(*pair, s[1 + c], trace, (lambda, mu)));
            slopes.first[1 + c] += own.clone().map(|k| stress[k]).sum::<f64>() - linear;
            for (d, other) in PAIRS.iter().enumerate() {
                let of_linear = linear_tangent(c, d, (lambda, mu));
                let both = own.clone().flat_map(|a| entries(*other).map(move |b| (a, b)));
                slopes.second[1 + c][1 + d] += both.map(|(a, b)| tangent[a][b]).sum::<f64>() - of_linear;
            }
        }
    }

    /// Derivative of the material's first derivatives by Poisson's ratio.
    pub(super) fn material_by_poisson(&self, s: &[f64; ENERGY]) -> [f64; ENERGY] {
        let Some(law) = self.material else { return [0.0; ENERGY] };
        let ((lambda, mu), by_nu) = (self.lame[0], self.lame[1]);
        let h = strain(s);
        let [by_lambda, by_mu] = law.by_moduli(&h, lambda, mu);
        let trace = h[0][0] + h[1][1] + h[2][2];
        let of = |c: usize| {
            let own: f64 = entries(PAIRS[c]).map(|k| by_nu.0 * by_lambda[k] + by_nu.1 * by_mu[k]).sum();
            own - linear_stress(PAIRS[c], s[1 + c], trace, by_nu)
        };
        std::array::from_fn(|k| if k == 0 { 0.0 } else { of(k - 1) })
    }

    /// Derivatives of the material's first derivatives by the factors of its curves.
    pub(super) fn material_by_curves(&self, s: &[f64; ENERGY]) -> Vec<[f64; ENERGY]> {
        let Some(law) = self.material else { return Vec::new() };
        let ((lambda, mu), h) = (self.lame[0], strain(s));
        let of =
            |by: [f64; 9]| std::array::from_fn(|k| if k == 0 { 0.0 } else { entries(PAIRS[k - 1]).map(|i| by[i]).sum::<f64>() });
        law.by_curves(&h, lambda, mu).into_iter().map(of).collect()
    }
}
