//! Single residuals and their sensitivities agree with the sums that fits use, and with differences.

use super::gradients::{ball, observed};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Source};
use palpate_model::observation::ObservedPoint;
use palpate_model::params::ParamKey::*;

#[test]
fn rows_add_up_to_cost_gradient_and_curvature() {
    let mut plan = observed(&ball(), &[0.0, 0.025, 0.0437, 0.06]);
    // A point in the void has a row like any other, but nothing to say.
    let mut observation = (*plan.observation).clone();
    let void = ObservedPoint { position: glam::DVec3::splat(3.0), camera: 0 };
    observation.frames[1].points.insert(1, void);
    plan.observation = observation.into();
    let directions: Vec<usize> =
        [YoungsModulus, PoissonRatio, Gravity(2), TimeStart, PlaneHeight(0)].map(|k| plan.layout.index(k)).to_vec();
    let q = directions.len();
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
    let lin = rollout.linearise(&plan.theta, &directions).unwrap();
    let request = Request { gradient: false, sensitivities: directions.clone() };
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    let rows = &lin.rows.residuals;
    assert_eq!((rows.len(), lin.rows.sensitivity.len()), (e.residuals, e.residuals * q));
    let missing: Vec<_> = rows.iter().filter(|r| r.value.is_none()).collect();
    assert!(missing.iter().any(|r| r.frame == 1 && r.source == Source::Point { point: 1, camera: 0 }), "{missing:?}");
    assert_eq!(rows.iter().filter(|r| r.value.is_some()).count(), e.matched);
    let (mut gradient, mut matrix) = (vec![0.0; q], vec![0.0; q * q]);
    for (r, d) in rows.iter().zip(lin.rows.sensitivity.chunks(q)) {
        let w = r.weight / (r.noise * r.noise) / e.residuals as f64;
        for a in 0..q {
            gradient[a] += w * r.value.unwrap_or(0.0) * d[a];
            (0..q).for_each(|b| matrix[a * q + b] += w * d[a] * d[b]);
        }
    }
    let c = e.curvature.unwrap();
    for (x, y) in gradient.iter().chain(&matrix).zip(c.gradient.iter().chain(&c.matrix)) {
        // The same numbers in another order of summation.
        assert!((x - y).abs() <= 1e-9 * y.abs(), "{x} and {y}");
    }
    assert_eq!(lin.evaluation.cost, e.cost);

    for (a, &p) in directions.iter().enumerate() {
        let step = 1e-5 * plan.theta[p].abs().max(1e-2);
        let side = |s: f64, rollout: &mut Rollout<CpuBackend>| {
            let mut theta = plan.theta.clone();
            theta[p] += s * step;
            rollout.linearise(&theta, &directions).unwrap().rows.residuals
        };
        let (plus, minus) = (side(1.0, &mut rollout), side(-1.0, &mut rollout));
        let scale = (0..rows.len()).map(|i| lin.rows.sensitivity[i * q + a].abs()).fold(0.0, f64::max);
        let mut worst: f64 = 0.0;
        for i in 0..rows.len() {
            if let (Some(x), Some(y)) = (plus[i].value, minus[i].value) {
                // A point on the edge of two band cells may change sides, where the distance has a kink.
                if plus[i].rest.distance(minus[i].rest) < 1e-3 * plan.body.grid.h {
                    worst = worst.max(((x - y) / (2.0 * step) - lin.rows.sensitivity[i * q + a]).abs());
                }
            }
        }
        println!("{:?}: {:.1e} of {scale:.2e}", plan.layout.keys[p], worst / scale);
        // Truncation and rounding of central differences, and points in cells whose slope jumps at a face.
        assert!(worst < 1e-3 * scale, "{:?}: {worst} of {scale}", plan.layout.keys[p]);
    }
}
