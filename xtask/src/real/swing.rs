//! A damped swing: frequency, decay and centre of a series of positions.

/// y(t) = centre + e^(−decay t) (a cos ωt + b sin ωt), t counted from the first sample.
#[derive(Clone, Copy, Debug)]
pub struct Swing {
    /// Damped frequency [Hz].
    pub frequency: f64,
    /// Rate of decay [1/s].
    pub decay: f64,
    /// What the swing settles to, in the unit of the samples.
    pub centre: f64,
    /// Amplitude at the first sample, in the unit of the samples.
    pub amplitude: f64,
    /// Root mean square of what is left, in the unit of the samples.
    pub rms: f64,
}

impl Swing {
    /// Least squares over samples (t, y), from a guess of the frequency [Hz] that is right to a few tens of per cent.
    pub fn fit(samples: &[(f64, f64)], guess: f64) -> Swing {
        // Variable projection: centre, a and b are linear; frequency and decay are searched on grids that close in.
        let (mut frequency, mut decay) = (guess, 1.0);
        let (mut df, mut dd) = (0.05 * guess, 1.0);
        for _ in 0..40 {
            let candidates = (-6..=6).flat_map(|i| (-6..=6).map(move |j| (i as f64, j as f64)));
            let at = |(i, j): (f64, f64)| (frequency + i * df, decay + j * dd);
            let error = |c: (f64, f64)| linear(samples, at(c)).1;
            let best = candidates.min_by(|a, b| error(*a).total_cmp(&error(*b))).expect("the grid is not empty");
            (frequency, decay) = at(best);
            // The best point lies within one spacing of the new centre, or on the rim, when the grid moves before it shrinks.
            if best.0.abs() < 6.0 && best.1.abs() < 6.0 {
                (df, dd) = (0.4 * df, 0.4 * dd);
            }
        }
        let ([centre, a, b], squares) = linear(samples, (frequency, decay));
        Swing { frequency, decay, centre, amplitude: a.hypot(b), rms: (squares / samples.len() as f64).sqrt() }
    }

    /// Damping ratio: decay over the undamped angular frequency.
    pub fn damping_ratio(&self) -> f64 {
        self.decay / self.decay.hypot(std::f64::consts::TAU * self.frequency)
    }
}

/// Best centre, a and b for a frequency and a decay, and the sum of squares that is left.
fn linear(samples: &[(f64, f64)], (frequency, decay): (f64, f64)) -> ([f64; 3], f64) {
    let t0 = samples[0].0;
    let row = |t: f64| {
        let (sin, cos) = (std::f64::consts::TAU * frequency * (t - t0)).sin_cos();
        let envelope = (-decay * (t - t0)).exp();
        glam::DVec3::new(1.0, envelope * cos, envelope * sin)
    };
    let (mut m, mut r) = (glam::DMat3::ZERO, glam::DVec3::ZERO);
    for (t, y) in samples {
        let a = row(*t);
        m += glam::DMat3::from_cols(a * a.x, a * a.y, a * a.z);
        r += a * *y;
    }
    let x = m.inverse() * r;
    let squares = samples.iter().map(|(t, y)| (row(*t).dot(x) - y).powi(2)).sum();
    (x.to_array(), squares)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swing_is_recovered() {
        let y = |t: f64| -6.0 + 4.0 * (-2.5 * t).exp() * (std::f64::consts::TAU * 7.72 * t + 0.3).cos();
        let samples: Vec<(f64, f64)> = (0..150).map(|k| (0.07 + 0.01 * k as f64, y(0.01 * k as f64))).collect();
        let s = Swing::fit(&samples, 7.0);
        assert!((s.frequency - 7.72).abs() < 1e-6 && (s.decay - 2.5).abs() < 1e-5, "{s:?}");
        assert!((s.centre + 6.0).abs() < 1e-6 && (s.amplitude - 4.0).abs() < 1e-5 && s.rms < 1e-6, "{s:?}");
    }
}
