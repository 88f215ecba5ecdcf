//! The same answer whatever the solver, the number of threads and the company in a batch.

use glam::{DAffine3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::observation::{Channel, Frame, Observation, ObservedDisplacement, ReadingKind};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use support::scenes;

/// A ball that bounces, compared with a straight fall.
fn plan(linear: LinearSolver, radius: f64) -> Plan {
    let mut s = scenes::body(Analytic::Ball { radius, center: DVec3::new(0.002, 0.001, radius + 0.005) }, 0.015);
    s.gravity = DVec3::new(0.0, 0.5, -9.81);
    s.planes = vec![scenes::plane(DVec3::ZERO, DVec3::new(0.1, 0.0, 1.0))];
    s.initial.angular_velocity = DVec3::new(0.0, 3.0, 0.0);
    s.material.stiffness_damping = 0.002;
    s.time = Time { step: 0.01, steps: 8, start: 0.0, ..Time::weighted(0.6) };
    s.solver.linear = linear;
    s.solver.tolerance = 1e-10;
    let nodes = scenes::plan(&s).body.nodes.len();
    let frames = [0.043, 0.08].map(|time| Frame {
        time,
        displacements: ObservedDisplacement::of_all(vec![DVec3::new(0.0, 0.0, -0.01); nodes]),
        ..Frame::default()
    });
    let noise = Observation { channels: vec![Channel::new(ReadingKind::Displacement, 1e-3)], ..Observation::default() };
    build_plan(&s, Observation { frames: frames.to_vec(), ..noise }, &[]).unwrap()
}

/// The same of a brick of 360 quadratic tetrahedra that flies and spins.
fn plan_of_tets() -> Plan {
    let mut s = scenes::body(Analytic::Ball { radius: 0.01, center: DVec3::ZERO }, 0.01);
    s.object = Object {
        source: support::tets::bar(DVec3::ZERO, 0.01, [5, 4, 3]),
        pose: DAffine3::from_rotation_x(0.3),
        resolution: Resolution::Own,
    };
    s.initial.angular_velocity = DVec3::new(0.0, 3.0, 0.0);
    s.material.stiffness_damping = 0.002;
    s.time = Time { step: 0.01, steps: 2, start: 0.0, ..Time::weighted(0.6) };
    let nodes = scenes::plan(&s).body.nodes.len();
    // Several parts of rows, several tasks of points and of nodes.
    assert!(nodes > 600, "{nodes}");
    let displacements = ObservedDisplacement::of_all(vec![DVec3::new(0.0, 0.0, -0.01); nodes]);
    let frames = vec![Frame { time: 0.015, displacements, ..Frame::default() }];
    let channels = vec![Channel::new(ReadingKind::Displacement, 1e-3)];
    build_plan(&s, Observation { frames, channels, ..Observation::default() }, &[]).unwrap()
}

fn request() -> Request {
    Request { gradient: Wanted::All, sensitivities: vec![0, 1, 4] }
}

fn evaluate(plan: &Plan, rows: &[Vec<f64>], members: usize) -> Vec<Evaluation> {
    Rollout::new(CpuBackend, plan, members).unwrap().evaluate(&ParamBatch::from_rows(rows), &request())
}

fn rows(plan: &Plan) -> Vec<Vec<f64>> {
    [0.3, 1.0, 4.0]
        .iter()
        .map(|f| {
            let mut t = plan.theta.clone();
            t[0] *= f;
            t
        })
        .collect()
}

#[test]
fn direct_and_iterative_solvers_agree() {
    // Big enough for the two-level preconditioner to be in use.
    let [a, b] = [LinearSolver::Cholesky, LinearSolver::ConjugateGradient].map(|l| {
        let plan = plan(l, 0.06);
        assert!(plan.body.nodes.len() > 600);
        evaluate(&plan, std::slice::from_ref(&plan.theta), 1).remove(0)
    });
    assert!(a.failure.is_none() && b.failure.is_none());
    assert!((a.cost / b.cost - 1.0).abs() < 1e-8, "{} {}", a.cost, b.cost);
    let size = a.gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    for (x, y) in a.gradient.iter().zip(&b.gradient) {
        // Newton leaves 1e-10 of the forces; gradients are about a thousand times as sensitive.
        assert!((x - y).abs() < 1e-6 * x.abs().max(1e-6 * size), "{x} {y}");
    }
}

#[test]
fn same_bits_on_any_number_of_threads_and_in_any_batch() {
    for plan in [plan(LinearSolver::Auto, 0.06), plan_of_tets()] {
        let rows = rows(&plan);
        let pool = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| evaluate(&plan, &rows, 3))
        };
        let one = pool(1);
        assert!(one.iter().all(|e| e.failure.is_none()));
        assert_eq!(one, pool(3));
        let alone: Vec<Evaluation> = rows.iter().map(|r| evaluate(&plan, std::slice::from_ref(r), 1).remove(0)).collect();
        assert_eq!(one, alone);
    }
}

#[test]
fn a_member_that_fails_keeps_its_slot_and_harms_nobody() {
    let plan = plan(LinearSolver::Auto, 0.03);
    let mut rows = rows(&plan);
    let alone = evaluate(&plan, &rows[2..], 1);
    rows[1][plan.layout.index(palpate_model::params::ParamKey::PoissonRatio)] = 0.7;
    let all = evaluate(&plan, &rows, 3);
    assert!(all[0].failure.is_none() && all[2].failure.is_none());
    let failure = all[1].failure.as_ref().unwrap().to_string();
    assert!(all[1].cost.is_infinite() && failure.contains("poisson_ratio = 0.7"), "{failure}");
    assert_eq!(all[2], alone[0]);
}

#[test]
fn a_body_that_leaves_the_world_says_when_and_with_what() {
    let mut s = scenes::body(Analytic::Ball { radius: 0.03, center: DVec3::ZERO }, 0.015);
    s.initial.velocity = DVec3::new(0.0, 0.0, 1e5);
    let plan = scenes::plan(&s);
    let failure = evaluate(&plan, std::slice::from_ref(&plan.theta), 1).remove(0).failure.unwrap();
    assert_eq!(failure.kind, palpate_engine::FailureKind::FellOut);
    let text = failure.to_string();
    assert!(text.contains("t = 0.005") && text.contains("initial.velocity.z = 100000") && text.contains("hint"), "{text}");
}
