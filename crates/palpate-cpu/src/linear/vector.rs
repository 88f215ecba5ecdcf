//! Node vectors `[N]` of 3 components and their sums, always added up in the same order.

use glam::DVec3;
use rayon::prelude::*;

/// A vector per simulation node.
pub type Nodes = Vec<DVec3>;

/// Length of the pieces that are summed or updated on their own; fixed, so that no sum depends on the number of threads.
pub const PIECE: usize = 2048;

/// Σ a·b.
pub fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    let piece = |(x, y): (&[DVec3], &[DVec3])| -> f64 { x.iter().zip(y).map(|(p, q)| p.dot(*q)).sum() };
    if a.len() <= 4 * PIECE {
        a.chunks(PIECE).zip(b.chunks(PIECE)).map(piece).sum()
    } else {
        a.par_chunks(PIECE).zip(b.par_chunks(PIECE)).map(piece).collect::<Vec<_>>().iter().sum()
    }
}

/// y += s·x.
pub fn add_scaled(y: &mut [DVec3], s: f64, x: &[DVec3]) {
    if y.len() <= 4 * PIECE {
        y.iter_mut().zip(x).for_each(|(y, x)| *y += s * *x);
    } else {
        y.par_chunks_mut(PIECE).zip(x.par_chunks(PIECE)).for_each(|(y, x)| y.iter_mut().zip(x).for_each(|(y, x)| *y += s * *x));
    }
}

/// True when every component is a finite number.
pub fn is_finite(a: &[DVec3]) -> bool {
    a.iter().all(|v| v.is_finite())
}
