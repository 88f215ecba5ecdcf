//! Residuals counted, beside what noise would leave.

use super::motion::Motion;
use crate::experiment::Experiment;
use crate::report::quantity::millimetres;
use crate::results::report::{Chart, Role, Series, Style, Topic};
use palpate_model::observation::ReadingKind;

/// Bins of a histogram.
const BINS: usize = 61;

/// Histograms of the kinds that were read; `noise` is the distance that is expected of all readings [m].
pub fn histograms(e: &Experiment, motions: [Option<&Motion>; 2], names: [&str; 2], noise: f64) -> Vec<Chart> {
    let observation = &e.plan().observation;
    let only_depth = ReadingKind::ALL.iter().all(|k| *k == ReadingKind::Depth || observation.readings(*k) == 0);
    let Some(found) = motions[1] else { return Vec::new() };
    let one = |(kind, samples): (&ReadingKind, &Vec<f64>)| {
        let (stated, systematic) = (observation.noise(*kind), observation.systematic(*kind));
        let sigma = match kind {
            // The noise along the camera's axis is shortened on slanted surfaces, which the expected distance knows.
            ReadingKind::Depth if only_depth && noise.is_finite() => noise,
            ReadingKind::Depth => stated.hypot(systematic),
            _ => stated.hypot(systematic / 3f64.sqrt()),
        };
        let mut sizes: Vec<f64> = samples.iter().map(|x| x.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let high = sizes.get((sizes.len() as f64 * 0.99) as usize).or(sizes.last()).copied().unwrap_or(0.0);
        let half = (if sigma.is_finite() { 4.0 * sigma } else { 0.0 }).max(1.1 * high).max(1e-12);
        let width = 2.0 * half / BINS as f64;
        let of = |m: usize| motions[m].and_then(|m| m.samples.get(kind)).map_or(&[][..], |s| &s[..]);
        let what = match kind {
            ReadingKind::Depth => "distances of depth points",
            ReadingKind::Marker => "coordinates of markers",
            ReadingKind::Track => "coordinates of tracked points",
            ReadingKind::Displacement => "coordinates of nodes",
        };
        let middle = |k: usize| ((k as f64 + 0.5) * width - half) * 1e3;
        let mut series = Vec::new();
        for (m, (role, style)) in [(Role::Before, Style::Line), (Role::After, Style::Columns)].into_iter().enumerate().rev() {
            let shares = shares(of(m), half, width);
            let points = shares.into_iter().enumerate().map(|(k, s)| (middle(k), 100.0 * s));
            series.push(Series::new(names[m], role, style, points));
        }
        series.retain(|s| !s.x.0.is_empty());
        if sigma.is_finite() && sigma > 0.0 {
            // The normal density of the stated noise, in the same shares of a bin.
            let density = |x: f64| 100.0 * width / (sigma * (std::f64::consts::TAU).sqrt()) * (-0.5 * (x / sigma).powi(2)).exp();
            let curve = (0..=200).map(|k| (f64::from(k) / 100.0 - 1.0) * half).map(|x| (x * 1e3, density(x)));
            series.push(Series::new("noise alone", Role::Noise, Style::Dashed, curve));
        }
        let tell = |m: usize| {
            let said = |[mean, sd]: [f64; 2]| format!("{}: mean {}, deviation {}", names[m], millimetres(mean), millimetres(sd));
            moments(of(m)).map(said)
        };
        let told: Vec<String> = (0..2).filter_map(tell).collect();
        let noise = if sigma.is_finite() { format!("; noise alone would leave {}", millimetres(sigma)) } else { String::new() };
        Chart {
            key: format!("histogram-{}", kind.name()),
            topic: Topic::Histogram,
            subject: what.into(),
            title: format!("Residuals of {what}; those beyond the ends are counted in the first and last bin"),
            words: format!("Histogram of residuals of {what}. {}{noise}.", told.join("; ")),
            x: "residual [mm]".into(),
            y: "share [%]".into(),
            main: true,
            series,
            ..Chart::default()
        }
    };
    found.samples.iter().map(one).collect()
}

fn shares(samples: &[f64], half: f64, width: f64) -> Vec<f64> {
    if samples.is_empty() {
        return Vec::new();
    }
    let mut counts = vec![0usize; BINS];
    for x in samples {
        counts[(((x + half) / width).floor().max(0.0) as usize).min(BINS - 1)] += 1;
    }
    counts.into_iter().map(|n| n as f64 / samples.len() as f64).collect()
}

fn moments(samples: &[f64]) -> Option<[f64; 2]> {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    (!samples.is_empty()).then_some([mean, variance.sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_residual_is_counted_once_and_far_ones_at_the_ends() {
        let all = [-9.0, -0.99, -0.001, 0.0, 0.5, 0.99, 7.0, 8.0];
        let shares = shares(&all, 1.0, 2.0 / BINS as f64);
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!((shares[0], shares[BINS - 1], shares[BINS / 2]), (0.25, 0.375, 0.25));
        assert_eq!((moments(&[1.0, 3.0]), moments(&[])), (Some([2.0, 1.0]), None));
    }
}
