//! Single residuals and their sensitivities agree with the sums that fits use, and with differences.

use super::gradients::{ball, observed};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Source, Wanted};
use palpate_model::observation::{ObservedPoint, Sensor};
use palpate_model::params::ParamKey::*;
use palpate_model::plan::Plan;
use std::sync::Arc;

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
    let along_nothing = rollout.linearise(&plan.theta, &[]).unwrap().rows;
    assert!(along_nothing.residuals == lin.rows.residuals && along_nothing.sensitivity.is_empty());
    let request = Request { gradient: Wanted::Nothing, sensitivities: directions.clone() };
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    let rows = &lin.rows.residuals;
    assert_eq!((rows.len(), lin.rows.sensitivity.len()), (e.residuals, e.residuals * q));
    let missing: Vec<_> = rows.iter().filter(|r| r.value.is_none()).collect();
    assert!(missing.iter().any(|r| r.frame == 1 && r.source == Source::point(1, Sensor::Camera(0))), "{missing:?}");
    assert_eq!(rows.iter().filter(|r| r.value.is_some()).count(), e.matched);
    let points = rows.iter().filter(|r| r.source.is_depth() && r.value.is_some()).count();
    assert!(points > 800, "{points} points meet something");
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
                if plus[i].rest.distance(minus[i].rest) < 1e-3 * plan.body.length {
                    worst = worst.max(((x - y) / (2.0 * step) - lin.rows.sensitivity[i * q + a]).abs());
                }
            }
        }
        println!("{:?}: {:.1e} of {scale:.2e}", plan.layout.keys[p], worst / scale);
        // Truncation and rounding of central differences, and points in cells whose slope jumps at a face.
        assert!(worst < 1e-3 * scale, "{:?}: {worst} of {scale}", plan.layout.keys[p]);
    }
}

/// Cost and gradient by the vertical velocity at the start, with Gauss-Newton's curvature: sums over the residuals, not their mean.
fn sums(plan: &Plan) -> [f64; 3] {
    let at = plan.layout.index(Velocity(2));
    let mut rollout = Rollout::new(CpuBackend, plan, 1).unwrap();
    let request = Request { gradient: Wanted::Nothing, sensitivities: vec![at] };
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    assert_eq!(e.matched, e.residuals, "{:?}", e.failure);
    let c = e.curvature.unwrap();
    [e.cost, c.gradient[0], c.matrix[0]].map(|x| x * e.residuals as f64)
}

#[test]
fn a_frame_counts_by_its_points() {
    // What is promised (docs/method.md, "Cost"): every point counts 1/σ², whatever the frame that it is in. A frame of few pixels neither
    // has its points counted for more than others', as a mean over frames would, nor for less.
    let plan = observed(&ball(), &[0.025, 0.0437]);
    let with = |sizes: [usize; 2], shift: [f64; 2]| {
        let mut o = (*plan.observation).clone();
        for ((f, n), dz) in o.frames.iter_mut().zip(sizes).zip(shift) {
            // Spread over the ball, and as often as it takes.
            let all = std::mem::take(&mut f.points);
            let pick = |k: usize| all[(k * all.len() / n.min(all.len())) % all.len()];
            f.points = (0..n).map(pick).collect();
            f.points.iter_mut().for_each(|p| p.position.z += dz);
            f.markers.clear();
            f.displacements.clear();
        }
        Plan { observation: o.into(), ..plan.clone() }
    };
    let still = [0.0; 2];
    let (both, many, few) = (sums(&with([500, 5], still)), sums(&with([500, 0], still)), sums(&with([0, 5], still)));
    let mut twice = with([0, 5], still);
    Arc::make_mut(&mut twice.observation).frames[1].points.extend_from_within(..);
    let twice = sums(&twice);
    for k in 0..3 {
        // The same terms in another order.
        assert!((both[k] - many[k] - few[k]).abs() < 1e-9 * both[k].abs().max(many[k].abs()), "{both:?} {many:?} {few:?}");
    }
    // Curvature is a sum of squares. Each goes by how much its surface faces along the motion, and by whether that part has landed, so that five
    // points are some way off the mean; and the later frame has had longer to move. A hundredth of the points has about a hundredth of it.
    println!("curvature: {:.3e} of 500 points, {:.3e} of 5, {:.3e} of these twice", many[2], few[2], twice[2]);
    assert!(few[2] > 0.3 * 0.01 * many[2] && few[2] < 10.0 * 0.01 * many[2], "{few:?} {many:?}");
    // The same points twice have twice as much of everything.
    for k in 0..3 {
        assert!((twice[k] - 2.0 * few[k]).abs() < 1e-9 * few[k].abs(), "{twice:?} {few:?}");
    }
    // A millimetre of error in one of the frames moves the answer by as much as its share of the curvature lets it.
    let answer = |shift: [f64; 2]| {
        let [_, gradient, curvature] = sums(&with([500, 5], shift));
        -gradient / curvature
    };
    let (right, few_off, many_off) = (answer(still), answer([0.0, 1e-3]) - answer(still), answer([1e-3, 0.0]) - answer(still));
    println!(
        "step {right:.4} m/s; 1 mm in the frame of 5 points moves it by {few_off:.4} m/s, in the frame of 500 by {many_off:.4} m/s"
    );
    // With equal weights for frames instead of points both would move it alike.
    assert!(few_off.abs() < 0.1 * many_off.abs(), "{few_off} {many_off}");
    assert!(few_off.abs() > 0.001 * many_off.abs(), "{few_off} {many_off}");
}
