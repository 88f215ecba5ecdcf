//! Viscosity of a material: the power law σ = η γ̇^(h−1) (Ḟ + Ḟᵀ) of Hahn et al., Real2Sim (*ACM ToG* 38(6), 2019), Eq. 17, made objective.
//!
//! The paper takes the rate of F at rest coordinates, which a rigid spin has too. Here γ̇ = √2 |ΔE| / ℓ, with the increment of an objective
//! strain over a solve of length ℓ, which a rigid motion leaves at zero: Green's strain at elastic points, the corotated strain in cells.
//! The stress is the gradient of φ = ℓ η (γ̇² + s²)^((h+1)/2) / (h + 1) by the strain's increment, so tangents are symmetric, and positive for
//! every h > 0. No modulus scales it, and the trace is in it: there is bulk viscosity.

/// Rate s [1/s] below which the law turns linear, where γ̇^(h−1) would be infinite for h < 1: a bar of 10 cm changes by 1 mm in a second.
pub const SLOW: f64 = 1e-2;

/// η and h.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viscosity {
    /// η [Pa·s^h].
    pub coefficient: f64,
    /// h; 1 is a Newtonian fluid's.
    pub exponent: f64,
}

impl Viscosity {
    /// φ [J/m³] for a squared increment |ΔE|² over a solve of 1/`rate` seconds, with its first and second derivative by |ΔE|².
    pub fn loss(&self, squared: f64, rate: f64) -> [f64; 3] {
        let g = 2.0 * squared * rate * rate + SLOW * SLOW;
        let p = 0.5 * (self.exponent + 1.0);
        let first = self.coefficient * rate * g.powf(p - 1.0);
        [self.coefficient * g.powf(p) / (2.0 * p * rate), first, first * (p - 1.0) * 2.0 * rate * rate / g]
    }

    /// Derivatives of φ's first derivative by η and h.
    pub fn by_numbers(&self, squared: f64, rate: f64) -> [f64; 2] {
        let g = 2.0 * squared * rate * rate + SLOW * SLOW;
        let by_coefficient = rate * g.powf(0.5 * (self.exponent - 1.0));
        [by_coefficient, self.coefficient * by_coefficient * 0.5 * g.ln()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 120.0;

    #[test]
    fn derivatives_by_the_increment_and_the_numbers() {
        for (coefficient, exponent) in [(8.0, 0.8), (2.0, 1.0), (0.3, 2.95), (5.0, 0.2)] {
            let v = Viscosity { coefficient, exponent };
            for squared in [0.0, 1e-10, 1e-5, 2e-2] {
                let [_, first, second] = v.loss(squared, RATE);
                let d = 1e-5 * (squared + SLOW * SLOW / (2.0 * RATE * RATE));
                let difference = |k: usize| (v.loss(squared + d, RATE)[k] - v.loss(squared - d, RATE)[k]) / (2.0 * d);
                assert!((difference(0) - first).abs() < 1e-8 * first, "{exponent} {squared}");
                assert!((difference(1) - second).abs() < 1e-8 * (second.abs() + first / d * 1e-5), "{exponent} {squared}");
                let by = v.by_numbers(squared, RATE);
                let at = |dc: f64, dh: f64| {
                    Viscosity { coefficient: coefficient + dc, exponent: exponent + dh }.loss(squared, RATE)[1]
                };
                assert!(((at(1e-5, 0.0) - at(-1e-5, 0.0)) / 2e-5 - by[0]).abs() < 1e-8 * by[0]);
                assert!(((at(0.0, 1e-5) - at(0.0, -1e-5)) / 2e-5 - by[1]).abs() < 1e-7 * by[1].abs().max(first));
            }
        }
    }

    /// Shear at a rate of γ̇ has the shear stress η γ̇^h.
    #[test]
    fn simple_shear_has_the_published_stress() {
        let v = Viscosity { coefficient: 8.0, exponent: 0.8 };
        let shear_rate: f64 = 3.0;
        let increment = 0.5 * shear_rate / RATE;
        // E_xy = E_yx: |ΔE|² = 2 ΔE_xy², and σ_xy = ½ ∂φ/∂E_xy of both.
        let stress = v.loss(2.0 * increment * increment, RATE)[1] * 2.0 * increment;
        let exact = 8.0 * shear_rate.powf(0.8);
        // Of the rate s nothing but (s/γ̇)² is left.
        assert!((stress / exact - 1.0).abs() < 1.1e-5, "{stress} {exact}");
    }
}
