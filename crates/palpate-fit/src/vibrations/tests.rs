//! Records of known vibrations.

use super::{Vibration, vibrations};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// 90 frames at 30 Hz of four numbers that rest at 5: 2.8 Hz with ζ = 0.04 in all of them, 7.1 Hz with ζ = 0.02 in two, and noise.
fn record(noise: f64, fast: f64, seed: u64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let times: Vec<f64> = (0..90).map(|k| 0.4 + f64::from(k) / 30.0).collect();
    let wave = |t: f64, hertz: f64, damping: f64| {
        let w = TAU * hertz;
        (-damping * w * (t - 0.4)).exp() * (w * (1.0 - damping * damping).sqrt() * (t - 0.4)).cos()
    };
    let mut row = |t: f64| {
        let (slow, fast) = (wave(t, 2.8, 0.04), fast * wave(t, 7.1, 0.02));
        let mut noisy = |x: f64| {
            let draw: f64 = StandardNormal.sample(&mut random);
            5.0 + x + noise * draw
        };
        [slow, 0.5 * slow + fast, -0.2 * slow, 0.3 * slow - fast].map(&mut noisy).to_vec()
    };
    let rows = times.iter().map(|t| row(*t)).collect();
    (times, rows)
}

fn found(noise: f64, fast: f64, seed: u64) -> Vec<Vibration> {
    let (times, rows) = record(noise, fast, seed);
    vibrations(&times, &rows, 4).unwrap()
}

#[test]
fn two_vibrations_without_noise_are_exact() {
    let all = found(0.0, 0.3, 1);
    assert_eq!(all.len(), 2);
    for (v, (hertz, damping, amplitude)) in all.iter().zip([(2.8, 0.04, 0.5), (7.1, 0.02, 0.3)]) {
        assert!((v.frequency / (TAU * hertz) - 1.0).abs() < 1e-7, "{v:?}");
        assert!((v.damping / damping - 1.0).abs() < 1e-6, "{v:?}");
        assert!((v.cosine[1] - amplitude).abs() < 1e-6 && v.sine[1].abs() < 1e-6, "{v:?}");
    }
    // Both together are all there is, but for how much they overlap.
    assert!((all.iter().map(|v| v.share).sum::<f64>() - 1.0).abs() < 0.05);
}

#[test]
fn standard_errors_are_what_noise_does() {
    let all: Vec<Vibration> = (1..=40).map(|seed| found(0.05, 0.0, seed).remove(0)).collect();
    let spread = |of: fn(&Vibration) -> (f64, f64), truth: f64| {
        let squares: f64 = all.iter().map(|v| ((of(v).0 - truth) / of(v).1).powi(2)).sum();
        (squares / all.len() as f64).sqrt()
    };
    let (frequency, damping) =
        (spread(|v| (v.frequency, v.frequency_sd), TAU * 2.8), spread(|v| (v.damping, v.damping_sd), 0.04));
    // A root mean square of 40 draws is known to a ninth.
    assert!((frequency - 1.0).abs() < 0.35 && (damping - 1.0).abs() < 0.35, "{frequency} {damping}");
    // A noise of 5 % leaves a modulus, which goes with the square, within a hundredth.
    assert!(all.iter().all(|v| v.frequency_sd < 0.005 * v.frequency));
}

#[test]
fn what_is_not_there_is_not_found() {
    assert_eq!(found(0.05, 0.0, 3).len(), 1);
    let (times, mut rows) = record(0.0, 0.0, 3);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    rows.iter_mut().flatten().for_each(|x| *x = StandardNormal.sample(&mut random));
    assert_eq!(vibrations(&times, &rows, 4).unwrap().len(), 0);
    rows.iter_mut().flatten().for_each(|x| *x = 2.0);
    assert_eq!(vibrations(&times, &rows, 4), Err("nothing moves".into()));
    assert!(vibrations(&times[..5], &rows[..5], 4).unwrap_err().contains("too few"));
    // A third of a period: no vibration, or a wrong one, but for noise.
    let third: Vec<Vec<f64>> = times.iter().map(|t| vec![(TAU / 9.0 * (t - 0.4)).cos()]).collect();
    assert_eq!(vibrations(&times, &third, 1).unwrap().len(), 0);
}
