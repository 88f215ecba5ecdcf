//! Density of residuals that a linear Gaussian model gives: of all of them, and of every block under the other folds.

use crate::cells::Cells;
use faer::linalg::solvers::Llt;
use faer::prelude::Solve;
use faer::{Mat, MatRef, Side};
use std::collections::BTreeMap;

/// Stretches of time that blocks end with, at most: short enough that every fold has some of each part of the motion.
const STRETCHES: usize = 15;
/// Ways to leave data out.
const FOLDS: usize = 5;
/// Fewest instants whose stretches make folds; with fewer, regions of the body do.
const INSTANTS: usize = 5;

/// Blocks (one sensor, one region, one stretch of time) that are left out together with others of their fold.
#[derive(Clone, Debug, Default)]
pub struct Blocks {
    /// Cells of each block.
    cells: Vec<Vec<usize>>,
    /// Fold of each.
    fold: Vec<usize>,
}

impl Blocks {
    /// Blocks of some cells: stretches of time that follow each other are of different folds, so that what acts for a while is never left out
    /// whole. Recordings of a few instants are divided by regions of the body.
    pub fn new(cells: &Cells) -> Blocks {
        let frames = cells.keys.iter().map(|k| (k.scene, k.frame)).collect::<std::collections::BTreeSet<_>>();
        let scenes = cells.keys.iter().map(|k| k.scene).collect::<std::collections::BTreeSet<_>>();
        let instants = frames.len() / scenes.len().max(1);
        let stretch = cells.time_blocks(instants.clamp(1, STRETCHES));
        let mut groups: BTreeMap<_, Vec<usize>> = BTreeMap::new();
        for (i, k) in cells.keys.iter().enumerate() {
            groups.entry((k.scene, k.stream, k.region, stretch[i])).or_default().push(i);
        }
        let fold = groups.keys().map(|k| if instants < INSTANTS { k.2 } else { k.3 } % FOLDS).collect();
        Blocks { cells: groups.into_values().collect(), fold }
    }

    /// Root mean square of a column over each cell's block.
    pub fn size(&self, column: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; column.len()];
        for cells in &self.cells {
            let square = cells.iter().map(|i| column[*i].powi(2)).sum::<f64>() / cells.len() as f64;
            cells.iter().for_each(|i| out[*i] = square.sqrt());
        }
        out
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.cells.len()
    }
}

/// ln p of something that was left out, but for the constant of a normal density.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LogDensity {
    /// At what was read.
    pub seen: f64,
    /// Its mean over what would be read, were the model the whole truth.
    pub expected: f64,
}

/// Residuals around a fit.
#[derive(Clone, Debug, Default)]
pub struct Linear {
    /// Residuals, with what moves them on average taken in `[m]`.
    pub y: Vec<f64>,
    /// What one standard deviation of everything that may move them changes `[k][m]`.
    pub moves: Vec<Vec<f64>>,
    /// Which of these are known beforehand to be about that large `[k]`.
    pub known: Vec<bool>,
    /// The same of what moves every block by itself.
    pub rough: Vec<Vec<f64>>,
    /// What moves that are not known beforehand promise to take away of `y`, and the fit has not: it stood where it is because it could not go
    /// there, so that they are not credited with it `[m]`; empty for nothing.
    pub unmet: Vec<f64>,
}

/// Residuals and moves with the covariance of their blocks taken out.
struct Whitened {
    /// Of each block: moves, residuals, and what of these is unmet, one row a cell `[n][k + 2]`.
    rows: Vec<Mat<f64>>,
    /// ½ ln det of each block's covariance.
    scale: Vec<f64>,
}

/// Cholesky factor of a matrix that is positive definite by construction.
fn factor(matrix: &Mat<f64>) -> Llt<f64> {
    match matrix.llt(Side::Lower) {
        Ok(llt) => llt,
        Err(e) => unreachable!("a covariance with 1 on its diagonal added is not positive definite: {e:?}"),
    }
}

/// ½ ln det of the matrix that a factor is of.
fn half_log_det(llt: &Llt<f64>) -> f64 {
    let l = llt.L();
    (0..l.nrows()).map(|i| l[(i, i)].ln()).sum()
}

/// Solves L x = b in place for the factor L.
fn forward(llt: &Llt<f64>, b: &mut Mat<f64>) {
    faer::linalg::triangular_solve::solve_lower_triangular_in_place(llt.L(), b.as_mut(), faer::Par::Seq);
}

/// Σ of squares of a column.
fn squares(column: MatRef<'_, f64>) -> f64 {
    (0..column.nrows()).map(|i| column[(i, 0)].powi(2)).sum()
}

impl Linear {
    fn whitened(&self, blocks: &Blocks, tau: f64) -> Whitened {
        let k = self.moves.len();
        let mut out = Whitened { rows: Vec::with_capacity(blocks.len()), scale: Vec::with_capacity(blocks.len()) };
        for cells in &blocks.cells {
            let n = cells.len();
            let covariance = Mat::from_fn(n, n, |i, j| {
                let own: f64 = self.rough.iter().map(|f| f[cells[i]] * f[cells[j]]).sum();
                tau * tau + own + if i == j { 1.0 } else { 0.0 }
            });
            let llt = factor(&covariance);
            let mut rows = Mat::from_fn(n, k + 2, |i, j| match j.checked_sub(k) {
                None => self.moves[j][cells[i]],
                Some(0) => self.y[cells[i]],
                Some(_) => self.unmet.get(cells[i]).copied().unwrap_or(0.0),
            });
            forward(&llt, &mut rows);
            out.scale.push(half_log_det(&llt));
            out.rows.push(rows);
        }
        out
    }

    /// What readings with this Gram matrix ask of every move `[k]`.
    fn asked(&self, gram: &Mat<f64>) -> Mat<f64> {
        let k = self.moves.len();
        let unmet = |i: usize| if self.known.get(i) == Some(&true) { 0.0 } else { gram[(i, k + 1)] };
        Mat::from_fn(k, 1, |i, _| gram[(i, k)] - unmet(i))
    }

    /// ln p of all residuals beside a discrepancy of size `tau`, but for the constant of a normal density.
    pub fn evidence(&self, blocks: &Blocks, tau: f64) -> f64 {
        let w = self.whitened(blocks, tau);
        let k = self.moves.len();
        let gram = w.gram(k);
        let llt = factor(&information(&gram));
        let asked = self.asked(&gram);
        let mean = llt.solve(&asked);
        // |y − Z a|² + |a|² at the mean a.
        let left: f64 = gram[(k, k)] + (0..k).map(|i| mean[(i, 0)] * (asked[(i, 0)] - 2.0 * gram[(i, k)])).sum::<f64>();
        -0.5 * left - half_log_det(&llt) - w.scale.iter().sum::<f64>()
    }

    /// ln p of every block's residuals given those of the other folds, beside a discrepancy of size `tau`, but for the constant.
    pub fn left_out(&self, blocks: &Blocks, tau: f64) -> Vec<LogDensity> {
        let w = self.whitened(blocks, tau);
        let k = self.moves.len();
        let folds = blocks.fold.iter().max().map_or(0, |f| f + 1);
        let mut grams: Vec<Mat<f64>> = vec![Mat::zeros(k + 2, k + 2); folds];
        for (r, fold) in w.rows.iter().zip(&blocks.fold) {
            grams[*fold] += r.transpose() * r;
        }
        let whole = grams.iter().fold(Mat::zeros(k + 2, k + 2), |sum: Mat<f64>, g| sum + g);
        let others: Vec<(Llt<f64>, Mat<f64>)> = grams
            .iter()
            .map(|own| {
                let rest = &whole - own;
                let llt = factor(&information(&rest));
                let mean = llt.solve(self.asked(&rest));
                (llt, mean)
            })
            .collect();
        let density = |((r, fold), scale): ((&Mat<f64>, &usize), &f64)| {
            let (llt, mean) = &others[*fold];
            let n = r.nrows();
            // The block's own covariance, given the others: 1 + Z H⁻¹ Zᵀ.
            let mut spread = Mat::from_fn(k, n, |i, j| r[(j, i)]);
            forward(llt, &mut spread);
            let mut covariance: Mat<f64> = spread.transpose() * &spread;
            (0..n).for_each(|i| covariance[(i, i)] += 1.0);
            let predicted = Mat::from_fn(n, 1, |i, _| (0..k).map(|q| r[(i, q)] * mean[(q, 0)]).sum::<f64>());
            let mut off = Mat::from_fn(n, 1, |i, _| r[(i, k)] - predicted[(i, 0)]);
            let own = factor(&covariance);
            forward(&own, &mut off);
            let volume = half_log_det(&own) + scale;
            LogDensity { seen: -0.5 * squares(off.as_ref()) - volume, expected: -0.5 * n as f64 - volume }
        };
        w.rows.iter().zip(&blocks.fold).zip(&w.scale).map(density).collect()
    }

    /// The size of a discrepancy that makes the residuals most probable; 0 where none does better.
    pub fn discrepancy(&self, blocks: &Blocks) -> f64 {
        // Half octaves from an eighth of the noise on: finer ones move a density by less than a thousandth of a block's.
        let sizes = (-6..=20).map(|half| 2f64.powf(0.5 * f64::from(half)));
        let mut best = (0.0, self.evidence(blocks, 0.0));
        for tau in sizes {
            let evidence = self.evidence(blocks, tau);
            if evidence > best.1 {
                best = (tau, evidence);
            }
        }
        best.0
    }

    /// ln p of what is known beforehand of the moves, each left out in its turn like any other reading: what all readings
    /// ask for against the prior's 0 ± 1. What nobody knows beforehand (a stiffness) is no reading.
    pub fn known_left_out(&self, blocks: &Blocks, tau: f64) -> LogDensity {
        let all = self.against_known(blocks, tau);
        let volume: f64 = all.iter().map(|(_, free)| -0.5 * free.ln()).sum();
        let squares: f64 = all.iter().map(|(z, _)| z * z).sum();
        LogDensity { seen: -0.5 * squares - volume, expected: -0.5 * all.len() as f64 - volume }
    }

    /// By how many standard deviations the readings contradict most what is known of one move.
    pub fn conflict(&self, blocks: &Blocks, tau: f64) -> f64 {
        self.against_known(blocks, tau).iter().map(|(z, _)| z.abs()).fold(0.0, f64::max)
    }

    /// Of every known move the standard deviations between what is known and what readings ask for, and the share of its variance that
    /// readings take away.
    fn against_known(&self, blocks: &Blocks, tau: f64) -> Vec<(f64, f64)> {
        let (mean, factor) = self.posterior(blocks, tau);
        let known = (0..mean.len()).filter(|k| self.known[*k]);
        known
            .map(|k| {
                // Without its own prior a number with variance v has v/(1 − v), and its mean is that much larger.
                let free = (1.0 - (0..mean.len()).map(|j| factor[(k, j)].powi(2)).sum::<f64>()).clamp(1e-12, 1.0);
                (mean[k] / free.sqrt(), free)
            })
            .collect()
    }

    /// These residuals after other data have told something about moves that both share: of each of `k` moves what it changes here `[k][m]`, and
    /// what the others know of them ([`Linear::posterior`]). Its own moves stay.
    pub fn taught(&self, shared: &[Vec<f64>], (mean, factor): &(Vec<f64>, Mat<f64>)) -> Linear {
        let mut out = self.clone();
        for (z, a) in shared.iter().zip(mean) {
            out.y.iter_mut().zip(z).for_each(|(y, z)| *y -= a * z);
        }
        for j in 0..shared.len() {
            let mut column = vec![0.0; self.y.len()];
            for (k, z) in shared.iter().enumerate() {
                column.iter_mut().zip(z).for_each(|(c, z)| *c += factor[(k, j)] * z);
            }
            out.moves.push(column);
            out.known.push(false);
        }
        out
    }

    /// Mean of what moves `[k]`, and a square root of its covariance `[k][k]`, in units of the prior.
    pub fn posterior(&self, blocks: &Blocks, tau: f64) -> (Vec<f64>, Mat<f64>) {
        let w = self.whitened(blocks, tau);
        let k = self.moves.len();
        let gram = w.gram(k);
        let llt = factor(&information(&gram));
        let mean = llt.solve(self.asked(&gram));
        // H = L Lᵀ, so that L⁻ᵀ has the covariance H⁻¹ as its square.
        let mut inverse = Mat::identity(k, k);
        forward(&llt, &mut inverse);
        ((0..k).map(|i| mean[(i, 0)]).collect(), inverse.transpose().to_owned())
    }
}

impl Whitened {
    /// Gram matrix of all blocks' columns.
    fn gram(&self, moves: usize) -> Mat<f64> {
        let none = Mat::zeros(moves + 2, moves + 2);
        self.rows.iter().fold(none, |sum: Mat<f64>, r| sum + r.transpose() * r)
    }
}

/// Information on what moves: its prior's, and that of the data, from their Gram matrix, whose last two rows and columns are no moves'.
fn information(gram: &Mat<f64>) -> Mat<f64> {
    let k = gram.nrows() - 2;
    Mat::from_fn(k, k, |i, j| gram[(i, j)] + if i == j { 1.0 } else { 0.0 })
}

#[cfg(test)]
#[path = "density_tests.rs"]
mod tests;
