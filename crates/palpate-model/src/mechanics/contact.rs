//! Contact law of a plane: a smooth, compactly supported penalty pressure.
//!
//! p = stiffness · g(gap) with g = 0 for gap ≥ w, g = −gap for gap ≤ −w and a C² blend between. Unlike a softplus
//! layer it acts at no distance beyond w, and unlike max(−gap, 0) Newton's method sees no kink.

//!
//! In a step of the θ-scheme a surface point feels the mean of the law over the last part of its way from the old gap to the new one, by
//! Gauss–Legendre quadrature ([`instants`]). At θ = ½ that is the whole way, the average vector field of Quispel & McLaren
//! (*J. Phys. A* 41, 2008): of second order, it neither swallows energy at touch-down nor lets contact run ahead of a body that rolls. From
//! [`DAMPED`] on it is the new state alone, which is of first order but calm where a body crosses much of a cell in a step. For every such
//! part the work is not less than the energy's change, because the law is convex: contact limits no time step.

use crate::effects::law::Number;

/// Points of the quadrature over a step: with three, a point that touches down somewhere within a step keeps its energy to a ninth of
/// what the layer takes; the force of the new state alone swallows between one and three times as much as the layer takes.
pub const INSTANTS: usize = 3;

/// Weight θ of the new state from which on contact acts there alone.
pub const DAMPED: f64 = 0.6;

/// Distance of its outer points from the middle, in parts of the interval.
pub const INSTANT_OFFSET: f64 = 0.387_298_334_620_741_7;

/// Weight of each of its outer points.
pub const INSTANT_WEIGHT: f64 = 5.0 / 18.0;

/// True where contact acts along the way of a step, not in its new state alone, for weight `theta` of the new state.
pub fn acts_along(theta: f64) -> bool {
    // θ may have been made of a step's factors.
    theta <= DAMPED - 1e-6
}

/// Where in a step contact begins to act, 0 to 1, for weight `theta` of the new state.
fn beginning(theta: f64) -> f64 {
    if acts_along(theta) { (theta - 0.5) / (DAMPED - 0.5) } else { 1.0 }
}

/// (weight, place σ in the step) of every evaluation of the law, for weight `theta` of the new state: gaps are taken at
/// old + σ (new − old). Weights add to 1. Where the new state counts alone (θ from [`DAMPED`] on; 1 in a static problem) that is the first
/// evaluation, and the others weigh nothing.
pub fn instants(theta: f64) -> [(f64, f64); INSTANTS] {
    if !acts_along(theta) {
        return [(1.0, 1.0), (0.0, 1.0), (0.0, 1.0)];
    }
    let from = beginning(theta);
    let at = |t: f64| from + (1.0 - from) * t;
    [
        (INSTANT_WEIGHT, at(0.5 - INSTANT_OFFSET)),
        (1.0 - 2.0 * INSTANT_WEIGHT, at(0.5)),
        (INSTANT_WEIGHT, at(0.5 + INSTANT_OFFSET)),
    ]
}

/// Default penalty stiffness in units of E / h, i.e. stiffness = `DEFAULT_STIFFNESS` · E / h [Pa/m].
///
/// The layer errs twice, both in proportion to the cell, as the rest of the discretisation does. It yields p h / (k E) under a pressure p
/// where it is used up, and it begins w above the plane, so that a contact looks wider than it is by the rim where the gap is below w.
/// With k w = E/2 both cancel at p = 3/16 k w = 0.094 E, where the surface lies in the plane: that is the mean pressure of a ball pressed
/// flat to a fifth of its radius. What is left is the rim, and it asks for a small w. A ball of 12 cells to its radius, pressed so
/// (`cargo xtask verify --only hertz`), has by k and w = 1/2k
/// a radius of contact that is 3.2 % too large and a mean pressure 5.2 % too small with 10, 0.3 % and 1.1 % with 20; with 50 patches of the
/// surface are too coarse for the rim, and the errors are −1.3 % and 1.5 %. A stiffer layer than 20 hence buys nothing, and costs: curvature k/w of
/// the law, on which Newton's steps depend, and the condition of the tangent grow as k² and k.
pub const DEFAULT_STIFFNESS: f64 = 20.0;

/// Half width w of the blend as a fraction of the cell edge h: up to p = E/2 the surface is never more than w off the plane on either side.
pub const WIDTH: f64 = 0.025;

/// Pressure [Pa] at a signed `gap` [m] (negative = penetration) and its derivative by the gap [Pa/m].
///
/// `stiffness` [Pa/m] and the half `width` w of the blend [m] are positive. With s = (w − gap) / 2w in the blend:
/// g = 2w (s³ − s⁴/2), g′ = −(3s² − 2s³). The pressure is linear in the stiffness: dp/dstiffness = p / stiffness.
pub fn pressure(gap: f64, stiffness: f64, width: f64) -> (f64, f64) {
    if gap >= width {
        (0.0, 0.0)
    } else if gap <= -width {
        (-stiffness * gap, -stiffness)
    } else {
        let s = (width - gap) / (2.0 * width);
        let s2 = s * s;
        (stiffness * 2.0 * width * s2 * s * (1.0 - 0.5 * s), -stiffness * s2 * (3.0 - 2.0 * s))
    }
}

/// Energy per area [J/m²] of a `gap` [m]: the integral of the pressure from the gap to infinity.
pub fn energy(gap: f64, stiffness: f64, width: f64) -> f64 {
    if gap >= width {
        0.0
    } else if gap <= -width {
        // ½ gap² and what the blend adds: 0.6 w² at gap = −w instead of ½ w².
        stiffness * (0.5 * gap * gap + 0.1 * width * width)
    } else {
        let s = (width - gap) / (2.0 * width);
        stiffness * 4.0 * width * width * s * s * s * s * (0.25 - 0.1 * s)
    }
}

/// [`pressure`] without its slope, for numbers that carry derivatives.
pub fn pressure_of<D: Number>(gap: D, stiffness: D, width: f64) -> D {
    if gap.re() >= width {
        D::from(0.0)
    } else if gap.re() <= -width {
        -stiffness * gap
    } else {
        let s = (-gap + width) * (0.5 / width);
        stiffness * s.powi(3) * (-s * 0.5 + 1.0) * (2.0 * width)
    }
}

/// [`energy`] for numbers that carry derivatives.
pub fn energy_of<D: Number>(gap: D, stiffness: D, width: f64) -> D {
    if gap.re() >= width {
        D::from(0.0)
    } else if gap.re() <= -width {
        stiffness * (gap * gap * 0.5 + 0.1 * width * width)
    } else {
        let s = (-gap + width) * (0.5 / width);
        stiffness * s.powi(4) * (-s * 0.1 + 0.25) * (4.0 * width * width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_agree() {
        for i in -200..=200 {
            let gap = 0.0101 * f64::from(i) * W;
            assert!((pressure_of(gap, K, W) - pressure(gap, K, W).0).abs() <= 1e-15 * K * W);
            assert!((energy_of(gap, K, W) - energy(gap, K, W)).abs() <= 1e-15 * K * W * W);
        }
    }

    const K: f64 = 3.0e5;
    const W: f64 = 2.0e-4;

    #[test]
    fn slope_is_the_derivative_of_pressure() {
        for i in -200..=200 {
            let gap = 0.0101 * f64::from(i) * W;
            let d = 1e-5 * W;
            let difference = (pressure(gap + d, K, W).0 - pressure(gap - d, K, W).0) / (2.0 * d);
            // Truncation (d/w)² and rounding 1e-16 / 1e-5, both below 1e-9; at the ends g‴ jumps: still (d/w)².
            assert!((difference - pressure(gap, K, W).1).abs() < 1e-9 * K, "gap {gap}");
        }
    }

    #[test]
    fn pressure_is_the_derivative_of_energy() {
        for i in -200..=200 {
            let gap = 0.0101 * f64::from(i) * W;
            let d = 1e-5 * W;
            let difference = -(energy(gap + d, K, W) - energy(gap - d, K, W)) / (2.0 * d);
            assert!((difference - pressure(gap, K, W).0).abs() < 1e-8 * K * W, "gap {gap}");
        }
    }

    #[test]
    fn the_quadrature_over_a_step_is_the_mean_of_its_part() {
        for theta in [0.5, 0.55, 0.6, 0.75, 1.0] {
            let from = beginning(theta);
            for power in 0..6 {
                let sum: f64 = instants(theta).iter().map(|(w, at)| w * at.powi(power)).sum();
                // Mean of σⁿ over [from, 1].
                let mean: f64 = (0..=power).map(|k| from.powi(k)).sum::<f64>() / f64::from(power + 1);
                assert!((sum - mean).abs() < 1e-15, "{theta} {power}: {sum} {mean}");
            }
        }
    }

    #[test]
    fn a_touch_down_keeps_its_energy_and_never_gains_much() {
        // Work against the mean pressure from above the layer to a depth, against the energy there; with 0.6 the new state counts alone.
        for theta in [0.5, 0.52, 0.6] {
            let (mut least, mut most) = (f64::INFINITY, 0.0f64);
            for start in 0..200 {
                let (old, new) = (W + 0.05 * f64::from(start) * W, -10.0 * W);
                let mean: f64 = instants(theta).iter().map(|(w, at)| w * pressure(old + at * (new - old), K, W).0).sum();
                let ratio = mean * (old - new) / energy(new, K, W);
                (least, most) = (least.min(ratio), most.max(ratio));
            }
            match theta {
                // Three points miss the corner of the law by up to a ninth of the whole.
                0.5 => assert!(least > 0.88 && most < 1.12, "{least} {most}"),
                0.52 => assert!(least > 1.0 && most < 1.4, "{least} {most}"),
                _ => assert!(least > 1.9 && most > 3.5, "{least} {most}"),
            }
        }
    }

    #[test]
    fn curvature_is_continuous_at_both_ends() {
        let curvature = |gap: f64| {
            let d = 1e-4 * W;
            (pressure(gap + d, K, W).1 - pressure(gap - d, K, W).1) / (2.0 * d)
        };
        // p″ is at most 0.75 K/w in the blend; it vanishes at the ends up to its slope 1.5 K/w² times the step.
        for end in [-W, W] {
            assert!(curvature(end).abs() < 1e-3 * K / W);
        }
        assert!((curvature(0.0) / (0.75 * K / W) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn is_exactly_zero_outside_and_linear_inside() {
        assert_eq!(pressure(W, K, W), (0.0, 0.0));
        assert_eq!(pressure(1.0, K, W), (0.0, 0.0));
        assert_eq!(pressure(-2.0 * W, K, W), (2.0 * W * K, -K));
        assert!((pressure(-W * (1.0 - 1e-12), K, W).0 / (K * W) - 1.0).abs() < 1e-10);
    }

    #[test]
    fn documented_penetrations_hold() {
        // With h = 1 and E = 1 the stiffness is DEFAULT_STIFFNESS and the width WIDTH.
        assert!((pressure(0.005, DEFAULT_STIFFNESS, WIDTH).0 - 0.05).abs() < 0.005);
        assert!((pressure(0.0, DEFAULT_STIFFNESS, WIDTH).0 - 0.094).abs() < 0.0005);
        assert!((pressure(-WIDTH, DEFAULT_STIFFNESS, WIDTH).0 - 0.5).abs() < 1e-12);
    }
}
