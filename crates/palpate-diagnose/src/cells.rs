//! Residuals gathered into cells (body region × frame × sensor, or one marker coordinate in one frame), in units of their noise.
//!
//! Pixels of one frame are many and correlated; the mean of a region is few and Gaussian. All statistics run on these means: their
//! noise is estimated as a whole (see `noise`), so that correlation between pixels needs no model.

use crate::laboratory::Readings;
use glam::DVec3;
use palpate_engine::{Source, Stream};
use std::collections::BTreeMap;

/// Frames below which regions are made smaller.
const FEW: usize = 6;
/// Fewest matched points of a cell: fewer say nothing and come and go at silhouettes.
const FEWEST: usize = 4;
/// Points of a frame that a region should have on average.
const PER_REGION: f64 = 25.0;

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CellKey {
    /// Scene.
    pub scene: usize,
    /// What was read: a camera's distances, or a coordinate.
    pub stream: Stream,
    /// Region of the rest surface.
    pub region: usize,
    /// Frame.
    pub frame: usize,
}

/// Regions of the rest shape: leaves of a tree of median cuts across the longest side.
#[derive(Clone, Debug, Default)]
pub struct Regions {
    cuts: Vec<(usize, f64)>,
    depth: u32,
    /// Mean place of each region [m].
    pub centers: Vec<DVec3>,
}

impl Regions {
    /// 2^depth regions of about equally many of the points.
    pub fn new(points: &[DVec3], depth: u32) -> Regions {
        let leaves = 1usize << depth;
        let mut r = Regions { cuts: vec![(0, 0.0); leaves], depth, centers: vec![DVec3::ZERO; leaves] };
        r.split(1, points.to_vec());
        r
    }

    fn split(&mut self, node: usize, mut points: Vec<DVec3>) {
        let leaves = 1usize << self.depth;
        if node >= leaves {
            self.centers[node - leaves] = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
            return;
        }
        let (lo, hi) = points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        let size = hi - lo;
        let axis = (0..3).fold(0, |best, a| if size[a] > size[best] { a } else { best });
        points.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
        let right = points.split_off(points.len() / 2);
        self.cuts[node] = (axis, right.first().map_or(f64::INFINITY, |p| p[axis]));
        self.split(2 * node, points);
        self.split(2 * node + 1, right);
    }

    /// Region of a place.
    pub fn of(&self, p: DVec3) -> usize {
        let leaves = 1usize << self.depth;
        let mut node = 1;
        while node < leaves {
            let (axis, value) = self.cuts[node];
            node = 2 * node + usize::from(p[axis] >= value);
        }
        node - leaves
    }
}

/// Which cell every reading belongs to, and what its noise is. Made once, from the baseline, and kept for every model.
#[derive(Clone, Debug, Default)]
pub struct Cells {
    /// The cells, ordered `[m]`.
    pub keys: Vec<CellKey>,
    /// Times of their frames [s].
    pub times: Vec<f64>,
    /// Regions of the rest surface.
    pub regions: Regions,
    /// Standard deviation of each cell's mean, by noise alone [m].
    pub sd: Vec<f64>,
    /// Variance of a mean whose readings are all off by the same, over that of one of independent readings; of all cells in the mean.
    pub alike: f64,
    of_row: Vec<Option<u32>>,
}

/// One model's cells in units of their noise.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Residuals `[m]`.
    pub y: Vec<f64>,
    /// Derivatives `[Q][m]`.
    pub columns: Vec<Vec<f64>>,
}

impl Cells {
    /// Cells of a baseline; `sd` is that of independent readings with the stated noise.
    pub fn new(readings: &Readings) -> Cells {
        let rows = &readings.rows;
        let is_point = |s: Source| s.sensor.is_spread();
        let is_first = |s: Source| is_point(s) && s.axis == 0;
        let points: Vec<DVec3> =
            rows.iter().filter(|r| r.row.value.is_some() && is_first(r.row.source)).map(|r| r.row.rest).collect();
        let others: Vec<DVec3> = rows.iter().filter(|r| !is_point(r.row.source)).map(|r| r.row.rest).collect();
        let frames = rows.iter().map(|r| (r.scene, r.row.frame)).collect::<std::collections::BTreeSet<_>>().len().max(1);
        let (sample, depth) = if points.is_empty() {
            (&others, 3)
        } else {
            // Few instants leave only the body to be divided.
            let finest = if frames < FEW { 8.0 } else { 5.0 };
            (&points, (points.len() as f64 / frames as f64 / PER_REGION).log2().floor().clamp(2.0, finest) as u32)
        };
        let regions = Regions::new(sample, depth);
        let key = |r: &crate::laboratory::Reading| CellKey {
            scene: r.scene,
            stream: r.row.source.stream(),
            region: regions.of(r.row.rest),
            frame: r.row.frame,
        };
        let mut count: BTreeMap<CellKey, (usize, f64)> = BTreeMap::new();
        for r in rows.iter().filter(|r| r.row.value.is_some() && r.row.weight > 0.0) {
            let c = count.entry(key(r)).or_insert((0, r.time));
            c.0 += if is_point(r.row.source) { 1 } else { FEWEST };
        }
        count.retain(|_, c| c.0 >= FEWEST);
        let numbers: BTreeMap<CellKey, u32> = count.keys().enumerate().map(|(i, k)| (*k, i as u32)).collect();
        let of_row = rows.iter().map(|r| r.row.value.and_then(|_| numbers.get(&key(r)).copied())).collect();
        let mut cells = Cells {
            keys: count.keys().copied().collect(),
            times: count.values().map(|c| c.1).collect(),
            regions,
            sd: Vec::new(),
            alike: 1.0,
            of_row,
        };
        let mut sums = vec![(0.0, 0.0, 0.0); cells.keys.len()];
        for (r, c) in rows.iter().zip(&cells.of_row) {
            if let Some(c) = c {
                let s = &mut sums[*c as usize];
                let noise = r.row.weight * r.row.noise * r.row.along_sight;
                s.0 += noise.powi(2);
                s.1 += r.row.weight;
                s.2 += noise.abs();
            }
        }
        let alike = sums.iter().map(|s| if s.0 > 0.0 { s.2 * s.2 / s.0 } else { 1.0 }).sum::<f64>();
        cells.alike = alike / sums.len().max(1) as f64;
        // A cell seen edge-on has almost no noise of its own; a tenth of the reading's keeps it from ruling all others.
        cells.sd = sums.iter().map(|s| s.0.sqrt() / s.1).collect();
        let floor = 0.1 * crate::linear::quantile(&mut cells.sd.clone(), 0.5);
        cells.sd.iter_mut().for_each(|s| *s = s.max(floor));
        cells
    }

    /// True when there are so few instants that candidates can hardly be told apart by linear estimates, and fits are cheap.
    pub fn few_instants(&self) -> bool {
        self.keys.iter().map(|k| (k.scene, k.frame)).collect::<std::collections::BTreeSet<_>>().len() < FEW
    }

    /// Number of cells m.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// True without cells.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Cell of a reading.
    pub fn of(&self, row: usize) -> Option<usize> {
        self.of_row[row].map(|c| c as usize)
    }

    /// Robust means of a model's readings by cell, in units of the noise. A cell that this model lost (most of its points met nothing)
    /// takes the value of `fallback`.
    pub fn table(&self, readings: &Readings, fallback: Option<&Table>) -> Table {
        let (m, q) = (self.len(), readings.columns);
        let mut t = Table { y: vec![0.0; m], columns: vec![vec![0.0; m]; q] };
        let (mut weight, mut seen) = (vec![0.0; m], vec![0.0; m]);
        for (i, r) in readings.rows.iter().enumerate() {
            let Some(c) = self.of(i) else { continue };
            seen[c] += 1.0;
            let Some(value) = r.row.value else { continue };
            let w = r.row.weight;
            weight[c] += w;
            t.y[c] += w * value;
            for (column, d) in t.columns.iter_mut().zip(&readings.sensitivity[i * q..(i + 1) * q]) {
                column[c] += w * d;
            }
        }
        for c in 0..m {
            if weight[c] < 0.2 * seen[c] {
                t.columns.iter_mut().for_each(|column| column[c] = 0.0);
                t.y[c] = fallback.map_or(0.0, |f| f.y[c]);
                continue;
            }
            let scale = 1.0 / (weight[c] * self.sd[c]);
            t.y[c] *= scale;
            t.columns.iter_mut().for_each(|column| column[c] *= scale);
        }
        t
    }

    /// Plain means by cell of numbers that readings have or have not, in units of the noise.
    pub fn means(&self, values: &[Option<f64>]) -> Vec<f64> {
        let mut out = vec![(0.0, 0.0); self.len()];
        for (i, v) in values.iter().enumerate() {
            if let (Some(c), Some(v)) = (self.of(i), v) {
                out[c].0 += v;
                out[c].1 += 1.0;
            }
        }
        out.iter().zip(&self.sd).map(|((s, n), sd)| if *n > 0.0 { s / n / sd } else { 0.0 }).collect()
    }

    /// Cells of the same sensor and region in the order of their frames.
    pub fn sequences(&self) -> Vec<Vec<usize>> {
        let mut groups: BTreeMap<(usize, Stream, usize), Vec<usize>> = BTreeMap::new();
        for (i, k) in self.keys.iter().enumerate() {
            groups.entry((k.scene, k.stream, k.region)).or_default().push(i);
        }
        groups.into_values().collect()
    }

    /// Number of a block of time of each cell, of `count` blocks of equally many frames; scenes share the numbers.
    pub fn time_blocks(&self, count: usize) -> Vec<usize> {
        let mut frames: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for k in &self.keys {
            frames.entry(k.scene).or_default().push(k.frame);
        }
        for f in frames.values_mut() {
            f.sort_unstable();
            f.dedup();
        }
        let block = |k: &CellKey| {
            let f = &frames[&k.scene];
            let place = f.partition_point(|x| *x < k.frame);
            (place * count / f.len()).min(count - 1)
        };
        self.keys.iter().map(block).collect()
    }
}
