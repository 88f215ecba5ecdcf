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
}

/// Residuals and moves with the covariance of their blocks taken out.
struct Whitened {
    /// Of each block: moves, then residuals, one row a cell `[n][k + 1]`.
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
            let mut rows = Mat::from_fn(n, k + 1, |i, j| if j < k { self.moves[j][cells[i]] } else { self.y[cells[i]] });
            forward(&llt, &mut rows);
            out.scale.push(half_log_det(&llt));
            out.rows.push(rows);
        }
        out
    }

    /// ln p of all residuals beside a discrepancy of size `tau`, but for the constant of a normal density.
    pub fn evidence(&self, blocks: &Blocks, tau: f64) -> f64 {
        let w = self.whitened(blocks, tau);
        let k = self.moves.len();
        let gram = w.rows.iter().fold(Mat::zeros(k + 1, k + 1), |sum: Mat<f64>, r| sum + r.transpose() * r);
        let llt = factor(&information(&gram));
        let mut right = Mat::from_fn(k, 1, |i, _| gram[(i, k)]);
        forward(&llt, &mut right);
        -0.5 * (gram[(k, k)] - squares(right.as_ref())) - half_log_det(&llt) - w.scale.iter().sum::<f64>()
    }

    /// ln p of every block's residuals given those of the other folds, beside a discrepancy of size `tau`, but for the constant.
    pub fn left_out(&self, blocks: &Blocks, tau: f64) -> Vec<LogDensity> {
        let w = self.whitened(blocks, tau);
        let k = self.moves.len();
        let folds = blocks.fold.iter().max().map_or(0, |f| f + 1);
        let mut grams: Vec<Mat<f64>> = vec![Mat::zeros(k + 1, k + 1); folds];
        for (r, fold) in w.rows.iter().zip(&blocks.fold) {
            grams[*fold] += r.transpose() * r;
        }
        let whole = grams.iter().fold(Mat::zeros(k + 1, k + 1), |sum: Mat<f64>, g| sum + g);
        let others: Vec<(Llt<f64>, Mat<f64>)> = grams
            .iter()
            .map(|own| {
                let rest = &whole - own;
                let llt = factor(&information(&rest));
                let mean = llt.solve(Mat::from_fn(k, 1, |i, _| rest[(i, k)]));
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
        let gram = w.rows.iter().fold(Mat::zeros(k + 1, k + 1), |sum: Mat<f64>, r| sum + r.transpose() * r);
        let llt = factor(&information(&gram));
        let mean = llt.solve(Mat::from_fn(k, 1, |i, _| gram[(i, k)]));
        // H = L Lᵀ, so that L⁻ᵀ has the covariance H⁻¹ as its square.
        let mut inverse = Mat::identity(k, k);
        forward(&llt, &mut inverse);
        ((0..k).map(|i| mean[(i, 0)]).collect(), inverse.transpose().to_owned())
    }
}

/// Information on what moves: its prior's, and that of the data, from their Gram matrix, whose last row and column are the residuals'.
fn information(gram: &Mat<f64>) -> Mat<f64> {
    let k = gram.nrows() - 1;
    Mat::from_fn(k, k, |i, j| gram[(i, j)] + if i == j { 1.0 } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    const CELLS: usize = 24;
    const SIZE: usize = 4;

    fn blocks() -> Blocks {
        let cells: Vec<Vec<usize>> = (0..CELLS / SIZE).map(|b| (b * SIZE..(b + 1) * SIZE).collect()).collect();
        Blocks { fold: (0..cells.len()).map(|b| b % 3).collect(), cells }
    }

    fn sample(seed: u64, moves: usize) -> Linear {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut column = |n: f64| -> Vec<f64> {
            (0..CELLS)
                .map(|_| {
                    let g: f64 = StandardNormal.sample(&mut rng);
                    n * g
                })
                .collect()
        };
        Linear { y: column(1.5), moves: (0..moves).map(|_| column(3.0)).collect(), rough: vec![column(0.4)], ..Linear::default() }
    }

    /// The covariance written out.
    fn covariance(l: &Linear, b: &Blocks, tau: f64) -> Mat<f64> {
        let block = |i: usize| b.cells.iter().position(|c| c.contains(&i));
        Mat::from_fn(CELLS, CELLS, |i, j| {
            let common: f64 = l.moves.iter().map(|z| z[i] * z[j]).sum();
            let own = tau * tau + l.rough.iter().map(|f| f[i] * f[j]).sum::<f64>();
            common + if block(i) == block(j) { own } else { 0.0 } + if i == j { 1.0 } else { 0.0 }
        })
    }

    fn log_density(y: &[f64], v: &Mat<f64>) -> f64 {
        let llt = v.llt(Side::Lower).unwrap();
        let mut y = Mat::from_fn(y.len(), 1, |i, _| y[i]);
        forward(&llt, &mut y);
        -0.5 * squares(y.as_ref()) - half_log_det(&llt)
    }

    #[test]
    fn evidence_is_the_density_under_the_whole_covariance() {
        let b = blocks();
        for (seed, moves, tau) in [(1, 3, 0.0), (2, 3, 1.7), (3, 0, 0.5)] {
            let l = sample(seed, moves);
            let (fast, whole) = (l.evidence(&b, tau), log_density(&l.y, &covariance(&l, &b, tau)));
            assert!((fast - whole).abs() < 1e-9 * whole.abs(), "{fast} {whole}");
        }
    }

    #[test]
    fn a_block_left_out_has_its_density_given_the_other_folds() {
        let b = blocks();
        let (l, tau) = (sample(5, 3), 0.8);
        let v = covariance(&l, &b, tau);
        let of = |cells: &[usize]| {
            let part = Mat::from_fn(cells.len(), cells.len(), |i, j| v[(cells[i], cells[j])]);
            log_density(&cells.iter().map(|i| l.y[*i]).collect::<Vec<_>>(), &part)
        };
        for (k, density) in l.left_out(&b, tau).into_iter().enumerate() {
            let rest: Vec<usize> = (0..b.len()).filter(|o| b.fold[*o] != b.fold[k]).flat_map(|o| b.cells[o].clone()).collect();
            let both: Vec<usize> = rest.iter().chain(&b.cells[k]).copied().collect();
            // p(block | rest) = p(block, rest) / p(rest).
            let conditional = of(&both) - of(&rest);
            assert!((density.seen - conditional).abs() < 1e-9, "{density:?} {conditional}");
        }
    }

    #[test]
    fn what_one_recording_taught_another_is_the_conditional_density() {
        let (b, tau) = (blocks(), 0.6);
        let (first, second) = (sample(11, 2), Linear { moves: Vec::new(), ..sample(12, 0) });
        let shared = sample(13, 2).moves;
        // Both as one sample of twice the cells.
        let join = |a: &[f64], b: &[f64]| a.iter().chain(b).copied().collect::<Vec<f64>>();
        let none = vec![0.0; CELLS];
        let both = Linear {
            y: join(&first.y, &second.y),
            moves: first.moves.iter().zip(&shared).map(|(a, b)| join(a, b)).collect(),
            rough: vec![join(&first.rough[0], &none), join(&none, &second.rough[0])],
            ..Linear::default()
        };
        let twice = |c: &Vec<usize>| c.iter().map(|i| i + CELLS).collect::<Vec<_>>();
        let all = Blocks {
            cells: b.cells.iter().cloned().chain(b.cells.iter().map(twice)).collect(),
            fold: b.fold.iter().chain(&b.fold).copied().collect(),
        };
        let expected = both.evidence(&all, tau) - first.evidence(&b, tau);
        let found = second.taught(&shared, &first.posterior(&b, tau)).evidence(&b, tau);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn what_is_expected_is_the_mean_over_recordings_of_the_model() {
        let (b, mut rng) = (blocks(), ChaCha8Rng::seed_from_u64(21));
        let l = sample(22, 3);
        let root = covariance(&l, &b, 0.0).llt(Side::Lower).unwrap();
        let draws = 4000;
        let mut sum = vec![0.0; b.len()];
        let mut squares = vec![0.0; b.len()];
        for _ in 0..draws {
            let z: Vec<f64> = (0..CELLS).map(|_| StandardNormal.sample(&mut rng)).collect();
            let y = (0..CELLS).map(|i| (0..=i).map(|j| root.L()[(i, j)] * z[j]).sum()).collect();
            let read = Linear { y, ..l.clone() }.left_out(&b, 0.0);
            read.iter().zip(sum.iter_mut().zip(&mut squares)).for_each(|(d, (s, q))| {
                *s += d.seen;
                *q += d.seen * d.seen;
            });
        }
        for ((d, s), q) in l.left_out(&b, 0.0).iter().zip(sum).zip(squares) {
            let mean = s / f64::from(draws);
            let error = ((q / f64::from(draws) - mean * mean) / f64::from(draws)).sqrt();
            // Four standard errors of the mean of so many draws.
            assert!((mean - d.expected).abs() < 4.0 * error, "{mean} ± {error}, {d:?}");
        }
    }

    #[test]
    fn what_is_known_is_left_out_like_a_reading() {
        let (b, tau) = (blocks(), 0.8);
        let mut l = sample(7, 2);
        // The joint density of the readings and of a number's prior "reading" of zero, over that of the readings where the number is free.
        let wide = 1e4;
        let mut free = l.clone();
        free.moves[1].iter_mut().for_each(|z| *z *= wide);
        let (mean, factor) = free.posterior(&b, tau);
        let variance = (0..2).map(|j| factor[(1, j)].powi(2)).sum::<f64>() * wide * wide;
        let spread = 1.0 + variance;
        let expected = -0.5 * (wide * mean[1]).powi(2) / spread - 0.5 * spread.ln();
        l.known = vec![false, true];
        let found = l.known_left_out(&b, tau).seen;
        assert!((found - expected).abs() < 1e-5 * expected.abs(), "{found} {expected}");
    }

    #[test]
    fn the_discrepancy_has_the_size_that_blocks_share() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let cells: Vec<Vec<usize>> = (0..200).map(|b| (b * SIZE..(b + 1) * SIZE).collect()).collect();
        let b = Blocks { fold: (0..200).map(|k| k % 5).collect(), cells };
        let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
        for tau in [0.0, 1.0, 4.0] {
            let y = (0..200)
                .flat_map(|_| {
                    let shared = tau * gauss();
                    (0..SIZE).map(|_| shared + gauss()).collect::<Vec<_>>()
                })
                .collect();
            let found = Linear { y, ..Linear::default() }.discrepancy(&b);
            // Two hundred blocks show a size to 5 %, the grid to 20 %; without any an eighth of the noise may pass for one.
            assert!((found - tau).abs() <= 0.25 * tau + 0.18, "{found} for {tau}");
        }
    }
}
