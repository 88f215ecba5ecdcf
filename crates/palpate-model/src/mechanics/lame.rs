//! Lamé parameters and their derivatives.

/// Lamé's first parameter λ and shear modulus μ [Pa] of Young's modulus `e` [Pa] and Poisson's ratio `nu`.
pub fn lame(e: f64, nu: f64) -> (f64, f64) {
    (e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu)))
}

/// Derivatives of (λ, μ) by ν at Young's modulus `e` [Pa].
pub fn lame_by_nu(e: f64, nu: f64) -> (f64, f64) {
    let a = (1.0 + nu) * (1.0 - 2.0 * nu);
    (e * (1.0 + 2.0 * nu * nu) / (a * a), -e / (2.0 * (1.0 + nu) * (1.0 + nu)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_central_differences() {
        for nu in [-0.3, 0.0, 0.3, 0.49] {
            let d = 1e-6;
            let (l1, m1) = lame(2.0, nu + d);
            let (l0, m0) = lame(2.0, nu - d);
            let (dl, dm) = lame_by_nu(2.0, nu);
            assert!(((l1 - l0) / (2.0 * d) / dl - 1.0).abs() < 1e-6);
            assert!(((m1 - m0) / (2.0 * d) / dm - 1.0).abs() < 1e-8);
        }
    }
}
