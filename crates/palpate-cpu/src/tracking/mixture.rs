//! Which place of the surface a depth point belongs to, softly: shares of a Gaussian mixture whose components are the visible places, weighted by
//! their area, beside a uniform share of outliers (Wang et al. 2015, eq. 4).
//!
//! `p_kn = (1 − w) π_k L_kn / (Σ_j (1 − w) π_j L_jn + w/V)` with `L_kn = (2πσ²)^(−3/2) exp(−|c_n − s_k|²/2σ²)`, w the share of outliers and V
//! the volume they lie in. The place k needs `P_k = Σ_n p_kn` and `Q_k = Σ_n p_kn c_n`. Both sums are gathered, first by point and then by
//! place, so that no sum depends on the number of threads.

use super::cubes::Cubes;
use super::surface;
use glam::DVec3;
use palpate_engine::tracking::{Mixing, Share, Sighting};
use palpate_model::observation::ObservedPoint;
use rayon::prelude::*;

/// P and Q of every place.
#[derive(Debug)]
pub struct Mixture {
    pub shares: Vec<Share>,
    /// Logarithm of the likelihood of all points, up to a constant.
    #[cfg(test)]
    pub likelihood: f64,
}

/// Every so-manieth of `n` things.
fn every(n: usize, step: usize) -> Vec<usize> {
    (0..n).step_by(step).collect()
}

impl Mixture {
    /// The shares of a frame's points.
    pub fn new(s: &Sighting, spread: f64, outliers: f64) -> Mixture {
        let all = s.places;
        let weights: Vec<Vec<f64>> = surface::visible(s)
            .iter()
            .map(|seen| {
                let area = |k: usize| if seen[k] { all[k].area } else { 0.0 };
                let whole: f64 = (0..all.len()).map(area).sum();
                (0..all.len()).map(|k| if whole > 0.0 { area(k) / whole } else { 0.0 }).collect()
            })
            .collect();
        let positions: Vec<DVec3> = all.iter().map(|p| p.position).collect();
        shares(s.points, &positions, &weights, spread, outliers)
    }
}

/// P and Q of places, whose weights π differ from camera to camera `[C][K]`.
fn shares(points: &[ObservedPoint], positions: &[DVec3], weights: &[Vec<f64>], spread: f64, outliers: f64) -> Mixture {
    let mut shares = vec![(0.0, DVec3::ZERO); positions.len()];
    if points.is_empty() {
        return Mixture {
            shares,
            #[cfg(test)]
            likelihood: 0.0,
        };
    }
    let Mixing { volume, reach, thin } = Mixing::new(points, positions.len(), spread);
    let (some_points, some_places) = (every(points.len(), thin), every(positions.len(), thin));
    let at = |which: &[usize], of: &dyn Fn(usize) -> DVec3| which.iter().map(|i| of(*i)).collect::<Vec<_>>();
    let (xs, cs) = (at(&some_places, &|k| positions[k]), at(&some_points, &|n| points[n].position));
    let (by_place, by_point) = (Cubes::new(&xs, reach), Cubes::new(&cs, reach));
    let inlier = (1.0 - outliers) * thin as f64 * (std::f64::consts::TAU * spread * spread).powf(-1.5);
    let likelihood = |k: usize, n: usize| {
        let d = (cs[n] - xs[k]).length_squared();
        let pi = weights[points[some_points[n]].camera as usize][some_places[k]];
        if pi > 0.0 && d < reach * reach { inlier * pi * (-0.5 * d / (spread * spread)).exp() } else { 0.0 }
    };
    let sums: Vec<f64> = (0..cs.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|n| {
            let mut sum = outliers / volume;
            by_place.near(cs[n], |k| sum += likelihood(k, n));
            sum
        })
        .collect();
    let found: Vec<(f64, DVec3)> = (0..xs.len())
        .into_par_iter()
        .with_min_len(64)
        .map(|k| {
            let (mut p, mut q) = (0.0, DVec3::ZERO);
            by_point.near(xs[k], |n| {
                if sums[n] > 0.0 {
                    let share = thin as f64 * likelihood(k, n) / sums[n];
                    p += share;
                    q += share * cs[n];
                }
            });
            (p, q)
        })
        .collect();
    some_places.iter().zip(found).for_each(|(k, s)| shares[*k] = s);
    Mixture {
        shares,
        #[cfg(test)]
        likelihood: thin as f64 * sums.iter().filter(|s| **s > 0.0).map(|s| s.ln()).sum::<f64>(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(at: &[DVec3]) -> Vec<ObservedPoint> {
        at.iter().map(|p| ObservedPoint { position: *p, camera: 0 }).collect()
    }

    /// A quarter of a thousand places and points on a bent sheet.
    fn sheet(shift: f64) -> Vec<DVec3> {
        let one = |i: usize, j: usize| {
            DVec3::new(0.02 * i as f64 + shift, 0.02 * j as f64 - 0.5 * shift, 0.1 * (0.02 * i as f64).powi(2))
        };
        (0..16).flat_map(|i| (0..16).map(move |j| one(i, j))).collect()
    }

    #[test]
    fn shares_are_those_of_all_pairs() {
        let (places, seen) = (sheet(0.0), points(&sheet(0.007)));
        let weights: Vec<f64> = (0..places.len()).map(|k| if k % 7 == 0 { 0.0 } else { 1.0 + 0.1 * (k % 3) as f64 }).collect();
        let (spread, w) = (0.015, 0.1);
        let found = shares(&seen, &places, std::slice::from_ref(&weights), spread, w);
        let at = seen.iter().map(|p| p.position);
        let (low, high) = at.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let side = (high - low).max(DVec3::splat(spread));
        let volume = side.x * side.y * side.z;
        let l = |k: usize, n: usize| {
            let d = (seen[n].position - places[k]).length_squared();
            (1.0 - w) * weights[k] * (std::f64::consts::TAU * spread * spread).powf(-1.5) * (-0.5 * d / (spread * spread)).exp()
        };
        for k in 0..places.len() {
            let (mut p, mut q) = (0.0, DVec3::ZERO);
            for (n, c) in seen.iter().enumerate() {
                let all: f64 = (0..places.len()).map(|j| l(j, n)).sum::<f64>() + w / volume;
                p += l(k, n) / all;
                q += l(k, n) / all * c.position;
            }
            // What lies beyond four standard deviations is left out: exp(−8) of the peak each.
            assert!(
                (found.shares[k].0 - p).abs() < 5e-3 && (found.shares[k].1 - q).length() < 2e-3,
                "{k}: {:?} {p} {q}",
                found.shares[k]
            );
        }
    }

    #[test]
    fn points_without_a_body_nearby_are_outliers() {
        let far = [DVec3::new(3.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)];
        let found = shares(&points(&far), &sheet(0.0), &[vec![1.0 / 256.0; 256]], 0.01, 0.05);
        assert!(found.shares.iter().all(|s| s.0 == 0.0));
    }

    #[test]
    fn what_no_camera_sees_is_drawn_by_nothing() {
        let places = sheet(0.0);
        let weights: Vec<f64> = (0..places.len()).map(|k| f64::from(u8::from(k < 128)) / 128.0).collect();
        let found = shares(&points(&sheet(0.0)), &places, &[weights], 0.02, 0.05);
        assert!(found.shares[128..].iter().all(|s| s.0 == 0.0) && found.shares[..128].iter().all(|s| s.0 > 0.0));
    }
}
