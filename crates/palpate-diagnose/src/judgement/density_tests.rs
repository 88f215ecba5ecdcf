//! Densities against those that a whole covariance matrix gives.

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
fn moves_are_not_credited_with_what_is_unmet_unless_they_are_known_beforehand() {
    let (b, tau) = (blocks(), 0.8);
    let mut l = sample(17, 2);
    let y: Vec<f64> = l.moves[0].iter().map(|z| 3.0 * z).collect();
    (l.y, l.known) = (y.clone(), vec![false, false]);
    let credited = l.evidence(&b, tau);
    l.unmet.clone_from(&y);
    // All of it is unmet: the moves stay where they are, and the residuals are noise beside a discrepancy.
    let still = Linear { moves: Vec::new(), known: Vec::new(), ..l.clone() };
    let volume = |l: &Linear| Linear { y: vec![0.0; CELLS], unmet: Vec::new(), ..l.clone() }.evidence(&b, tau);
    let (found, expected) = (l.evidence(&b, tau) - volume(&l), still.evidence(&b, tau) - volume(&still));
    assert!((found - expected).abs() < 1e-9 * expected.abs() && l.evidence(&b, tau) < credited - 10.0, "{found} {expected}");
    assert!(l.posterior(&b, tau).0.iter().all(|a| a.abs() < 1e-12));
    let worse = l.left_out(&b, tau).iter().map(|d| d.seen).sum::<f64>();
    l.known = vec![true, true];
    assert!((l.evidence(&b, tau) - credited).abs() < 1e-9 * credited.abs());
    assert!(l.left_out(&b, tau).iter().map(|d| d.seen).sum::<f64>() > worse + 10.0);
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
