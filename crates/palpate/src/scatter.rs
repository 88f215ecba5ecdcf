//! How many independent readings a measurement is worth.
//!
//! Errors of neighbouring pixels and of consecutive frames go together, and so does what a model lacks. Means over groups of such
//! residuals then scatter more than those of independent ones: with residuals r (what pulls at the fit, in units of their noise)
//!
//! `D = Σ_groups (Σ r)² / Σ r²`
//!
//! is 1 on average for independent residuals, whatever the groups, and grows with the groups up to the sum of all correlations. n
//! residuals say as much of a smooth change as n/D independent ones. Groups grow in space first (cubes), then in time (consecutive
//! frames), as long as enough of them are left and D rises by more than chance.

use glam::DVec3;
use palpate_engine::{FrameResiduals, Misfit, Stream};
use palpate_model::observation::{ReadingKind, kernel};
use palpate_model::plan::Plan;
use std::collections::BTreeMap;

/// Fewer groups say nothing of their scatter.
const GROUPS: f64 = 16.0;
/// The finest cubes are this many halvings of the readings' extent.
const HALVINGS: i32 = 10;

/// One scalar residual.
#[derive(Clone, Copy, Debug)]
struct Reading {
    /// Readings of different streams (cameras, axes of markers) are taken as independent.
    stream: Stream,
    /// Number of the frame among those of the observation.
    frame: usize,
    place: DVec3,
    value: f64,
}

/// Residuals of one recording, collected frame by frame, each kind of readings apart.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scatter {
    kinds: BTreeMap<ReadingKind, Vec<Reading>>,
}

/// Sum of squares of residuals, and that times the factor by which means of groups scatter more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Excess {
    squares: f64,
    scattered: f64,
}

impl Excess {
    /// Residuals of several recordings together.
    pub fn add(&mut self, other: Excess) {
        self.squares += other.squares;
        self.scattered += other.scattered;
    }

    /// How many readings count as one; 1 for independent ones and where there is nothing to tell.
    pub fn design_effect(&self) -> f64 {
        if self.squares > 0.0 { (self.scattered / self.squares).max(1.0) } else { 1.0 }
    }
}

impl Scatter {
    /// Adds a frame's residuals.
    pub fn add(&mut self, plan: &Plan, r: &FrameResiduals) {
        for reading in &r.readings {
            let kind = reading.sensor.kind();
            let noise = plan.observation.noise(kind);
            // What only one thing gives has no neighbours in space.
            let place = if reading.sensor.is_spread() { reading.place } else { DVec3::ZERO };
            for (axis, value) in reading.misfit.into_iter().flat_map(Misfit::components) {
                let value = if kind == ReadingKind::Depth { kernel::influence(value, plan.band) } else { value } / noise;
                let stream = Stream { sensor: reading.sensor, axis };
                self.kinds.entry(kind).or_default().push(Reading { stream, frame: r.frame, place, value });
            }
        }
    }

    /// What all of them say.
    pub fn excess(&self) -> Excess {
        let mut all = Excess::default();
        for readings in self.kinds.values() {
            let squares: f64 = readings.iter().map(|r| r.value * r.value).sum();
            all.add(Excess { squares, scattered: squares * design_effect(readings) });
        }
        all
    }
}

/// A stream, a stretch of frames, and a cube.
type Group = (Stream, [i64; 4]);

/// Scatter of sums over groups, and how many groups of equal size would tell as much.
fn grouped(readings: &[Reading], key: impl Fn(&Reading) -> Group) -> (f64, f64) {
    // Ordered, so that sums are taken in the same order in every run.
    let mut groups: BTreeMap<Group, (f64, f64)> = BTreeMap::new();
    for r in readings {
        let (sum, n) = groups.entry(key(r)).or_default();
        *sum += r.value;
        *n += 1.0;
    }
    let sums: f64 = groups.values().map(|(sum, _)| sum * sum).sum();
    let squares: f64 = readings.iter().map(|r| r.value * r.value).sum();
    let (n, n2) = groups.values().fold((0.0, 0.0), |(n, n2), (_, m)| (n + m, n2 + m * m));
    (sums / squares, n * n / n2)
}

/// D of the module's text for readings of one kind.
fn design_effect(readings: &[Reading]) -> f64 {
    let far = |f: fn(DVec3, DVec3) -> DVec3| readings.iter().map(|r| r.place).reduce(f).unwrap_or_default();
    let (low, high) = (far(DVec3::min), far(DVec3::max));
    let extent = (high - low).max_element().max(f64::MIN_POSITIVE);
    // Frames that a stream lacks do not part its neighbours: what counts is their order.
    let mut order: BTreeMap<usize, i64> = readings.iter().map(|r| (r.frame, 0)).collect();
    order.values_mut().zip(0..).for_each(|(o, k)| *o = k);
    let key = |halvings: i32, frames: i64| {
        let edge = 1.001 * extent / 2f64.powi(halvings);
        let order = &order;
        move |r: &Reading| {
            let [x, y, z] = ((r.place - low) / edge).floor().to_array().map(|c| c as i64);
            (r.stream, [order[&r.frame] / frames, x, y, z])
        }
    };
    let (mut best, mut cubes) = (1.0, HALVINGS);
    // True while groups may still grow.
    let judge = |d: f64, groups: f64, best: &mut f64| {
        let chance = (2.0 / groups).sqrt();
        let risen = groups >= GROUPS && d > 1.0 + 3.0 * chance && d > *best * (1.0 + chance);
        if risen {
            *best = d;
        }
        risen
    };
    for halvings in (0..=HALVINGS).rev() {
        let (d, groups) = grouped(readings, key(halvings, 1));
        if judge(d, groups, &mut best) {
            cubes = halvings;
        }
    }
    let mut frames = 2;
    while frames <= order.len() as i64 {
        let (d, groups) = grouped(readings, key(cubes, frames));
        judge(d, groups, &mut best);
        frames *= 2;
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::observation::Sensor;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn stream(number: usize) -> Stream {
        Stream { sensor: Sensor::Marker(number as u32), axis: 0 }
    }

    fn normal(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
    }

    /// An image of side × side pixels a millimetre apart; errors are means over (2 w + 1)² pixels of white noise.
    fn image(side: usize, w: usize, seed: u64) -> Vec<Reading> {
        let wide = side + 2 * w;
        let white = normal(wide * wide, seed);
        let mean = |x: usize, y: usize| {
            (0..=2 * w).flat_map(|j| (0..=2 * w).map(move |i| (x + i, y + j))).map(|(x, y)| white[y * wide + x]).sum()
        };
        let place = |x, y| DVec3::new(x as f64, y as f64, 0.0) * 1e-3;
        let pixels = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
        pixels.map(|(x, y)| Reading { stream: stream(0), frame: 0, place: place(x, y), value: mean(x, y) }).collect()
    }

    /// Series of `length` frames for every stream: each error is `share` of the one before and fresh noise.
    fn series(streams: usize, length: usize, share: f64, seed: u64) -> Vec<Reading> {
        let white = normal(streams * length, seed);
        let mut readings = Vec::new();
        for number in 0..streams {
            let mut value = 0.0;
            for frame in 0..length {
                value = share * value + (1.0 - share * share).sqrt() * white[number * length + frame];
                readings.push(Reading { stream: self::stream(number), frame, place: DVec3::ZERO, value });
            }
        }
        readings
    }

    #[test]
    fn independent_readings_count_in_full() {
        for seed in 0..20 {
            let (a, b) = (design_effect(&image(60, 0, seed)), design_effect(&series(24, 200, 0.0, seed)));
            assert!((1.0..1.3).contains(&a) && (1.0..1.3).contains(&b), "{a} {b}");
        }
        let mean = (0..20).map(|seed| design_effect(&image(60, 0, seed))).sum::<f64>() / 20.0;
        assert!(mean < 1.1, "{mean}");
        assert_eq!(design_effect(&[]), 1.0);
        assert_eq!(design_effect(&series(1, 3, 0.9, 1)), 1.0, "three readings tell nothing");
    }

    #[test]
    fn correlated_pixels_count_as_few() {
        // All correlations of such an error add up to its (2 w + 1)² pixels; groups are only a few times as wide, so less is seen.
        for (w, all) in [(1usize, 9.0), (2, 25.0), (4, 81.0)] {
            let mean = (0..8).map(|seed| design_effect(&image(100, w, seed))).sum::<f64>() / 8.0;
            assert!((0.6..1.25).contains(&(mean / all)), "{mean} of {all}");
        }
    }

    #[test]
    fn correlated_frames_count_as_few() {
        for share in [0.5f64, 0.8, 0.9] {
            let all = (1.0 + share) / (1.0 - share);
            let mean = (0..8).map(|seed| design_effect(&series(24, 400, share, seed))).sum::<f64>() / 8.0;
            assert!((0.75..1.2).contains(&(mean / all)), "{mean} of {all}");
        }
    }

    #[test]
    fn recordings_weigh_by_their_squares() {
        let mut all = Excess { squares: 1.0, scattered: 1.0 };
        all.add(Excess { squares: 3.0, scattered: 27.0 });
        assert_eq!(all.design_effect(), 7.0);
        assert_eq!(Excess::default().design_effect(), 1.0);
    }
}
