//! Where and when: bins of region × time, those in which something hidden moves readings, and the F1 of those that an answer claims.
//!
//! Each axis of the box around the rest shape is cut into three parts where it is longer than half of the longest, into two from a quarter on,
//! else not at all; the time of the recording into four. A bin without readings does not count.

use super::answer::Block;
use glam::DVec3;
use palpate_engine::Stream;
use std::collections::BTreeMap;

/// Stretches of time.
const WINDOWS: usize = 4;
/// Standard errors from which on the mean of a bin's readings is moved.
const MOVED: f64 = 3.0;

/// Change of one reading by what is hidden.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// What was read.
    pub stream: Stream,
    /// Place on the rest shape [m].
    pub rest: DVec3,
    /// Time [s].
    pub time: f64,
    /// Change in standard deviations.
    pub change: f64,
}

/// Root mean square change.
pub fn rms(moved: &[Moved]) -> f64 {
    (moved.iter().map(|m| m.change * m.change).sum::<f64>() / moved.len().max(1) as f64).sqrt()
}

/// The bins of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Bins {
    low: DVec3,
    size: DVec3,
    parts: [usize; 3],
    from: f64,
    to: f64,
}

impl Bins {
    /// Bins of a body with this box, watched from one time to another.
    pub fn new(bounds: (DVec3, DVec3), time: (f64, f64)) -> Bins {
        let size = bounds.1 - bounds.0;
        let parts = size.to_array().map(|s| match s / size.max_element() {
            r if r > 0.5 => 3,
            r if r > 0.25 => 2,
            _ => 1,
        });
        Bins { low: bounds.0, size, parts, from: time.0, to: time.1 }
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.parts.iter().product::<usize>() * WINDOWS
    }

    /// The region of a place.
    pub fn region(&self, p: DVec3) -> usize {
        let place = |a: usize| {
            let share = (p[a] - self.low[a]) / self.size[a].max(1e-12);
            ((share * self.parts[a] as f64).max(0.0) as usize).min(self.parts[a] - 1)
        };
        place(0) + self.parts[0] * (place(1) + self.parts[1] * place(2))
    }

    fn window(&self, t: f64) -> usize {
        let share = (t - self.from) / (self.to - self.from).max(1e-12);
        ((share * WINDOWS as f64).max(0.0) as usize).min(WINDOWS - 1)
    }

    /// One letter a bin: `1` where readings are moved, `0` where not, `.` where there are none.
    pub fn acts(&self, moved: &[Moved]) -> String {
        let mut sums: BTreeMap<(usize, Stream), (f64, f64)> = BTreeMap::new();
        for m in moved {
            let bin = self.region(m.rest) * WINDOWS + self.window(m.time);
            let sum = sums.entry((bin, m.stream)).or_default();
            sum.0 += m.change;
            sum.1 += 1.0;
        }
        let mut out = vec!['.'; self.count()];
        for ((bin, _), (sum, n)) in sums {
            let moved = sum.abs() / f64::sqrt(n) > MOVED;
            if moved || out[bin] == '.' {
                out[bin] = if moved { '1' } else { '0' };
            }
        }
        out.into_iter().collect()
    }

    /// Middle of a bin's region [m] and of its window [s].
    fn middle(&self, bin: usize) -> (DVec3, f64) {
        let (r, w) = (bin / WINDOWS, bin % WINDOWS);
        let c = [r % self.parts[0], r / self.parts[0] % self.parts[1], r / (self.parts[0] * self.parts[1])];
        let at = |a: usize| self.low[a] + self.size[a] * (c[a] as f64 + 0.5) / self.parts[a] as f64;
        (DVec3::from([0, 1, 2].map(at)), self.from + (self.to - self.from) * (w as f64 + 0.5) / WINDOWS as f64)
    }

    /// F1 of the bins that an answer claims against those that are moved; `None` where none is.
    ///
    /// A bin is claimed when a block that lies in it, or the nearest of those that cover its time, is.
    pub fn f1(&self, acts: &str, map: &[Block]) -> Option<f64> {
        let mut inside: Vec<(bool, bool)> = vec![(false, false); self.count()];
        for b in map {
            let (first, last) = (self.window(b.time[0]), self.window(b.time[1]));
            for w in first..=last {
                let at = &mut inside[self.region(DVec3::from(b.place)) * WINDOWS + w];
                *at = (true, at.1 || b.missing);
            }
        }
        let claimed = |bin: usize| {
            let (any, missing) = inside[bin];
            if any {
                return missing;
            }
            let (place, time) = self.middle(bin);
            let during = map.iter().filter(|b| (b.time[0]..=b.time[1]).contains(&time));
            let near = |b: &Block| DVec3::from(b.place).distance_squared(place);
            during.min_by(|a, b| near(a).total_cmp(&near(b))).is_some_and(|b| b.missing)
        };
        let (mut right, mut said, mut true_ones) = (0.0, 0.0, 0.0);
        for (bin, letter) in acts.chars().enumerate().filter(|(bin, letter)| *letter != '.' && *bin < self.count()) {
            let (is, says) = (letter == '1', claimed(bin));
            right += f64::from(u8::from(is && says));
            said += f64::from(u8::from(says));
            true_ones += f64::from(u8::from(is));
        }
        (true_ones > 0.0).then(|| 2.0 * right / (said + true_ones))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::observation::Sensor;

    #[test]
    fn bins_that_are_claimed_are_compared_with_those_that_are_moved() {
        let bins = Bins::new((DVec3::ZERO, DVec3::new(3.0, 1.0, 0.1)), (0.0, 4.0));
        assert_eq!(bins.count(), 3 * 2 * WINDOWS);
        let stream = Stream { sensor: Sensor::Camera(0), axis: 0 };
        // Sixteen readings that are all moved by one standard deviation move their mean by four standard errors.
        let at =
            |x: f64, time: f64, change: f64| (0..16).map(move |_| Moved { stream, rest: DVec3::new(x, 0.2, 0.0), time, change });
        let moved: Vec<Moved> = at(0.5, 0.5, 1.0).chain(at(1.5, 0.5, 0.5)).chain(at(2.5, 3.5, -1.0)).collect();
        let acts = bins.acts(&moved);
        assert_eq!((acts.matches('1').count(), acts.matches('0').count()), (2, 1));
        let block = |x: f64, t: f64, missing| Block { place: [x, 0.2, 0.0], time: [t, t], missing };
        let all = [block(0.5, 0.5, true), block(1.5, 0.5, true), block(2.5, 3.5, false)];
        // One of two found, one of two claims right.
        assert!((bins.f1(&acts, &all).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(bins.f1(&acts.replace('1', "0"), &all), None);
        // Whatever has no block of its own goes by the nearest one of its time.
        assert!((bins.f1(&acts, &[Block { time: [0.0, 4.0], ..block(0.5, 0.0, true) }]).unwrap() - 0.8).abs() < 1e-12);
    }
}
