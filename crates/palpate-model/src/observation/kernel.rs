//! The robust kernel of every misfit: Tukey's biweight (Beaton & Tukey, Technometrics 16(2), 1974).
//!
//! ρ(r) = c²/6 · (1 − (1 − r²/c²)³) for |r| < c and c²/6 beyond: r²/2 near zero, constant from the band edge c on, with two
//! continuous derivatives (the second, at the edge, is zero). A point that finds no cell pays exactly what a point at the
//! edge pays, so a point that enters or leaves the band changes neither cost nor gradient.
//!
//! The reference program of Weiss et al. (CVPR 2020) differs: it weights ½ r² with a sigmoid that falls to zero beyond the
//! band, charges ½ c² only to points without a cell, and leaves the sigmoid out of the gradient. There a point at
//! 1.3 c is almost free while one without a cell costs most, and cost and gradient contradict each other.

/// Cost ρ(r) for band c > 0, in units of r².
pub fn cost(r: f64, c: f64) -> f64 {
    let t = (r / c) * (r / c);
    // 1 − (1 − t)³ written out: no cancellation for small residuals.
    if t < 1.0 { r * r * (0.5 - t * (0.5 - t / 6.0)) } else { c * c / 6.0 }
}

/// Influence ρ′(r) = r (1 − r²/c²)², zero outside the band.
pub fn influence(r: f64, c: f64) -> f64 {
    if r.abs() < c { r * weight(r, c) } else { 0.0 }
}

/// Gauss–Newton weight ρ′(r) / r = (1 − r²/c²)² ≥ 0: iteratively reweighted least squares uses w rᵢ² with it.
pub fn weight(r: f64, c: f64) -> f64 {
    let t = (r / c) * (r / c);
    if t < 1.0 { (1.0 - t) * (1.0 - t) } else { 0.0 }
}

/// Cost of a point that finds no cell: ρ at the band edge.
pub fn unmatched(c: f64) -> f64 {
    c * c / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const C: f64 = 0.3;

    #[test]
    fn influence_is_the_derivative_of_cost() {
        for i in -150..=150 {
            let r = 0.0101 * f64::from(i) * C;
            let d = 1e-5 * C;
            let difference = (cost(r + d, C) - cost(r - d, C)) / (2.0 * d);
            // Truncation (d/c)² = 1e-10 and rounding 1e-16 / 1e-5 of c.
            assert!((difference - influence(r, C)).abs() < 1e-9 * C, "r {r}");
            assert!((weight(r, C) * r - influence(r, C)).abs() < 1e-16);
            assert!(weight(r, C) >= 0.0);
        }
    }

    #[test]
    fn is_quadratic_at_zero_and_flat_at_the_edge() {
        for r in [1e-9, -1e-9] {
            assert!((cost(r, C) / (0.5 * r * r) - 1.0).abs() < 1e-12);
            assert!((weight(r, C) - 1.0).abs() < 1e-15);
        }
        let e = 1e-9;
        // Near the edge ρ departs from c²/6 with the third power of the distance.
        assert!((cost(C * (1.0 - e), C) - unmatched(C)).abs() < 1e-16);
        assert!(influence(C * (1.0 - e), C).abs() < 1e-16);
        for r in [C, 1.3 * C, -5.0 * C, f64::INFINITY] {
            assert_eq!(cost(r, C), unmatched(C));
            assert_eq!(influence(r, C), 0.0);
        }
    }

    #[test]
    fn cost_grows_with_the_residual() {
        let mut last = -1.0;
        for i in 0..1000 {
            let now = cost(1.2e-3 * f64::from(i) * C, C);
            // 1e-17: rounding of c²/6 where ρ is flat.
            assert!(now >= last - 1e-17);
            last = now;
        }
    }
}
