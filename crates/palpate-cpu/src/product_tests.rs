//! A tangent, products at every step and an adjoint are a product with the Gauss–Newton matrix of a whole rollout.

use crate::CpuBackend;
use crate::costs::tests::{Noise, seen};
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};

#[test]
fn a_tangent_and_an_adjoint_multiply_with_the_gauss_newton_matrix() {
    let plan = seen();
    let p = plan.layout.len();
    let request = Request { sensitivities: (0..p).collect(), ..Request::default() };
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    let matrix = e.curvature.unwrap().matrix;
    // Every number counts alike: sizes differ by many powers of ten.
    let size: Vec<f64> = (0..p).map(|a| matrix[a * p + a].sqrt()).collect();
    let mut noise = Noise(9);
    let known: Vec<usize> = (0..p).filter(|a| size[*a] > 0.0).collect();
    assert!(known.len() > 10, "{known:?}");
    for round in 0..4 {
        let mut v = vec![0.0; p];
        // One number alone, then all of them.
        let chosen = if round == 0 { &known[..1] } else { &known[..] };
        chosen.iter().for_each(|a| v[*a] = noise.next() / size[*a]);
        let found = rollout.product(&ParamBatch::of(&plan.theta), &v, &Wanted::All).unwrap();
        let right: Vec<f64> = (0..p).map(|a| (0..p).map(|b| matrix[a * p + b] * v[b]).sum()).collect();
        let length = known.iter().map(|a| (right[*a] / size[*a]).powi(2)).sum::<f64>().sqrt();
        for a in &known {
            let off = (found[*a] - right[*a]).abs() / size[*a];
            assert!(off < 1e-9 * length, "{:?}: {} and {}", plan.layout.keys[*a], found[*a], right[*a]);
        }
        let quadratic = |h: &[f64]| v.iter().zip(h).map(|(v, h)| v * h).sum::<f64>();
        assert!((quadratic(&found) - quadratic(&right)).abs() < 1e-9 * quadratic(&right));
    }
}
