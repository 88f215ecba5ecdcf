//! Every effect by itself in a scene where everything acts: adjoint = sensitivities = differences, for its own parameters and those
//! of the scene that laws depend on.

use super::gradients::{ball, observed};
use glam::{DAffine3, DQuat, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::driven::{Drive, Points};
use palpate_model::effects::law::Asks;
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{self, ALL, Family};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::mechanics::path::Path;
use palpate_model::mechanics::series::Series;
use palpate_model::params::ParamKey::{self, *};
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, Clamp, InitialShape};
use palpate_model::shape::Placed;
use std::sync::Arc;

/// The ball with one effect, every amplitude at a size that matters.
pub(super) fn with(law: usize) -> palpate_model::scene::Scene {
    let mut scene = ball();
    let mut effect = effects::Effect::absent(law);
    for (value, p) in effect.values.iter_mut().zip(ALL[law].params) {
        if let Some(v) = value {
            *v = (*v + 0.3 * p.typical).clamp(p.lower, p.upper);
        }
    }
    if ALL[law].asks() == Asks::Path {
        // Into the side of the ball, and on.
        let at = |t: f64| DVec3::new(0.072 - 0.1 * t, 0.004 * (30.0 * t).sin(), 0.055);
        let times = vec![0.0, 0.03, 0.07];
        effect.path = Some(Arc::new(Path { points: times.iter().map(|t| at(*t)).collect(), times }));
    }
    if ALL[law].asks() == Asks::Series {
        // Places that two points are drawn to, or forces of as many newtons; no state is at one of these times, where the rate jumps.
        let points = vec![DVec3::new(0.04, 0.0, 0.06), DVec3::new(0.0, 0.03, 0.08)];
        let at = |t: f64, p: &DVec3| *p + DVec3::new(0.3 * t, -0.2 * t, 2.0 * t * t);
        let times = vec![0.0, 0.0301, 0.0703];
        let vectors = times.iter().flat_map(|t| points.iter().map(|p| at(*t, p)).collect::<Vec<_>>()).collect();
        let series = Arc::new(Series { count: 2, times, vectors });
        effect.drive = Some(Arc::new(Drive { points: Points::Places(points, None), series, tracked: Vec::new() }));
    }
    if let Some(moving) = &mut effect.moving {
        // Into the side of the ball, turning, and a jet from there.
        let at = |t: f64| DVec3::new(0.074 - 0.1 * t, 0.004 * (30.0 * t).sin(), 0.055);
        let times = vec![0.0, 0.03, 0.07];
        let translations = times.iter().map(|t| at(*t)).collect();
        let rotations = times.iter().map(|t| DQuat::from_rotation_y(2.0 * t)).collect();
        let motion = RigidMotion { times, translations, rotations };
        *moving = Arc::new(match ALL[law].site {
            effects::Site::Obstacle => {
                let shape = Analytic::Ball { radius: 0.03, center: DVec3::new(0.001, 0.002, 0.0) };
                Moving::obstacle(&Placed::new(shape, DAffine3::IDENTITY), 0.002, motion)
            }
            _ => Moving::nozzle(-DVec3::X, motion),
        });
    }
    scene.effects = vec![effect];
    if ALL[law].family == Family::Contact {
        // Contact acts along the way of a step.
        scene.time.theta = 0.55;
    }
    if matches!(ALL[law].site, effects::Site::Clamps(_) | effects::Site::Edges(_)) {
        // They need a clamp, a start that it does not jerk, and a body that does not hang by half its size from the clamp's edge: where the
        // extension folds, the cost is rough.
        scene.material.youngs_modulus *= 4.0;
        scene.clamps = vec![Clamp::still(DVec3::new(-0.1, 0.03, 0.0), DVec3::new(0.1, 0.1, 0.2))];
        scene.initial.state = InitialShape::StaticEquilibrium;
    }
    scene
}

/// The effect's own numbers, and one of each that laws may depend on besides.
fn touched(key: ParamKey) -> bool {
    matches!(key, Effect { .. } | YoungsModulus | Density | Gravity(2) | Velocity(0) | PlaneHeight(0) | PlaneTheta(0) | TimeStart)
}

/// Compares adjoint and sensitivities parameter by parameter, and the adjoint with a difference along one direction that all of them
/// share in about equal parts: an error in any one of them shows, at the price of four simulations.
pub(super) fn check(plan: &Plan, name: &str) {
    let chosen: Vec<usize> = (0..plan.layout.len()).filter(|i| touched(plan.layout.keys[*i])).collect();
    let mut rollout = Rollout::new(CpuBackend, plan, 4).unwrap();
    let mut evaluate = |rows: &[Vec<f64>], request: Request| {
        let all = rollout.evaluate(&ParamBatch::from_rows(rows), &request);
        all.into_iter().inspect(|e| assert!(e.failure.is_none(), "{name}: {:?}", e.failure)).collect::<Vec<_>>()
    };
    let here = [plan.theta.clone()];
    let adjoint = evaluate(&here, Request { gradient: Wanted::All, sensitivities: Vec::new() }).remove(0).gradient;
    let along = Request { gradient: Wanted::Nothing, sensitivities: chosen.clone() };
    let forward = evaluate(&here, along).remove(0).curvature.unwrap().gradient;
    let size = |i: usize| plan.layout.keys[i].spec().size_at(plan.theta[i]);
    let parts: Vec<f64> = chosen.iter().map(|&i| adjoint[i] * size(i)).collect();
    let largest = parts.iter().map(|p| p.abs()).fold(0.0, f64::max);
    for (k, &i) in chosen.iter().enumerate() {
        let f = forward[k] * size(i);
        println!("{name} {:28} adjoint {:+.10e} forward {f:+.10e}", plan.layout.keys[i].spec().path, parts[k]);
        assert!((parts[k] - f).abs() < 1e-9 * parts[k].abs().max(1e-3 * largest), "{name}: {:?}", plan.layout.keys[i]);
    }
    // Weak parameters go further than strong ones, up to thirty times; every part counts positive, so that none cancels another.
    let direction: Vec<f64> = parts.iter().map(|p| (largest / p.abs()).min(30.0) * p.signum()).collect();
    // So short that no point passes a seam of its cell's distances, or finds another side, on the way: the cost has kinks and small steps there.
    let step = 2e-6;
    let rows = [-2.0, -1.0, 1.0, 2.0].map(|s| {
        let mut theta = plan.theta.clone();
        chosen.iter().zip(&direction).for_each(|(&i, d)| theta[i] += s * step * d * size(i));
        theta
    });
    let c: Vec<f64> = evaluate(&rows, Request::default()).iter().map(|e| e.cost).collect();
    let difference = (c[0] - 8.0 * c[1] + 8.0 * c[2] - c[3]) / (12.0 * step);
    let sum: f64 = parts.iter().zip(&direction).map(|(p, d)| p * d).sum();
    println!("{name}: adjoint {sum:+.10e}, difference {difference:+.10e}: {:.1e} of it", (sum / difference - 1.0).abs());
    // Differences of fourth order over 2e-6 to 6e-5 of a size that matters leave some 1e-9; where a law's third derivative jumps
    // (contact's blend) a little more.
    assert!((sum - difference).abs() < 3e-8 * sum, "{name}: adjoint and differences differ");
    let own = chosen.iter().zip(&parts).filter(|(i, _)| matches!(plan.layout.keys[**i], Effect { .. }));
    assert!(own.map(|(_, p)| p.abs()).fold(0.0, f64::max) > 1e-6 * largest, "{name}: it acts");
}

fn check_family(family: Family) {
    let mut found = 0;
    for law in (0..ALL.len()).filter(|l| ALL[*l].family == family) {
        check(&observed(&with(law), &[0.025, 0.0437, 0.06]), ALL[law].kind);
        found += 1;
    }
    assert!(found > 0, "no effect of {family:?}");
}

#[test]
fn contact() {
    check_family(Family::Contact);
}

#[test]
fn loads() {
    check_family(Family::Load);
}

#[test]
fn materials() {
    check_family(Family::Material);
}

#[test]
fn shapes() {
    check_family(Family::Shape);
}

#[test]
fn slack() {
    check_family(Family::Slack);
}
