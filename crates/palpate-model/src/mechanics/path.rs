//! A smooth curve through places at given times: what a handle or a pushing ball follows.

use glam::DVec3;

/// A curve through sampled places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// Sample times on the recording's clock [s], increasing.
    pub times: Vec<f64>,
    /// Places [m], one for each.
    pub points: Vec<DVec3>,
}

/// Where a time lies among samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Between {
    /// Before the first or after the last one, which is held.
    Held(usize),
    /// Behind sample `first`, on the cubic through it and the next one.
    Cubic {
        /// Number of the sample before the time.
        first: usize,
        /// Factors of its value and slope, then of the next one's.
        value: [f64; 4],
        /// Their derivatives by time [1/s].
        rate: [f64; 4],
    },
}

impl Between {
    /// The place of time `t` among increasing `times`, of which there is one at least.
    pub(super) fn at(times: &[f64], t: f64) -> Between {
        let (n, next) = (times.len(), times.partition_point(|&s| s <= t));
        if next == 0 || next == n {
            return Between::Held(next.saturating_sub(1));
        }
        let first = next - 1;
        let span = times[next] - times[first];
        let s = (t - times[first]) / span;
        let (s2, s3) = (s * s, s * s * s);
        Between::Cubic {
            first,
            value: [2.0 * s3 - 3.0 * s2 + 1.0, (s3 - 2.0 * s2 + s) * span, -2.0 * s3 + 3.0 * s2, (s3 - s2) * span],
            rate: [(6.0 * s2 - 6.0 * s) / span, 3.0 * s2 - 4.0 * s + 1.0, (6.0 * s - 6.0 * s2) / span, 3.0 * s2 - 2.0 * s],
        }
    }
}

/// Samples on either side of sample `m` and the time between them [s]: the slope there is that of their chord (Catmull–Rom).
pub(super) fn chord(times: &[f64], m: usize) -> (usize, usize, f64) {
    let (a, b) = (m.saturating_sub(1), (m + 1).min(times.len() - 1));
    (a, b, times[b] - times[a])
}

impl Path {
    /// Place [m] and velocity [m/s] at a time: cubic (Catmull–Rom) between samples, held outside them.
    pub fn at(&self, t: f64) -> [DVec3; 2] {
        if self.times.is_empty() {
            return [DVec3::ZERO; 2];
        }
        match Between::at(&self.times, t) {
            Between::Held(m) => [self.points[m], DVec3::ZERO],
            Between::Cubic { first, value, rate } => {
                let slope = |m| {
                    let (a, b, span) = chord(&self.times, m);
                    (self.points[b] - self.points[a]) / span
                };
                let parts = [self.points[first], slope(first), self.points[first + 1], slope(first + 1)];
                [value, rate].map(|f| (0..4).map(|k| f[k] * parts[k]).sum())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_passes_through_its_samples_with_the_velocity_it_says() {
        let times = vec![0.0, 0.1, 0.25, 0.3, 0.7];
        let points = times.iter().map(|t: &f64| DVec3::new(t.sin(), t * t, 1.0 - t)).collect();
        let path = Path { times, points };
        for (t, p) in path.times.iter().zip(&path.points) {
            assert!((path.at(*t)[0] - *p).length() < 1e-15, "{t}");
        }
        // A straight line is met between samples as well.
        assert!((path.at(0.4)[0].z - 0.6).abs() < 1e-15);
        for t in [0.05, 0.2, 0.26, 0.5] {
            let d = 1e-6;
            let difference = (path.at(t + d)[0] - path.at(t - d)[0]) / (2.0 * d);
            assert!((difference - path.at(t)[1]).length() < 1e-8, "{t}");
        }
        assert_eq!(path.at(-1.0), [path.points[0], DVec3::ZERO]);
        assert_eq!(path.at(9.0), [path.points[4], DVec3::ZERO]);
    }
}
