//! Noise from frames of a body at rest: found where neighbours hide it, and not mistaken for motion.

use crate::laboratory::{Reading, Readings};
use crate::noise::neighbour_ratio;
use crate::still::still_ratio;
use glam::DVec3;
use palpate_engine::{ResidualRow, Source};
use palpate_model::observation::Sensor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::Arc;

const STATED: f64 = 1e-3;
const SIZE: [usize; 2] = [40, 30];
const FRAMES: usize = 12;

/// Images of a plate that a wrong model misses by a smooth millimetre, with noise of `sd` that runs of `run` neighbours share, and `motion`
/// of the whole plate by place and frame. One pixel in fifty is missing in every frame.
fn seen(sd: f64, run: usize, motion: impl Fn(f64, usize) -> f64) -> Readings {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut rows = Vec::new();
    for frame in 0..FRAMES {
        let (mut point, mut shared): (u32, f64) = (0, 0.0);
        for i in 0..SIZE[0] * SIZE[1] {
            let (x, y) = (2e-3 * (i % SIZE[0]) as f64, 2e-3 * (i / SIZE[0]) as f64);
            if i % run == 0 {
                shared = StandardNormal.sample(&mut rng);
            }
            if rng.random_range(0..50) == 0 {
                continue;
            }
            // Neighbours' noise is the same but for a tenth.
            let own: f64 = StandardNormal.sample(&mut rng);
            let noise = sd * if run == 1 { own } else { 0.995 * shared + 0.1 * own };
            let value = 1e-3 * (30.0 * x).sin() + noise + motion(x, frame);
            let row = ResidualRow {
                frame,
                source: Source::point(point, Sensor::Camera(0)),
                value: Some(value),
                noise: STATED,
                weight: 1.0,
                rest: DVec3::new(x, y, noise),
                along_sight: 1.0,
                by_place: DVec3::X,
            };
            rows.push(Reading { scene: 0, time: frame as f64 / 30.0, row });
            point += 1;
        }
    }
    Readings { rows: Arc::new(rows), ..Readings::default() }
}

#[test]
fn frames_at_rest_show_the_noise_that_neighbours_share() {
    let still = vec![(0..FRAMES - 1).collect::<Vec<_>>()];
    for (sd, run) in [(2.5e-3, 5), (1.6e-3, 1)] {
        let readings = seen(sd, run, |_, _| 0.0);
        let found = still_ratio(&readings, &still);
        // The calmest quarter of ten images, each of some 240 independent values: 10 %, and the quantile's 5 %.
        assert!((found / (sd / STATED) - 1.0).abs() < 0.15, "{found} of {}", sd / STATED);
        let neighbours = neighbour_ratio(&readings);
        assert!(run == 1 || neighbours < 0.6 * found, "neighbours see {neighbours}, frames {found}");
    }
    // Less than stated counts as stated; frames that the simulation moves between count nothing.
    assert_eq!(still_ratio(&seen(0.5e-3, 1, |_, _| 0.0), &still), 1.0);
    let noisy = seen(3e-3, 1, |_, _| 0.0);
    assert_eq!(still_ratio(&noisy, &[]), 1.0);
    assert_eq!(still_ratio(&noisy, &[vec![0, 2, 4, 6, 8, 10]]), 1.0);
}

#[test]
fn what_swings_unknown_to_the_model_is_no_noise() {
    let still = vec![(0..FRAMES - 1).collect::<Vec<_>>()];
    // A plate that bends with four images to a swing, by five standard deviations at its end; half of it hardly moves.
    let swings = |x: f64, frame: usize| 5.0 * STATED * (x / 0.08).powi(2) * [0.0, 1.0, 0.0, -1.0][frame % 4];
    let found = still_ratio(&seen(STATED, 1, swings), &still);
    assert!(found < 1.3, "{found}");
}
