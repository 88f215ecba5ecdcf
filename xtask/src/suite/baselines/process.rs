//! A Gaussian-process discrepancy (Kennedy & O'Hagan, *J. R. Stat. Soc. B* 63, 2001): what the model leaves of the recording is a smooth random
//! function of place and time besides noise. Its size and its two lengths maximise the marginal likelihood of the linearised fit, the free
//! numbers integrated out under a flat prior (restricted likelihood; Patterson & Thompson, *Biometrika* 58, 1971). It says that something is
//! missing where that likelihood exceeds the one without a discrepancy by more than chance (χ² of three numbers, which is on the safe side), and
//! gives the free numbers under it.

use super::dense::{Factor, dot};
use super::kernel::{Kernel, Units};
use super::{Linear, linearise};
use crate::suite::answer::Answer;
use palpate::{Error, Experiment};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Standard deviations over that of single readings, and lengths, from which the search starts; it halves its steps so often.
const SIZES: [f64; 4] = [0.1, 0.4, 1.6, 6.4];
/// See [`SIZES`].
const LENGTHS: [f64; 3] = [0.15, 0.4, 1.2];
/// See [`SIZES`].
const HALVINGS: usize = 3;
/// Posterior standard deviations from which on the discrepancy of a cell is called missing.
const SEEN: f64 = 3.0;

/// What the marginal likelihood says of a kernel.
struct Fitted {
    log_likelihood: f64,
    factor: Factor,
    /// Change of the free numbers.
    change: Vec<f64>,
}

/// Log marginal likelihood with a discrepancy, or without one.
fn likelihood(l: &Linear, single: f64, units: Units, kernel: Option<Kernel>) -> Option<Fitted> {
    let n = l.cells.len();
    let variance = |i: usize, j: usize| {
        let (a, b) = (&l.cells[i], &l.cells[j]);
        let smooth = kernel.map_or(0.0, |k| (k.size * single).powi(2) * k.correlation(units, a, b));
        smooth + if i == j { a.noise * a.noise } else { 0.0 }
    };
    let factor = Factor::new(n, variance)?;
    let r: Vec<f64> = l.cells.iter().map(|c| c.residual).collect();
    let half_r = factor.halfway(&r);
    let columns: Vec<Vec<f64>> =
        (0..l.free).map(|k| factor.halfway(&l.cells.iter().map(|c| c.columns[k]).collect::<Vec<_>>())).collect();
    let normal = Factor::new(l.free, |i, j| dot(&columns[i], &columns[j]) * if i == j { 1.0 + 1e-12 } else { 1.0 })?;
    let right: Vec<f64> = columns.iter().map(|c| -dot(c, &half_r)).collect();
    let change = normal.solve(&right);
    let left = dot(&half_r, &half_r) - dot(&right, &change);
    let log_likelihood = -0.5 * (factor.log_determinant() + normal.log_determinant() + left);
    Some(Fitted { log_likelihood, factor, change })
}

/// The kernel of the largest likelihood: the best of a grid, then coordinate by coordinate with steps that halve.
fn best(l: &Linear, single: f64, units: Units) -> Option<(Kernel, Fitted)> {
    let grid = SIZES.iter().flat_map(|s| LENGTHS.iter().flat_map(move |r| LENGTHS.iter().map(move |m| (*s, *r, *m))));
    let at = |k: Kernel| likelihood(l, single, units, Some(k)).map(|f| (k, f));
    let better = |a: (Kernel, Fitted), b: (Kernel, Fitted)| if b.1.log_likelihood > a.1.log_likelihood { b } else { a };
    let mut best = grid.filter_map(|(size, reach, memory)| at(Kernel { size, reach, memory })).reduce(better)?;
    let mut step: f64 = 1.7;
    for _ in 0..HALVINGS {
        for coordinate in 0..3 {
            for factor in [step, 1.0 / step] {
                let mut k = best.0;
                *[&mut k.size, &mut k.reach, &mut k.memory][coordinate] *= factor;
                if let Some(next) = at(k) {
                    best = better(best, next);
                }
            }
        }
        step = step.sqrt();
    }
    Some(best)
}

/// Its answer.
///
/// # Errors
/// The experiment cannot be fitted.
pub fn answer(case: &str, e: &Experiment) -> Result<Answer, Error> {
    let l = linearise(e, |_| Vec::new())?;
    let units = Units::of(&l.cells);
    let single = l.distance[1];
    let none = || Error::Failed("the covariance of the readings is not positive definite".into());
    let plain = likelihood(&l, single, units, None).ok_or_else(none)?;
    let (kernel, fitted) = best(&l, single, units).ok_or_else(none)?;
    let ratio = 2.0 * (fitted.log_likelihood - plain.log_likelihood);
    let p = ChiSquared::new(3.0).map_or(1.0, |c| c.sf(ratio.max(0.0)));
    Ok(Answer {
        sentence: format!(
            "A discrepancy of {:.2} noise, over {:.2} of the body and {:.2} of the time; likelihood ratio {ratio:.1}",
            kernel.size, kernel.reach, kernel.memory
        ),
        ..l.answer(case, p, &fitted.change, &seen(&l, single, units, kernel, &fitted))
    })
}

/// Cells whose discrepancy is far from zero by its posterior, at the numbers found.
fn seen(l: &Linear, single: f64, units: Units, kernel: Kernel, f: &Fitted) -> Vec<bool> {
    let left: Vec<f64> = l.cells.iter().map(|c| c.residual + dot(&c.columns[..l.free], &f.change)).collect();
    let weights = f.factor.solve(&left);
    let variance = (kernel.size * single).powi(2);
    let one = |i: usize| {
        let row: Vec<f64> = l.cells.iter().map(|b| variance * kernel.correlation(units, &l.cells[i], b)).collect();
        let half = f.factor.halfway(&row);
        let spread = (variance - dot(&half, &half)).max(1e-18).sqrt();
        dot(&row, &weights).abs() > SEEN * spread
    };
    (0..l.cells.len()).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Cell;
    use super::*;
    use glam::DVec3;
    use palpate_engine::Stream;
    use palpate_model::observation::Sensor;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Residuals of noise 1 on 5 places × 20 times, beside what `smooth` adds, with one number that moves all of them alike.
    fn linear(seed: u64, smooth: impl Fn(f64, f64) -> f64) -> Linear {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut cell = |x: f64, time: f64| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            Cell {
                stream: Stream { sensor: Sensor::Camera(0), axis: 0 },
                place: DVec3::new(x, 0.0, 0.0),
                time,
                residual: noise + smooth(x, time),
                noise: 1.0,
                columns: vec![1.0],
            }
        };
        let cells = (0..100).map(|k| cell(f64::from(k % 5) / 4.0, f64::from(k / 5) / 19.0)).collect();
        Linear { cells, free: 1, modulus: Some(0), fitted: Some(1.0), values: Vec::new(), distance: [1.0; 2] }
    }

    fn ratio(l: &Linear) -> f64 {
        let units = Units::of(&l.cells);
        2.0 * (best(l, 1.0, units).unwrap().1.log_likelihood - likelihood(l, 1.0, units, None).unwrap().log_likelihood)
    }

    #[test]
    fn noise_is_no_discrepancy_and_a_wave_is() {
        // The 1 % point of χ² of three numbers; of twenty draws a fifth is expected above it.
        let alarms = (0..20).filter(|s| ratio(&linear(*s, |_, _| 0.0)) > 11.34).count();
        assert!(alarms <= 2, "{alarms}");
        let wave = linear(1, |x, t| 3.0 * (6.0 * t).sin() * x);
        assert!(ratio(&wave) > 50.0, "{}", ratio(&wave));
    }

    #[test]
    fn the_number_is_found_beside_the_discrepancy() {
        // A constant of 2 is taken away by the number that moves everything alike, though a wave that comes and goes is added.
        let l = linear(3, |x, t| 2.0 + 3.0 * (18.0 * t).sin() * (x - 0.5));
        let (_, f) = best(&l, 1.0, Units::of(&l.cells)).unwrap();
        // Noise alone leaves a tenth; the wave's mean is not zero.
        assert!((f.change[0] + 2.0).abs() < 0.5, "{}", f.change[0]);
    }
}
