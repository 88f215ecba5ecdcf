//! What a depth camera makes of exact depth: noise along z, missing readings, integer counts.

use crate::render::raster::DepthImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A depth sensor's imperfections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Standard deviation of one reading along camera z [m].
    pub noise: f64,
    /// Probability that a pixel gives no reading.
    pub dropout: f64,
    /// Metres per count of the 16-bit image.
    pub depth_scale: f64,
    /// Seed; the same seed gives the same readings.
    pub seed: u64,
}

/// One recorded image.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthReading {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Counts, row by row; 0 = no reading.
    pub counts: Vec<u16>,
    /// True where the object is, row by row (also where the reading dropped out).
    pub mask: Vec<bool>,
}

impl Sensor {
    /// Reads an exact image. `image_number` counts images over the whole recording: each has its own stream of random
    /// numbers, so that leaving out a camera or a frame does not change the noise of the others' pixels.
    ///
    /// A depth of more than 65535 counts or less than half a count is no reading.
    pub fn read(&self, exact: &DepthImage, image_number: u64) -> DepthReading {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(image_number);
        let mask: Vec<bool> = exact.depth.iter().map(|z| z.is_finite()).collect();
        let counts = exact
            .depth
            .iter()
            .map(|&z| {
                // Every pixel draws the same numbers, seen or not: the noise of a pixel depends on its place only.
                let gauss: f64 = StandardNormal.sample(&mut rng);
                let dropped = rng.random::<f64>() < self.dropout;
                let count = ((z + self.noise * gauss) / self.depth_scale).round();
                if dropped || !(1.0..=65535.0).contains(&count) { 0 } else { count as u16 }
            })
            .collect();
        DepthReading { width: exact.width, height: exact.height, counts, mask }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(z: f64) -> DepthImage {
        let n = 200 * 150;
        let mut depth = vec![z; n];
        depth[0] = f64::INFINITY;
        DepthImage { width: 200, height: 150, depth, triangle: vec![0; n] }
    }

    #[test]
    fn readings_have_the_noise_and_dropout_asked_for() {
        let sensor = Sensor { noise: 0.004, dropout: 0.2, depth_scale: 0.0001, seed: 7 };
        let r = sensor.read(&flat(1.25), 3);
        let z: Vec<f64> = r.counts.iter().filter(|c| **c > 0).map(|c| f64::from(*c) * 0.0001).collect();
        let n = z.len() as f64;
        let mean = z.iter().sum::<f64>() / n;
        let sd = (z.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        // Four standard errors: σ/√n of the mean, σ/√(2n) of the deviation, √(p(1−p)/N) of the share.
        assert!((mean - 1.25).abs() < 4.0 * 0.004 / n.sqrt(), "{mean}");
        assert!((sd - 0.004).abs() < 4.0 * 0.004 / (2.0 * n).sqrt(), "{sd}");
        assert!((n / 29999.0 - 0.8).abs() < 4.0 * (0.16f64 / 29999.0).sqrt(), "{n}");
        assert_eq!((r.counts[0], r.mask[0], r.mask[1]), (0, false, true));
        assert_eq!(r, sensor.read(&flat(1.25), 3), "same seed, same reading");
        assert_ne!(r, sensor.read(&flat(1.25), 4), "every image has its own noise");
    }

    #[test]
    fn readings_are_counts_and_out_of_range_is_none() {
        let sensor = Sensor { noise: 0.0, dropout: 0.0, depth_scale: 0.001, seed: 0 };
        assert_eq!(sensor.read(&flat(1.2346), 0).counts[5], 1235);
        assert_eq!(sensor.read(&flat(70.0), 0).counts[5], 0);
    }
}
