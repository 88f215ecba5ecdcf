//! What every point of a cloud stands for: the share of the shape's inside that is nearest to it.

use super::near::Near;
use crate::shape::Shape;
use glam::DVec3;
use rayon::prelude::*;

/// Samples along a spacing.
const SAMPLES: usize = 4;

/// Volumes of the points [m³], which sum to `volume`, by counting samples of a lattice.
///
/// # Errors
/// Points that no part of the inside is nearest to.
pub fn volumes(points: &[DVec3], near: &Near, shape: &dyn Shape, spacing: f64, volume: f64) -> Result<Vec<f64>, String> {
    let (low, high) = shape.bounds();
    let blocks = ((high - low) / spacing).to_array().map(|n| n.ceil().max(1.0) as usize);
    let edge = (high - low) / DVec3::from_array(blocks.map(|n| n as f64));
    let half = 0.5 * edge.length();
    let slab = |k: usize| {
        let mut found = Vec::new();
        for (j, i) in (0..blocks[1]).flat_map(|j| (0..blocks[0]).map(move |i| (j, i))) {
            let corner = low + edge * DVec3::new(i as f64, j as f64, k as f64);
            let distance = shape.signed_distance(corner + 0.5 * edge);
            if distance > half {
                continue;
            }
            for s in 0..SAMPLES.pow(3) {
                let at = [s % SAMPLES, s / SAMPLES % SAMPLES, s / (SAMPLES * SAMPLES)].map(|n| (n as f64 + 0.5) / SAMPLES as f64);
                let x = corner + edge * DVec3::from_array(at);
                if distance < -half || shape.signed_distance(x) < 0.0 {
                    found.extend(near.nearest(x, 1).first().map(|n| n.1));
                }
            }
        }
        found
    };
    let slabs: Vec<Vec<u32>> = (0..blocks[2]).into_par_iter().map(slab).collect();
    let mut counts = vec![0u32; points.len()];
    slabs.iter().flatten().for_each(|p| counts[*p as usize] += 1);
    let none: Vec<usize> = (0..points.len()).filter(|i| counts[*i] == 0).collect();
    if let Some(first) = none.first() {
        return Err(format!(
            "{} of {} points have no share of the inside, point {first} at {} m first ({:.4} m from the surface); do points and surface belong together?",
            none.len(),
            points.len(),
            points[*first],
            shape.signed_distance(points[*first]).abs()
        ));
    }
    let all: u32 = counts.iter().sum();
    Ok(counts.iter().map(|n| volume * f64::from(*n) / f64::from(all)).collect())
}
