//! How large the noise really is: of one reading, from neighbouring pixels, and of a region's mean, from its course over time.
//!
//! A region's mean over correlated pixels scatters more than σ/√n. Noise is new in every frame while what a model misses changes
//! smoothly, so that second differences over time, of residuals without anything that any hypothesis could explain, show the noise alone.

use crate::cells::Cells;
use crate::laboratory::Readings;
use crate::linear::quantile;
use palpate_model::observation::Sensor;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;

/// Median of χ² with one degree of freedom.
pub const MEDIAN: f64 = 0.454_936;

/// Fewest differences of an image from which its noise is estimated.
const FEWEST: usize = 30;

/// Noise of single depth readings over the stated one; 1 where it is smaller.
///
/// From second differences of three neighbours in a row of an image, in which a misfit that changes evenly across the surface cancels. Where
/// the model is far off even that leaves something, but not in every image: the images with the least noise decide.
pub fn neighbour_ratio(readings: &Readings) -> f64 {
    let mut images: BTreeMap<(usize, usize, u32), Vec<(f64, f64)>> = BTreeMap::new();
    for w in readings.rows.windows(3) {
        let [a, b, c] = w else { continue };
        let place = |r: &crate::laboratory::Reading| match r.row.source.sensor {
            Sensor::Camera(camera) => Some((r.scene, r.row.frame, camera, r.row.source.item)),
            _ => None,
        };
        let (Some(p), Some(q), Some(r)) = (place(a), place(b), place(c)) else { continue };
        if (p.0, p.1, p.2) != (q.0, q.1, q.2) || (q.0, q.1, q.2) != (r.0, r.1, r.2) || q.3 != p.3 + 1 || r.3 != q.3 + 1 {
            continue;
        }
        if let (Some(x), Some(y), Some(z)) = (a.row.value, b.row.value, c.row.value) {
            let variance = |r: &crate::laboratory::Reading| (r.row.noise * r.row.along_sight).powi(2);
            let square = (x - 2.0 * y + z).powi(2) / (variance(a) + 4.0 * variance(b) + variance(c));
            let gap = a.row.rest.distance(b.row.rest).max(b.row.rest.distance(c.row.rest));
            images.entry((p.0, p.1, p.2)).or_default().push((square, gap));
        }
    }
    let mut gaps: Vec<f64> = images.values().flatten().map(|v| v.1).collect();
    if gaps.len() < FEWEST {
        return 1.0;
    }
    // The next pixels of the same row, not the first of the next one, and not across an edge.
    let near = 2.0 * quantile(&mut gaps, 0.5);
    let ratio = |v: &Vec<(f64, f64)>| {
        let mut close: Vec<f64> = v.iter().filter(|v| v.1 <= near).map(|v| v.0).collect();
        (close.len() >= FEWEST).then(|| quantile(&mut close, 0.5) / MEDIAN)
    };
    let mut ratios: Vec<f64> = images.values().filter_map(ratio).collect();
    if ratios.is_empty() {
        return 1.0;
    }
    quantile(&mut ratios, 0.25).sqrt().max(1.0)
}

/// What noise alone looks like on the cells of one frame, from second differences over time.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    /// Number of the sequence (sensor and region) of every cell `[m]`.
    sequence: Vec<usize>,
    /// One frame each: a value per sequence that was seen in it, of mean square one over all frames.
    frames: Vec<Vec<Option<f64>>>,
    /// Relative standard error of the variance that the factor stands for.
    uncertainty: f64,
}

/// A sequence's own variance counts as much as so many recordings of the same length count for the mean of all sequences: a few dozen
/// frames do not determine it.
const POOLED: f64 = 2.0;

/// Frames with a shape that a draw needs; with fewer, cells are drawn independently.
const ENOUGH: usize = 6;

impl Shapes {
    /// A draw of noise on all cells, of variance one: every frame gets the shape of a random one with a random sign, so that
    /// correlation between regions and cameras is kept.
    pub fn draw(&self, cells: &Cells, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut chosen: BTreeMap<(usize, usize), (usize, f64)> = BTreeMap::new();
        let mut out = Vec::with_capacity(cells.len());
        // How large the noise is, is itself known only roughly.
        let size: f64 = StandardNormal.sample(rng);
        let size = (0.5 * self.uncertainty * size).exp();
        for (i, k) in cells.keys.iter().enumerate() {
            let gauss: f64 = StandardNormal.sample(rng);
            if self.frames.len() < ENOUGH {
                out.push(size * gauss);
                continue;
            }
            let (frame, sign) = *chosen
                .entry((k.scene, k.frame))
                .or_insert_with(|| (rng.random_range(0..self.frames.len()), if rng.random::<bool>() { 1.0 } else { -1.0 }));
            out.push(size * self.frames[frame][self.sequence[i]].map_or(gauss, |v| sign * v));
        }
        out
    }
}

/// Factor on the stated variance of readings that may pass for noise: who states a noise knows it within a factor of two.
const STATED: f64 = 4.0;

/// Factor on the variance of cells' means: how many times more they scatter from frame to frame than independent readings would; and the
/// shapes that this noise takes. `y` are residuals in units of that noise with everything projected out, which has taken a share
/// `leverage` of their variance. Without three frames in a row the factor is 1 and there are no shapes. Noise that all readings of a cell share
/// makes it as large as their number; what scatters more is no noise, though it is new in every frame.
pub fn design_effect(cells: &Cells, y: &[f64], leverage: impl Fn(usize) -> f64) -> (f64, Shapes) {
    let sequences = cells.sequences();
    let mut shapes = Shapes { sequence: vec![0; cells.len()], frames: Vec::new(), uncertainty: 0.0 };
    let mut frames: BTreeMap<(usize, usize), Vec<Option<f64>>> = BTreeMap::new();
    for (s, sequence) in sequences.iter().enumerate() {
        sequence.iter().for_each(|i| shapes.sequence[*i] = s);
        for w in sequence.windows(3) {
            let [a, b, c] = w else { continue };
            let keys = [a, b, c].map(|i| cells.keys[*i]);
            if keys[1].frame != keys[0].frame + 1 || keys[2].frame != keys[1].frame + 1 {
                continue;
            }
            let left = |i: usize| (1.0 - leverage(i)).max(0.05);
            let difference = y[*b] - 0.5 * (y[*a] + y[*c]);
            let scaled = difference / (left(*b) + 0.25 * (left(*a) + left(*c))).sqrt();
            frames.entry((keys[1].scene, keys[1].frame)).or_insert_with(|| vec![None; sequences.len()])[s] = Some(scaled);
        }
    }
    let square = |f: &Vec<Option<f64>>| {
        let (sum, n) = f.iter().flatten().fold((0.0, 0), |(s, n), v| (s + v * v, n + 1));
        sum / f64::from(n.max(1))
    };
    let mut squares: Vec<f64> = frames.values().map(square).collect();
    if squares.len() < 3 {
        return (1.0, shapes);
    }
    // Regions differ in how correlated their readings are, so squares are averaged over a frame. Frames with an impact, where what the
    // model misses changes at once, are the largest: a quantile leaves them out. A little above the median, which lies below the mean.
    let factor = quantile(&mut squares.clone(), 0.6);
    let calm = quantile(&mut squares, 0.8);
    shapes.frames = frames.into_values().filter(|f| square(f) <= calm).collect();
    let n = shapes.frames.len().max(1) as f64;
    let scale = (shapes.frames.iter().map(square).sum::<f64>() / n).sqrt().max(1e-12);
    shapes.frames.iter_mut().flatten().flatten().for_each(|v| *v /= scale);
    for s in 0..sequences.len() {
        let mine = || shapes.frames.iter().filter_map(|f| f[s]);
        let (sum, n) = mine().fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
        if sum > 0.0 {
            let variance: f64 = sum / n;
            let shrunk = (variance + POOLED) / (1.0 + POOLED);
            let by = (shrunk / variance).sqrt();
            shapes.frames.iter_mut().filter_map(|f| f[s].as_mut()).for_each(|v| *v *= by);
        }
    }
    // Standard error of a median over frames, of which every three share readings.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    let spread = (squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / squares.len() as f64).sqrt();
    shapes.uncertainty = (1.25 * spread / (mean.max(1e-300) * (squares.len() as f64 / 2.0).sqrt())).min(0.7);
    (factor.clamp(1.0, cells.alike.max(STATED)), shapes)
}
