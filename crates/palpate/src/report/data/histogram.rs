//! Residuals counted, beside what noise would leave.

use super::motion::Motion;
use crate::experiment::Experiment;
use crate::report::quantity::millimetres;
use crate::results::report::{Chart, Role, Series, Style, Topic};
use palpate_model::observation::ReadingKind;

/// Fewest and most bins of a histogram, which has one in its middle.
const BINS: (usize, usize) = (9, 61);

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
        // Some ten residuals a bin, as far as they go.
        let bins = (samples.len() / 20).clamp(BINS.0 / 2, BINS.1 / 2) * 2 + 1;
        let width = 2.0 * half / bins as f64;
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
            let (shares, beyond) = shares(of(m), half, bins);
            let points = shares.into_iter().enumerate().map(|(k, s)| (middle(k), 100.0 * s));
            // Far residuals of start values would tower at the ends over everything else.
            let label =
                if beyond > 0.005 { format!("{} ({:.0} % beyond)", names[m], 100.0 * beyond) } else { names[m].to_string() };
            series.push(Series::new(label, role, style, points));
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
            title: format!("Residuals of {what}, as shares of all"),
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

/// Shares of so many bins between ±`half`, and the share beyond.
fn shares(samples: &[f64], half: f64, bins: usize) -> (Vec<f64>, f64) {
    if samples.is_empty() {
        return (Vec::new(), 0.0);
    }
    let mut counts = vec![0usize; bins];
    let width = 2.0 * half / bins as f64;
    for x in samples.iter().filter(|x| x.abs() <= half) {
        counts[(((x + half) / width) as usize).min(bins - 1)] += 1;
    }
    let all = samples.len() as f64;
    let within = counts.iter().sum::<usize>() as f64;
    (counts.into_iter().map(|n| n as f64 / all).collect(), 1.0 - within / all)
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
    fn every_residual_is_counted_once_within_or_beyond() {
        let all = [-9.0, -0.99, -0.001, 0.0, 0.5, 0.99, 7.0, 8.0];
        let (shares, beyond) = shares(&all, 1.0, 61);
        assert!((shares.iter().sum::<f64>() + beyond - 1.0).abs() < 1e-12);
        assert_eq!((shares[0], shares[60], shares[30], beyond), (0.125, 0.125, 0.25, 0.375));
        assert_eq!((moments(&[1.0, 3.0]), moments(&[])), (Some([2.0, 1.0]), None));
    }
}
