//! The covariance of a discrepancy over body and time.

use super::Cell;
use glam::DVec3;

/// k = size² exp(−d²/2 reach²) exp(−t²/2 memory²) between cells of one stream; distances count in the body's size, times in the recording's
/// length, sizes in the noise of one reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// Standard deviation.
    pub size: f64,
    /// Length over the body.
    pub reach: f64,
    /// Length in time.
    pub memory: f64,
}

/// What places and times are counted in.
#[derive(Clone, Copy, Debug)]
pub struct Units {
    /// Of places [m].
    pub length: f64,
    /// Of times [s].
    pub time: f64,
}

impl Units {
    /// Those of some cells.
    pub fn of(cells: &[Cell]) -> Units {
        let low = cells.iter().fold(DVec3::INFINITY, |l, c| l.min(c.place));
        let high = cells.iter().fold(DVec3::NEG_INFINITY, |h, c| h.max(c.place));
        let first = cells.iter().map(|c| c.time).fold(f64::INFINITY, f64::min);
        let last = cells.iter().map(|c| c.time).fold(f64::NEG_INFINITY, f64::max);
        Units { length: (high - low).length().max(1e-9), time: (last - first).max(1e-9) }
    }
}

impl Kernel {
    /// Covariance of two cells' discrepancies, without the size.
    pub fn correlation(&self, units: Units, a: &Cell, b: &Cell) -> f64 {
        if a.stream != b.stream {
            return 0.0;
        }
        let d = a.place.distance(b.place) / (units.length * self.reach);
        let t = (a.time - b.time) / (units.time * self.memory);
        (-0.5 * (d * d + t * t)).exp()
    }
}
