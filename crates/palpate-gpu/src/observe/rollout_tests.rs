//! Whole evaluations with observations against the CPU backend: cost, gradient and Gauss–Newton matrix through all steps, moving and
//! static; a member that fails leaves the others alone.

use super::tests::{Noise, scene};
use crate::GpuBackend;
use crate::tests::scenes::{device, held};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout};
use palpate_model::observation::{Camera, Frame, Observation, ObservedPoint};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan_build::build_plan;
use palpate_model::scene::{Analytic, Scene};
use std::ops::ControlFlow;

/// Single precision through a few steps and their solves (to 1e-5 or so of the forces) leaves derivatives that are right to a
/// thousandth of what they could be at most.
const AGREEMENT: f64 = 1e-3;

/// How the surface is compared.
pub(crate) fn watched() -> Option<palpate_model::scene::ObservationSpec> {
    scene(Analytic::Ball { radius: 0.05, center: DVec3::ZERO }, 0.03).observation
}

/// The plan of a scene that was seen from two sides, a little after each of its states.
pub(crate) fn seen(scene: &Scene) -> Plan {
    let bare = build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let body = bare.body.clone();
    let (mut frames, mut noise) = (Vec::new(), Noise(11));
    let theta = bare.theta.clone();
    let visit = |_: usize, s: palpate_engine::Snapshot, _: Vec<palpate_engine::FrameResiduals>| {
        let place = |p: &palpate_model::body::Patch| {
            let nodes = &body.cells[p.cell as usize].nodes;
            p.point + (0..8).map(|i| p.weights[i] * s.displacement[nodes[i] as usize]).sum::<DVec3>()
        };
        let mut point =
            |p| ObservedPoint { position: place(p) + 0.1 * body.grid.h * noise.vector(), camera: u32::from(p.normal.x < 0.0) };
        let points = body.patches.iter().map(&mut point).collect();
        frames.push(Frame { time: scene.time.start + s.time + 0.2 * scene.time.step, points, ..Frame::default() });
        ControlFlow::Continue(())
    };
    let mut cpu = Rollout::new(CpuBackend, &bare, 1).unwrap_or_else(|e| panic!("{e}"));
    cpu.visit(&theta, visit).unwrap_or_else(|e| panic!("{e}"));
    let side = |x: f64| Camera { center: DVec3::new(x, 0.1, 0.2), axis: DVec3::new(-x.signum(), 0.0, 0.0) };
    let cameras = vec![side(1.0), side(-1.0)];
    let h = body.grid.h;
    let observation =
        Observation { cameras, frames, depth_noise: 0.1 * h, marker_noise: h, displacement_noise: h, ..Observation::default() };
    build_plan(scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// What differs of two evaluations. |dJ/dp| is at most √(2 J H_pp), and H_pq at most √(H_pp H_qq).
pub(crate) fn differences(a: &Evaluation, b: &Evaluation, directions: &[usize]) -> Vec<String> {
    let (Some(x), Some(y)) = (&a.curvature, &b.curvature) else { return vec!["no curvature".into()] };
    let q = directions.len();
    let mut out = Vec::new();
    let mut check = |name: String, x: f64, y: f64, size: f64| {
        let d = (x - y).abs() / size;
        // Not a number is a difference as well.
        if d.is_nan() || d > AGREEMENT {
            out.push(format!("{name}: {x} is not {y} ({d:.1e})"));
        }
    };
    check("cost".into(), a.cost, b.cost, b.cost);
    check("matched".into(), a.matched as f64, b.matched as f64, b.matched as f64);
    for i in 0..q {
        let own = y.matrix[i * q + i];
        let most = (2.0 * b.cost * own).sqrt();
        check(format!("gradient {i}"), a.gradient[directions[i]], b.gradient[directions[i]], most);
        check(format!("Gauss–Newton gradient {i}"), x.gradient[i], y.gradient[i], most);
        for j in 0..q {
            let size = (own * y.matrix[j * q + j]).sqrt();
            check(format!("matrix {i} {j}"), x.matrix[i * q + j], y.matrix[i * q + j], size);
        }
    }
    out
}

fn compare(plan: &Plan, keys: &[ParamKey], changes: &[&[f64]]) {
    let Some(gpu) = device(None) else { return };
    let directions: Vec<usize> = keys.iter().map(|k| plan.layout.index(*k)).collect();
    let mut rows = vec![plan.theta.clone(); changes.len()];
    for (row, change) in rows.iter_mut().zip(changes) {
        directions.iter().zip(*change).for_each(|(d, c)| row[*d] *= c);
    }
    let request = Request { gradient: true, sensitivities: directions.clone() };
    let mut cpu = Rollout::new(CpuBackend, plan, rows.len()).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&ParamBatch::from_rows(&rows), &request);
    // One more member, whose Young's modulus is none.
    let mut broken = plan.theta.clone();
    broken[plan.layout.index(ParamKey::YoungsModulus)] = f64::NAN;
    rows.insert(1, broken);
    let mut backend = Rollout::new(GpuBackend::on(gpu), plan, rows.len()).unwrap_or_else(|e| panic!("{e}"));
    let mut found = backend.evaluate(&ParamBatch::from_rows(&rows), &request);
    let failed = found.remove(1);
    assert!(failed.failure.is_some() && failed.cost.is_infinite(), "{failed:?}");
    for (a, b) in found.iter().zip(&right) {
        assert!(b.failure.is_none() && b.matched > 100, "{b:?}");
        let off = differences(a, b, &directions);
        assert!(off.is_empty(), "{off:#?}");
        let mut wrong = a.clone();
        wrong.cost *= 1.01;
        wrong.curvature.iter_mut().for_each(|c| c.matrix[0] *= 1.01);
        assert_eq!(differences(&wrong, b, &directions).len(), 2, "1 % was not seen");
    }
}

#[test]
fn evaluations_of_a_falling_ball_agree() {
    let center = DVec3::new(0.003, 0.001, 0.051);
    let plan = seen(&scene(Analytic::Ball { radius: 0.05, center }, 0.03));
    let keys = [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density, ParamKey::TimeStart, ParamKey::Gravity(2)];
    compare(&plan, &keys, &[&[1.3, 0.95, 1.1, 1.03, 1.0], &[0.8, 1.05, 1.0, 0.96, 1.02]]);
}

#[test]
fn evaluations_of_a_static_problem_agree() {
    let mut s = held(0.03);
    s.time.steps = 0;
    s.observation = watched();
    compare(&seen(&s), &[ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density], &[&[1.2, 0.97, 1.0]]);
}
