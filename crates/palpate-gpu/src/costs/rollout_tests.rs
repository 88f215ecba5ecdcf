//! Whole evaluations with observations against the CPU backend: cost, gradient and Gauss–Newton matrix through all steps, moving and
//! static; a member that fails leaves the others alone.

use super::fault_tests::FAULTS;
use super::tests::{Noise, scene};
use crate::GpuBackend;
use crate::tests::faults::{BALANCE, Fault, faulty};
use crate::tests::scenes::{device, held};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::observation::{Camera, Channel, Frame, Observation, ObservedPoint, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, Scene};
use palpate_model::space::body::Patch;
use palpate_model::space::stencil::Stencil;
use std::ops::ControlFlow;

/// Single precision through a few steps and their solves (to 1e-5 or so of the forces) leaves derivatives that are right to a
/// thousandth of what they could be at most.
pub(crate) const AGREEMENT: f64 = 1e-3;

/// How the surface is compared.
pub(crate) fn watched() -> Option<palpate_model::scene::ObservationSpec> {
    scene(Analytic::Ball { radius: 0.05, center: DVec3::ZERO }, 0.03).observation
}

/// The plan of a scene that was seen from two sides, a little after each of its states; sharply, so that what a test changes explains
/// most of a cost, and gradients are not small beside what they could be.
pub(crate) fn seen(scene: &Scene) -> Plan {
    seen_within(scene, 0.02)
}

/// The same with points off by up to so many cells.
pub(crate) fn seen_within(scene: &Scene, off: f64) -> Plan {
    let bare = build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let body = bare.body.clone();
    let (mut frames, mut noise) = (Vec::new(), Noise(11));
    let theta = bare.theta.clone();
    let visit = |_: usize, s: palpate_engine::Snapshot, _: Vec<palpate_engine::FrameResiduals>| {
        let mut point = |(p, place): (&Patch, Stencil)| ObservedPoint {
            position: p.point + place.at(&s.displacement) + off * body.length * noise.vector(),
            camera: u32::from(p.normal.x < 0.0),
        };
        let points = body.pieces().map(&mut point).collect();
        frames.push(Frame { time: scene.time.start + s.time + 0.2 * scene.time.step, points, ..Frame::default() });
        ControlFlow::Continue(())
    };
    let mut cpu = Rollout::new(CpuBackend, &bare, 1).unwrap_or_else(|e| panic!("{e}"));
    cpu.visit(&theta, visit).unwrap_or_else(|e| panic!("{e}"));
    let side = |x: f64| Camera::Pinhole { center: DVec3::new(x, 0.1, 0.2), axis: DVec3::new(-x.signum(), 0.0, 0.0) };
    let cameras = vec![side(1.0), side(-1.0)];
    let h = body.length;
    let observation =
        Observation { cameras, frames, channels: vec![Channel::new(ReadingKind::Depth, 0.1 * h)], ..Observation::default() };
    build_plan(scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// A number of an evaluation that is compared, by name.
type Number = (String, f64);

/// Everything that is compared.
fn numbers(e: &Evaluation, directions: &[usize]) -> Vec<Number> {
    let q = directions.len();
    let mut out = vec![("cost".into(), e.cost), ("matched".into(), e.matched as f64)];
    let Some(c) = &e.curvature else { return out };
    for (i, place) in directions.iter().enumerate() {
        out.push((format!("gradient {i}"), e.gradient[*place]));
        out.push((format!("Gauss–Newton gradient {i}"), c.gradient[i]));
        out.extend((0..q).map(|j| (format!("matrix {i} {j}"), c.matrix[i * q + j])));
    }
    out
}

/// What each of them could be at most: |dJ/dp| is at most √(2 J H_pp), and H_pq at most √(H_pp H_qq).
fn sizes(e: &Evaluation, q: usize) -> Vec<f64> {
    let mut out = vec![e.cost, e.matched as f64];
    let own = |i: usize| e.curvature.as_ref().map_or(0.0, |c| c.matrix[i * q + i]);
    for i in 0..q {
        let most = (2.0 * e.cost * own(i)).sqrt();
        out.extend([most, most]);
        out.extend((0..q).map(|j| (own(i) * own(j)).sqrt()));
    }
    out
}

fn apart(a: &[Number], b: &[Number], sizes: &[f64], allowed: f64) -> Vec<String> {
    assert_eq!(a.len(), b.len());
    let all = a.iter().zip(b).zip(sizes).map(|(((name, x), (_, y)), size)| (name, x, y, (x - y).abs() / size));
    // Not a number is a difference as well.
    all.filter(|n| n.3.is_nan() || n.3 > allowed).map(|(name, x, y, d)| format!("{name}: {x} is not {y} ({d:.1e})")).collect()
}

/// What differs of two evaluations.
pub(crate) fn differences(a: &Evaluation, b: &Evaluation, directions: &[usize]) -> Vec<String> {
    differences_beyond(AGREEMENT, a, b, directions)
}

/// What differs by more than is allowed.
pub(crate) fn differences_beyond(allowed: f64, a: &Evaluation, b: &Evaluation, directions: &[usize]) -> Vec<String> {
    apart(&numbers(a, directions), &numbers(b, directions), &sizes(b, directions.len()), allowed)
}

/// Two evaluations agree, and would not if any number of the first, gradients among them, were one percent larger. Only of numbers
/// above 15 % of what they could be at most is that half as much again as the agreement; what is compared is off by some of it already.
pub(crate) fn assert_agreement(a: &Evaluation, b: &Evaluation, directions: &[usize]) {
    let (found, right, sizes) = (numbers(a, directions), numbers(b, directions), sizes(b, directions.len()));
    let off = apart(&found, &right, &sizes, AGREEMENT);
    assert!(off.is_empty(), "{off:#?}");
    let large = |k: usize| right[k].1.abs() > 0.15 * sizes[k];
    for k in (0..found.len()).filter(|k| large(*k)) {
        let mut wrong = found.clone();
        wrong[k].1 *= 1.01;
        assert_eq!(apart(&wrong, &right, &sizes, AGREEMENT).len(), 1, "1 % of {} was not seen", found[k].0);
    }
    let shares: Vec<String> = right
        .iter()
        .zip(&sizes)
        .filter(|(n, _)| n.0.starts_with("gradient"))
        .map(|((_, v), s)| format!("{:.2}", v / s))
        .collect();
    println!("gradients over what they could be: {}", shares.join(" "));
    let gradients = (0..found.len()).filter(|k| right[*k].0.starts_with("gradient") && large(*k)).count();
    assert!(gradients > 0, "no gradient is large enough to tell 1 %");
}

/// Evaluations of members with these changes of some parameters are the CPU's; with each of these faults of the device they are not.
fn compare(plan: &Plan, keys: &[ParamKey], changes: &[&[f64]], faults: &[Fault]) {
    let Some(gpu) = device(None) else { return };
    let directions: Vec<usize> = keys.iter().map(|k| plan.layout.index(*k)).collect();
    let mut rows = vec![plan.theta.clone(); changes.len()];
    for (row, change) in rows.iter_mut().zip(changes) {
        directions.iter().zip(*change).for_each(|(d, c)| row[*d] *= c);
    }
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    let mut cpu = Rollout::new(CpuBackend, plan, rows.len()).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&ParamBatch::from_rows(&rows), &request);
    for fault in faults {
        let (wrong, rows) = faulty(plan, &rows, fault);
        let mut backend = Rollout::new(GpuBackend::on(gpu.clone()), &wrong, rows.len()).unwrap_or_else(|e| panic!("{e}"));
        for (a, b) in backend.evaluate(&ParamBatch::from_rows(&rows), &request).iter().zip(&right) {
            let seen = differences(a, b, &directions);
            println!("1 % of {}: {seen:?}", fault.0);
            assert!(seen.iter().any(|s| s.starts_with("gradient")), "1 % of {} was not seen: {seen:?}", fault.0);
        }
    }
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
        assert_agreement(a, b, &directions);
    }
}

#[test]
fn evaluations_of_a_falling_ball_agree() {
    // Its lowest point is in the contact layer, so that Young's modulus matters.
    let center = DVec3::new(0.003, 0.001, 0.0502);
    let plan = seen(&scene(Analytic::Ball { radius: 0.05, center }, 0.03));
    let keys = [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density, ParamKey::TimeStart, ParamKey::Gravity(2)];
    // It hardly touches the ground, and is hardly damped.
    let faults = [&BALANCE[..3], &FAULTS[1..2]].concat();
    compare(&plan, &keys, &[&[1.3, 0.95, 1.1, 1.03, 1.0], &[0.8, 1.05, 1.0, 0.96, 1.02]], &faults);
}

#[test]
fn evaluations_of_a_static_problem_agree() {
    let mut s = held(0.03);
    s.time.steps = 0;
    s.observation = watched();
    let keys = [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density];
    compare(&seen(&s), &keys, &[&[1.2, 0.97, 1.0]], &[&BALANCE[..3], &FAULTS[1..2]].concat());
}
