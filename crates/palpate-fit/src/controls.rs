//! Where a number that varies over the body should have values of its own: control regions, one after another, from one linearised fit.
//!
//! The body is cut into Z zones. At a fit's end g and H are gradient and Gauss–Newton matrix of −ln L by the logarithms of the zones' factors, with
//! all other free numbers eliminated. A set of k controls gives every zone the value of the nearest control, `ln f = B v`. With ln f = b as the
//! fit has it, and v ~ N(0, τ²), the logarithm of the evidence is (MacKay, *Neural Computation* 4, 1992)
//!
//! `ln Z(k) = −min_v [gᵀ(Bv − b) + ½ (Bv − b)ᵀ H (Bv − b) + ½ |v|²/τ²] − ½ ln det(I + τ² BᵀHB)`.
//!
//! One more control is worth it where ln Z grows by more than the logarithm of the number of places that were tried for it.

use crate::dense;
use faer::Mat;

/// Standard deviation of the logarithm of a control's factor: stiffer or softer by e is nothing special.
const SPREAD: f64 = 1.0;

/// What a fit says of the zones.
#[derive(Clone, Debug)]
pub struct Zones {
    /// A point of each `[Z]` [m].
    pub places: Vec<[f64; 3]>,
    /// Logarithm of each zone's factor as it was fitted `[Z]`.
    pub now: Vec<f64>,
    /// Derivative of −ln L by them `[Z]`.
    gradient: Vec<f64>,
    /// Its Gauss–Newton matrix `[Z, Z]`.
    curvature: Vec<f64>,
}

/// Controls that were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Controls {
    /// Zones whose places they have, in the order in which they were chosen.
    pub zones: Vec<usize>,
    /// Logarithm of each control's factor, as the linearised fit has it.
    pub values: Vec<f64>,
    /// Growth of the logarithm of the evidence.
    pub gain: f64,
    /// Number of places, or pairs of places, that were tried.
    pub tried: usize,
}

impl Controls {
    /// Whether the recording asks for them.
    pub fn worth(&self) -> bool {
        self.gain > (self.tried as f64).ln()
    }
}

impl Zones {
    /// From gradient `[q]` and Gauss–Newton matrix `[q, q]` of −ln L by all free numbers, of which those of the zones stand at `own`; `None` where
    /// the other numbers are not determined.
    pub fn new(places: Vec<[f64; 3]>, now: Vec<f64>, gradient: &[f64], curvature: &[f64], own: &[usize]) -> Option<Zones> {
        let q = gradient.len();
        let others: Vec<usize> = (0..q).filter(|i| !own.contains(i)).collect();
        // Numbers of all units: only their shares matter.
        let scale: Vec<f64> = (0..q).map(|i| curvature[i * q + i].sqrt()).map(|s| if s > 0.0 { 1.0 / s } else { 1.0 }).collect();
        let h = |i: usize, j: usize| curvature[i * q + j] * scale[i] * scale[j];
        let rest: Vec<f64> = others.iter().flat_map(|i| others.iter().map(|j| h(*i, *j))).collect();
        let eliminated = |right: &[f64]| if others.is_empty() { Some(Vec::new()) } else { dense::solve(&rest, right) };
        let by_gradient = eliminated(&others.iter().map(|i| gradient[*i] * scale[*i]).collect::<Vec<_>>())?;
        let (mut reduced, mut slope) = (Vec::new(), Vec::new());
        for a in own {
            let cross: Vec<f64> = others.iter().map(|i| h(*i, *a) / scale[*a]).collect();
            let share = eliminated(&cross)?;
            slope.push(gradient[*a] - dense::dot(&cross, &by_gradient));
            for b in own {
                let other: Vec<f64> = others.iter().map(|i| h(*i, *b) / scale[*b]).collect();
                reduced.push(curvature[a * q + b] - dense::dot(&other, &share));
            }
        }
        Some(Zones { places, now, gradient: slope, curvature: reduced })
    }

    fn count(&self) -> usize {
        self.places.len()
    }

    /// The control that every zone follows.
    fn follows(&self, controls: &[usize]) -> Vec<usize> {
        let apart = |a: usize, b: usize| (0..3).map(|c| (self.places[a][c] - self.places[b][c]).powi(2)).sum::<f64>();
        let nearest = |z: usize| (0..controls.len()).min_by(|a, b| apart(z, controls[*a]).total_cmp(&apart(z, controls[*b])));
        (0..self.count()).map(|z| nearest(z).unwrap_or(0)).collect()
    }

    /// ln Z of a set of controls, and their values.
    fn evidence(&self, controls: &[usize]) -> Option<(f64, Vec<f64>)> {
        let (n, k, follows) = (self.count(), controls.len(), self.follows(controls));
        let h = |i: usize, j: usize| self.curvature[i * n + j];
        // Hb − g by zones; with it what is constant, linear and quadratic in v.
        let drawn: Vec<f64> = (0..n).map(|i| (0..n).map(|j| h(i, j) * self.now[j]).sum::<f64>() - self.gradient[i]).collect();
        let (mut matrix, mut right) = (vec![0.0; k * k], vec![0.0; k]);
        for i in 0..n {
            right[follows[i]] += drawn[i];
            (0..n).for_each(|j| matrix[k * follows[i] + follows[j]] += h(i, j));
        }
        let tied: Vec<f64> = (0..k * k).map(|e| matrix[e] + if e % (k + 1) == 0 { SPREAD.powi(-2) } else { 0.0 }).collect();
        let values = dense::solve(&tied, &right)?;
        let constant: f64 = (0..n).map(|i| self.now[i] * (0.5 * (drawn[i] - self.gradient[i]))).sum();
        let least = constant - 0.5 * dense::dot(&right, &values);
        let llt = Mat::from_fn(k, k, |i, j| SPREAD * SPREAD * tied[k * i + j]).llt(faer::Side::Lower).ok()?;
        let ln_det = 2.0 * (0..k).map(|i| llt.L()[(i, i)].ln()).sum::<f64>();
        Some((-least - 0.5 * ln_det, values))
    }

    /// The best set with one control more than `before`, which stay; of the first two both are new. `None` where there is no other place.
    pub fn next(&self, before: &[usize]) -> Option<Controls> {
        let n = self.count();
        let (base, sets): (f64, Vec<Vec<usize>>) = if before.len() < 2 {
            let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| vec![a, b]));
            (self.evidence(&[0])?.0, pairs.collect())
        } else {
            let free = (0..n).filter(|z| !before.contains(z));
            (self.evidence(before)?.0, free.map(|z| before.iter().copied().chain([z]).collect()).collect())
        };
        let tried = sets.len();
        let found = sets.into_iter().filter_map(|zones| self.evidence(&zones).map(|(e, values)| (e, zones, values)));
        // Of equal ones the first, so that it is always the same.
        let best = found.fold(None, |best: Option<(f64, Vec<usize>, Vec<f64>)>, new| match best {
            Some(b) if b.0 >= new.0 => Some(b),
            _ => Some(new),
        })?;
        Some(Controls { zones: best.1, values: best.2, gain: best.0 - base, tried })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight zones in a row, each seen with this information, and one more number that shifts them all, seen by itself as well.
    fn row(true_ln: &[f64], information: f64) -> Zones {
        let n = true_ln.len();
        let q = n + 1;
        // Rows (zone z + shift) of weight `information`, and (shift) of the same; the shift's unit is a thousandth.
        let unit = 1e-3;
        let (mut g, mut h) = (vec![0.0; q], vec![0.0; q * q]);
        let mut row = |entries: &[(usize, f64)], miss: f64| {
            for (i, a) in entries {
                g[*i] += information * a * miss;
                entries.iter().for_each(|(j, b)| h[i * q + j] += information * a * b);
            }
        };
        for (z, t) in true_ln.iter().enumerate() {
            row(&[(z, 1.0), (n, unit)], -t);
        }
        row(&[(n, unit)], 0.0);
        let places = (0..n).map(|z| [z as f64, 0.0, 0.0]).collect();
        Zones::new(places, vec![0.0; n], &g, &h, &(0..n).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn two_halves_are_found_and_a_third_control_is_not_worth_it() {
        let halves: Vec<f64> = (0..8).map(|z| if z < 4 { -0.5 } else { 0.7 }).collect();
        let zones = row(&halves, 200.0);
        let two = zones.next(&[]).unwrap();
        assert!(two.worth() && two.tried == 28, "{two:?}");
        let follows = zones.follows(&two.zones);
        assert!((0..8).all(|z| follows[z] == follows[if z < 4 { 0 } else { 7 }]) && follows[0] != follows[7], "{follows:?}");
        let of = |z: usize| two.values[follows[z]];
        // The prior of sd 1 draws by one part in 1 + 4 · 200, and the shift, which all share, by a part of that.
        assert!((of(0) + 0.5).abs() < 0.01 && (of(7) - 0.7).abs() < 0.01, "{two:?}");
        let fitted = Zones { now: follows.iter().map(|k| two.values[*k]).collect(), gradient: vec![0.0; 8], ..zones };
        assert!(!fitted.next(&two.zones).unwrap().worth());
    }

    #[test]
    fn a_body_of_one_kind_needs_no_controls_and_weak_data_ask_for_none() {
        assert!(!row(&[0.0; 8], 200.0).next(&[]).unwrap().worth());
        let halves: Vec<f64> = (0..8).map(|z| if z < 4 { -0.1 } else { 0.1 }).collect();
        assert!(!row(&halves, 10.0).next(&[]).unwrap().worth());
    }

    /// The evidence against an integral over both values on a grid.
    #[test]
    fn the_evidence_is_the_integral_over_the_values() {
        let zones = row(&[-0.3, -0.2, 0.4, 0.5], 6.0);
        let cost = |v: [f64; 2]| {
            let d: Vec<f64> = zones.follows(&[0, 3]).iter().map(|k| v[*k]).collect();
            let n = 4;
            let quadratic: f64 = (0..n * n).map(|e| 0.5 * d[e / n] * zones.curvature[e] * d[e % n]).sum();
            dense::dot(&zones.gradient, &d) + quadratic + 0.5 * (v[0] * v[0] + v[1] * v[1])
        };
        let (step, mut sum) = (0.02, 0.0);
        for i in -300..=300 {
            for j in -300..=300 {
                sum += (-cost([f64::from(i) * step, f64::from(j) * step])).exp();
            }
        }
        // N(0, 1) for both has the factor 1/2π; the grid of a Gaussian is exact to rounding.
        let integral = (sum * step * step / std::f64::consts::TAU).ln();
        let found = zones.evidence(&[0, 3]).unwrap().0;
        assert!((found - integral).abs() < 1e-6, "{found} {integral}");
    }
}
