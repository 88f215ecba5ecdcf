//! Precisions of priors against dense matrices and differences.

use super::precision::{Mean, Precision};
use super::tests::{block, dense, prior, wave};
use super::{FieldPrior, Hyper};
use crate::dense::{dot, solve};
use palpate_model::params::fields::PriorKind;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const KINDS: [PriorKind; 2] = [PriorKind::Matern, PriorKind::EdgePreserving];

#[test]
fn precision_and_covariance_are_inverse_and_have_the_stated_deviation() {
    let around = block([9, 4, 3]);
    let n = around.volume.len();
    for kind in KINDS {
        for mean in [Mean::Free, Mean::Zero] {
            let hyper = Hyper { length: 3.0, deviation: 0.4 };
            let p = Precision::new(&FieldPrior { mean, ..prior(&around, kind, None) }, hyper, &wave(n, 0.3)).unwrap();
            let v = wave(n, 1.7);
            let back = p.solve(&[p.times(&v)]).remove(0);
            let off = back.iter().zip(&v).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Condition numbers of 1e6 at most.
            assert!(off < 1e-8, "{kind:?} {mean:?}: {off}");
            // Against the dense inverse.
            let matrix = dense(n, |v| p.times(v));
            let marginal = p.marginal();
            for k in [0, n / 2, n - 1] {
                let unit: Vec<f64> = (0..n).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
                let column = solve(&matrix, &unit).expect("positive definite");
                let whole = marginal[k] + p.mean_deviation().powi(2);
                assert!((column[k] / whole - 1.0).abs() < 1e-6, "{kind:?} {mean:?}: {} {whole}", column[k]);
            }
        }
    }
}

#[test]
fn a_large_body_has_the_stated_deviation_and_correlation_in_its_middle() {
    let n = [12, 12, 12];
    let around = block(n);
    let p = Precision::new(&prior(&around, PriorKind::Matern, None), Hyper { length: 3.0, deviation: 0.3 }, &[]).unwrap();
    let middle = 6 + 12 * (6 + 12 * 6);
    let marginal = p.marginal();
    let deviation = marginal[middle].sqrt();
    // Three tenths of the body lie deeper than two cells, where the surface raises the variance by 4 % at most; what draws find least of so many
    // is 4 % too little.
    assert!((0.95..1.02).contains(&(deviation / 0.3)), "{deviation}");
    // At its surface a body knows half as much of a place.
    assert!(marginal[0] > 1.5 * marginal[middle]);
    let unit: Vec<f64> = (0..around.volume.len()).map(|i| if i == middle { 1.0 } else { 0.0 }).collect();
    let column = p.deviations(&[unit]).remove(0);
    let correlation = |away: usize| column[middle - away] / (marginal[middle] * marginal[middle - away]).sqrt();
    // exp(−2r/3) is 0.135 at three cells; cells as large as a third of the length smear it.
    assert!((0.08..0.17).contains(&correlation(3)) && correlation(1) > 0.4, "{} {}", correlation(1), correlation(3));
    // Draws have the variances that solves give: 512 of them, to 6 %, four times of it for the worst of a thousand.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let draws = p.draw(512, &mut rng);
    let of = |k: usize| draws.iter().map(|d| d[k] * d[k]).sum::<f64>() / 512.0;
    let worst = (0..around.volume.len()).step_by(7).map(|k| (of(k) / marginal[k] - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 0.25, "{worst}");
}

#[test]
fn energies_have_their_derivatives() {
    let around = block([7, 3, 2]);
    let n = around.volume.len();
    for kind in KINDS {
        let (prior, hyper) = (prior(&around, kind, None), Hyper { length: 4.0, deviation: 0.5 });
        let p = Precision::new(&prior, hyper, &vec![0.0; n]).unwrap();
        let (m, v) = (wave(n, 0.7), wave(n, 1.9));
        let at = |t: f64| {
            let m: Vec<f64> = m.iter().zip(&v).map(|(m, v)| m + t * v).collect();
            let (e, g) = p.energy(&prior, hyper, &m);
            (e, dot(&g, &v))
        };
        let d = 1e-5;
        let slope = (at(d).0 - at(-d).0) / (2.0 * d);
        assert!((slope / at(0.0).1 - 1.0).abs() < 1e-8, "{kind:?}: {slope} {}", at(0.0).1);
        let curvature = (at(d).1 - at(-d).1) / (2.0 * d);
        let product = dot(&p.curvature(&prior, hyper, &m, &v), &v);
        match kind {
            PriorKind::Matern => assert!((product / curvature - 1.0).abs() < 1e-8, "{product} {curvature}"),
            // Where links step, the touching Gaussian is steeper.
            PriorKind::EdgePreserving => assert!(product > curvature && curvature > 0.0, "{product} {curvature}"),
        }
        // The precision at m is that curvature.
        let touching = Precision::new(&prior, hyper, &m).unwrap();
        // Up to the δ of no account.
        assert!((dot(&touching.times(&v), &v) / product - 1.0).abs() < 1e-2, "{kind:?}");
    }
}
