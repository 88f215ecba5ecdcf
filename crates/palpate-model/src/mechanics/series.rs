//! Vectors of many points at given times: forces that a file holds, or places that were measured.

use glam::DVec3;

/// Part of a time's size within which it is that of a sample: times are sums, and rounded.
const SAME: f64 = 1e-9;

/// Vectors of `n` points at T times, linear in time between samples and held outside them.
///
/// Linear, because a cubic through sudden changes of a load would overshoot.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Number of points n.
    pub count: usize,
    /// Sample times on the recording's clock [s], increasing `[T]`.
    pub times: Vec<f64>,
    /// Vectors `[T, n]`; NaN where a point has none.
    pub vectors: Vec<DVec3>,
}

impl Series {
    /// The same vectors at all times.
    pub fn constant(vectors: Vec<DVec3>) -> Series {
        Series { count: vectors.len(), times: vec![0.0], vectors }
    }

    /// Vector of a point at a time and its rate [1/s]; NaN where one of the samples around it has none.
    pub fn at(&self, point: usize, time: f64) -> [DVec3; 2] {
        let of = |row: usize| self.vectors[row * self.count + point];
        let next = self.times.partition_point(|t| *t <= time);
        let close = |row: &usize| (self.times[*row] - time).abs() <= SAME * (1.0 + time.abs());
        let near = [next.checked_sub(1), (next < self.times.len()).then_some(next)];
        if let Some(row) = near.into_iter().flatten().find(close) {
            // On a sample its neighbours need not be known; the rate there is that of what follows, where that is.
            let slope = (row + 1 < self.times.len()).then(|| self.slope(point, row)).filter(|s| !s.is_nan());
            return [of(row), slope.unwrap_or_default()];
        }
        match near {
            [Some(row), Some(_)] => {
                let slope = self.slope(point, row);
                [of(row) + (time - self.times[row]) * slope, slope]
            }
            [Some(row), None] | [None, Some(row)] => [of(row), DVec3::ZERO],
            [None, None] => [DVec3::NAN; 2],
        }
    }

    /// Change by time behind a sample [1/s].
    fn slope(&self, point: usize, row: usize) -> DVec3 {
        let of = |row: usize| self.vectors[row * self.count + point];
        (of(row + 1) - of(row)) / (self.times[row + 1] - self.times[row])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_linear_between_samples_and_held_outside() {
        let [a, b, c] = [DVec3::X, DVec3::new(3.0, 2.0, 0.0), DVec3::NAN];
        let s = Series { count: 2, times: vec![1.0, 2.0, 4.0], vectors: vec![a, b, b, c, c, a] };
        assert_eq!(s.at(0, 1.25), [a + 0.25 * (b - a), b - a]);
        assert_eq!(s.at(0, -3.0), [a, DVec3::ZERO]);
        assert_eq!(s.at(1, 9.0), [a, DVec3::ZERO]);
        // What was not seen has no value up to the samples on both sides, which have theirs.
        assert!(s.at(0, 3.0)[0].is_nan() && s.at(1, 1.5)[0].is_nan() && s.at(1, 2.0)[0].is_nan());
        // Rounding of a time does not reach for a neighbour.
        for t in [2.0, 2.0 + 1e-12, 2.0 - 1e-12] {
            assert_eq!(s.at(0, t)[0], b, "{t}");
        }
        assert_eq!(Series::constant(vec![a, b]).at(1, 17.0), [b, DVec3::ZERO]);
    }
}
