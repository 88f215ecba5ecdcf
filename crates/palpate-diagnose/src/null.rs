//! The map of residuals over body and time, in standard deviations of what noise and discretisation leave after a refit.
//!
//! In units of the noise a right model leaves r = Π (ε + Σ s_k d_k), ε noise, d_k the fields by which finer computations differ and the
//! recording's systematic errors, Π what refitting leaves, drawn with the shapes that noise was seen to have. s_k is one number per field
//! with prior N(0, 1), fitted along. The statistics are calibrated by drawing such residuals. That a refinement is known only roughly in every block
//! is left to the judgement: a map that took it for noise would be blank where grids are coarse, and is only read once something is known to be missing.
//!
//! What is missing must not hide behind the errors that every model has: a field counts up to a few times its size and no further.

use crate::cells::{Cells, Table};
use crate::linear::{Basis, dot};
use crate::noise::Shapes;
use palpate_engine::Stream;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::collections::BTreeMap;

/// Recordings drawn from the null.
pub const DRAWS: usize = 499;

/// Largest number of times that a field of errors, which is carried on to the limit, explains residuals; what remains beyond twice is
/// something else that looks alike. Right models of bodies simulated by another method (quadratic tetrahedra, second order in time) need up to 1.6.
pub const LARGEST: f64 = 2.0;
/// Rounds over the fields that bring them within it; they are few and nearly independent.
const ROUNDS: usize = 50;

/// A linearised model in its cells, extended by one pseudo-reading per field of discretisation.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Residuals `[m + fields]`.
    pub y: Vec<f64>,
    /// What a refit absorbs: free numbers and fields.
    pub absorbed: Basis,
    /// What it absorbs of the free numbers alone.
    free: Basis,
    /// Errors that every model has, in units of the noise `[fields][m]`.
    pub fields: Vec<Vec<f64>>,
    /// Root mean square times that each is there, over its standard deviation.
    whole: Vec<f64>,
}

/// A vector over cells with zeros for the pseudo-readings.
pub fn extended(v: &[f64], fields: usize) -> Vec<f64> {
    v.iter().copied().chain(std::iter::repeat_n(0.0, fields)).collect()
}

/// What a refit of these columns `[m]` and of the fields `[fields][m]` absorbs `[m + fields]`.
pub fn absorbed_by<'a>(columns: impl Iterator<Item = &'a Vec<f64>>, fields: &[Vec<f64>]) -> Basis {
    let mut basis = Basis::default();
    columns.for_each(|c| basis.add(&extended(c, fields.len())));
    for (k, f) in fields.iter().enumerate() {
        let mut column = extended(f, fields.len());
        column[f.len() + k] = 1.0;
        basis.add(&column);
    }
    basis
}

impl Frame {
    /// A model's table with fields of errors, how many times they are expected (mean and standard deviation).
    pub fn new(table: &Table, fields: &[Vec<f64>], times: &[(f64, f64)]) -> Frame {
        let n = fields.len();
        let free = Basis::new(table.columns.iter());
        let mut y = extended(&table.y, n);
        for (f, (mean, _)) in fields.iter().zip(times) {
            y.iter_mut().zip(f).for_each(|(y, f)| *y += mean * f);
        }
        let scaled = |(f, (_, sd)): (&Vec<f64>, &(f64, f64))| f.iter().map(|f| sd * f).collect();
        let fields: Vec<Vec<f64>> = fields.iter().zip(times).map(scaled).collect();
        let absorbed = absorbed_by(table.columns.iter(), &fields);
        let whole = times.iter().map(|(mean, sd)| mean.hypot(*sd) / sd).collect();
        Frame { y, absorbed, free, fields, whole }
    }

    /// Residuals after the refit `[m + fields]`.
    pub fn left(&self) -> Vec<f64> {
        self.absorbed.without(&self.y)
    }

    /// Sum of squares of that.
    pub fn squares(&self) -> f64 {
        let left = self.left();
        dot(&left, &left)
    }

    /// What of the fields free numbers do not absorb `[fields][m]`: only that shows in residuals.
    pub fn visible(&self) -> Vec<Vec<f64>> {
        let whole = |(f, w): (Vec<f64>, &f64)| f.iter().map(|f| w * f).collect();
        self.bent().into_iter().zip(&self.whole).map(whole).collect()
    }

    /// The same for one standard deviation of each.
    fn bent(&self) -> Vec<Vec<f64>> {
        self.fields.iter().map(|f| self.free.without(f)).collect()
    }

    /// Residuals after the refit in cells `[m]`, with no field taken more than a few times.
    pub fn left_within_reason(&self) -> Vec<f64> {
        let bent = self.bent();
        let mut left = self.free.without(&self.y[..self.y.len() - self.fields.len()]);
        let mut times = vec![0.0; bent.len()];
        for _ in 0..ROUNDS {
            for (s, f) in times.iter_mut().zip(&bent) {
                // Smallest |left − (new − s) f|² + new², the second by its prior.
                let new = ((dot(f, &left) + *s * dot(f, f)) / (dot(f, f) + 1.0)).clamp(-LARGEST, LARGEST);
                left.iter_mut().zip(f).for_each(|(l, f)| *l -= (new - *s) * f);
                *s = new;
            }
        }
        left
    }
}

/// A block: one sensor, one region, some neighbouring frames.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Scene.
    pub scene: usize,
    /// Sensor as in the cells' keys.
    pub stream: Stream,
    /// Region.
    pub region: usize,
    /// Number of its stretch of time.
    pub time: usize,
    /// Its cells.
    pub cells: Vec<usize>,
    /// Sum of its residuals in units of its standard deviation under the null.
    pub z: f64,
}

/// Blocks of cells: `bins` stretches of time.
pub fn blocks(cells: &Cells, bins: usize) -> Vec<Block> {
    let bin = cells.time_blocks(bins);
    let mut groups: BTreeMap<(usize, Stream, usize, usize), Vec<usize>> = BTreeMap::new();
    for (i, k) in cells.keys.iter().enumerate() {
        groups.entry((k.scene, k.stream, k.region, bin[i])).or_default().push(i);
    }
    let block = |((scene, stream, region, time), cells)| Block { scene, stream, region, time, cells, z: 0.0 };
    groups.into_iter().map(block).collect()
}

/// Mean over a block of its residuals in units of their noise, times √n.
fn sum(block: &Block, y: &[f64]) -> f64 {
    block.cells.iter().map(|i| y[*i]).sum::<f64>() / (block.cells.len() as f64).sqrt()
}

/// One draw of residuals that a right model would leave.
fn draw(cells: &Cells, frame: &Frame, noise: &Shapes, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut y = noise.draw(cells, rng);
    let mut gauss = || -> f64 { StandardNormal.sample(rng) };
    for f in &frame.fields {
        let times = gauss();
        y.iter_mut().zip(f).for_each(|(y, f)| *y += times * f);
    }
    let mut left = frame.absorbed.without(&extended(&y, frame.fields.len()));
    left.truncate(cells.len());
    left
}

/// The map of a model's residuals: blocks of region and time in standard deviations of what a right model leaves; the same seed gives the same.
pub fn map(cells: &Cells, frame: &Frame, noise: &Shapes, bins: usize, seed: u64) -> Vec<Block> {
    let mut blocks = blocks(cells, bins);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let draws: Vec<Vec<f64>> = (0..DRAWS)
        .map(|_| {
            let y = draw(cells, frame, noise, &mut rng);
            blocks.iter().map(|b| sum(b, &y)).collect()
        })
        .collect();
    let left = frame.left_within_reason();
    for k in 0..blocks.len() {
        let sd = (draws.iter().map(|d| d[k] * d[k]).sum::<f64>() / DRAWS as f64).sqrt().max(1e-6);
        blocks[k].z = sum(&blocks[k], &left) / sd;
    }
    blocks
}
