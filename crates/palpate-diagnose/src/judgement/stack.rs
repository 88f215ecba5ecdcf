//! A discrepancy whose size differs from block to block: most are met, some are not, and a wall that is touched at the end spoils a few by a
//! hundred deviations. One size for all would let these few decide everything. So the predictions beside every size of a
//! table are mixed, with the weights that predict best what was left out: stacking (Yao, Vehtari, Simpson & Gelman, *Bayesian Anal.* 13, 2018, eq. 5).
//!
//! ```text
//! ln p(y_b) = ln Σ_k w_k p(y_b | y of the other folds, τ_k),   w = argmax Σ_b ln Σ_k w_k p_bk,   Σ w_k = 1
//! ```

/// Sizes τ, in standard deviations of a cell's noise: none, and octaves from an eighth of the noise on to a thousand times it, where readings
/// have lost all that they say of a body.
pub const SIZES: [f64; 15] = [0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0];

/// Rounds of expectation and maximisation: more change the sum by less than a thousandth of a nat for a thousand blocks.
const ROUNDS: usize = 200;

/// ln p of every block in the mixture, and its weights, from ln p beside each size `[size][block]`.
pub fn stacked(each: &[Vec<f64>]) -> (Vec<f64>, Vec<f64>) {
    let blocks = each.first().map_or(0, Vec::len);
    let most: Vec<f64> = (0..blocks).map(|b| each.iter().map(|d| d[b]).fold(f64::NEG_INFINITY, f64::max)).collect();
    // Of each block relative to its largest, so that nothing vanishes.
    let p: Vec<Vec<f64>> = each.iter().map(|d| d.iter().zip(&most).map(|(x, m)| (x - m).exp()).collect()).collect();
    let mut weights = vec![1.0 / each.len() as f64; each.len()];
    let mixed = |weights: &[f64]| -> Vec<f64> {
        (0..blocks).map(|b| weights.iter().zip(&p).map(|(w, p)| w * p[b]).sum::<f64>()).collect()
    };
    for _ in 0..ROUNDS {
        let all = mixed(&weights);
        for (w, p) in weights.iter_mut().zip(&p) {
            *w *= p.iter().zip(&all).map(|(p, all)| p / all).sum::<f64>() / blocks.max(1) as f64;
        }
    }
    (mixed(&weights).iter().zip(&most).map(|(p, m)| p.ln() + m).collect(), weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ln p of a reading beside a discrepancy.
    fn normal(y: f64, tau: f64) -> f64 {
        let v = 1.0 + tau * tau;
        -0.5 * y * y / v - 0.5 * v.ln()
    }

    fn each(y: &[f64]) -> Vec<Vec<f64>> {
        SIZES.iter().map(|tau| y.iter().map(|y| normal(*y, *tau)).collect()).collect()
    }

    #[test]
    fn a_few_blocks_that_are_not_met_do_not_spoil_the_others() {
        // Quantiles of noise, and one reading in ten a hundred deviations off.
        let y: Vec<f64> = (0..100).map(|i| if i % 10 == 0 { 100.0 } else { -1.5 + 3.0 * f64::from(i) / 99.0 }).collect();
        let (mixed, weights) = stacked(&each(&y));
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!((weights[0] + weights[1] + weights[2] - 0.9).abs() < 0.02, "{weights:?}");
        for (y, p) in y.iter().zip(&mixed) {
            // A met block pays for nine in ten being met; what is not met pays for one in ten, of the nearest of the sizes.
            let right = if *y == 100.0 { 0.1f64.ln() + normal(*y, 100.0) } else { 0.9f64.ln() + normal(*y, 0.0) };
            assert!((p - right).abs() < 0.15, "{y}: {p}, {right}");
        }
    }

    #[test]
    fn nothing_predicts_better_than_the_mixture_with_these_weights() {
        let y = [0.3, -1.2, 4.0, 0.1, -9.0, 2.2, 0.7, -0.4];
        let all = each(&y);
        let (mixed, weights) = stacked(&all);
        let best: f64 = mixed.iter().sum();
        for k in 0..SIZES.len() {
            let moved = |w: f64, j: usize| 0.99 * w + if j == k { 0.01 } else { 0.0 };
            let p = |b: usize| weights.iter().enumerate().map(|(j, w)| moved(*w, j) * all[j][b].exp()).sum::<f64>();
            let other: f64 = (0..y.len()).map(|b| p(b).ln()).sum();
            assert!(other <= best + 1e-3, "{k}: {other} {best}");
        }
    }
}
