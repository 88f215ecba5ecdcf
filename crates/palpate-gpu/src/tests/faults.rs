//! Every comparison with the CPU sees one percent: the device is given a plan that is wrong in one place, and must be caught.

use super::forward::{CLOSE, off, states};
use super::scenes::{ball, device, held, plan};
use crate::GpuBackend;
use crate::costs::rollout_tests::{differences, seen};
use crate::device::Gpu;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;
use std::sync::Arc;

/// Where the fault is, and what makes it.
pub(crate) type Fault = (&'static str, fn(&mut Plan));

fn scale(plan: &mut Plan, key: ParamKey) {
    let place = plan.layout.index(key);
    plan.theta[place] *= 1.01;
}

/// Faults of the balance.
pub(crate) const BALANCE: [Fault; 8] = [
    ("Young's modulus", |p| scale(p, ParamKey::YoungsModulus)),
    ("Poisson's ratio", |p| scale(p, ParamKey::PoissonRatio)),
    ("density", |p| scale(p, ParamKey::Density)),
    ("mass damping", |p| scale(p, ParamKey::MassDamping)),
    ("stiffness damping", |p| scale(p, ParamKey::StiffnessDamping)),
    ("point mass", |p| scale(p, ParamKey::PointMass(0))),
    ("ghost penalty", |p| p.solver.ghost *= 1.01),
    ("contact stiffness", |p| p.planes.iter_mut().for_each(|q| q.stiffness = q.stiffness.map(|s| 1.01 * s))),
];

/// A fault of the comparison with what was measured; `observe/fault_tests.rs` has more.
const OBSERVATION: [Fault; 1] = [("noise of depth", |p| Arc::make_mut(&mut p.observation).channels[0].noise *= 1.01)];

/// A plan that is wrong in one place, and parameters of its members that are wrong in the same.
pub(crate) fn faulty(right: &Plan, theta: &[Vec<f64>], (_, fault): &Fault) -> (Plan, Vec<Vec<f64>>) {
    let of = |row: &[f64]| {
        let mut own = Plan { theta: row.to_vec(), ..right.clone() };
        fault(&mut own);
        own
    };
    (of(&right.theta), theta.iter().map(|row| of(row).theta).collect())
}

/// A ball that every term pushes about: it lands hard, slips off its ghosts, and is damped in both ways.
pub(super) fn busy(mut scene: Scene) -> Scene {
    scene.material.mass_damping = 5.0;
    scene.material.stiffness_damping = 0.02;
    scene.solver.ghost = 0.5;
    scene.masses.iter_mut().for_each(|m| m.mass = 0.1);
    scene.planes.iter_mut().for_each(|p| p.stiffness = Some(3e5));
    scene
}

/// Faults of the balance but these, which do not act in a scene.
pub(super) fn but(left_out: &[&str]) -> Vec<Fault> {
    assert!(left_out.iter().all(|name| BALANCE.iter().any(|f| f.0 == *name)), "{left_out:?}");
    BALANCE.into_iter().filter(|f| !left_out.contains(&f.0)).collect()
}

/// Faults of what moves a body that nothing strains.
pub(super) const FLIGHT: [Fault; 3] = [
    ("gravity", |p| scale(p, ParamKey::Gravity(2))),
    ("velocity", |p| scale(p, ParamKey::Velocity(2))),
    ("angular velocity", |p| scale(p, ParamKey::AngularVelocity(1))),
];

/// States of all members must agree with the CPU's within these differences [m], [m/s], and with none of these faults.
pub(super) fn check_states(gpu: &Arc<Gpu>, scene: &Scene, theta: &[Vec<f64>], allowed: [f64; 2], faults: &[Fault]) {
    let right = plan(scene);
    let exact = states(&CpuBackend, &right, theta).0;
    let apart = |plan: &Plan, theta: &[Vec<f64>]| {
        let (found, evaluations) = states(&GpuBackend::on(gpu.clone()), plan, theta);
        assert!(evaluations.iter().all(|e| e.failure.is_none()), "{:?}", evaluations[0].failure);
        let pairs = || found.iter().flatten().zip(exact.iter().flatten());
        [pairs().map(|(a, b)| off(&a.0, &b.0)).fold(0.0, f64::max), pairs().map(|(a, b)| off(&a.1, &b.1)).fold(0.0, f64::max)]
    };
    let d = apart(&right, theta);
    println!("{} nodes: {:.1e} m {:.1e} m/s", right.body.nodes.len(), d[0], d[1]);
    assert!(d[0] < allowed[0] && d[1] < allowed[1], "{:.1e} m {:.1e} m/s", d[0], d[1]);
    let mut missed: Vec<&str> = Vec::new();
    for fault in faults {
        let (wrong, rows) = faulty(&right, theta, fault);
        let (d, name) = (apart(&wrong, &rows), fault.0);
        println!("{name}: {:.1e} m {:.1e} m/s", d[0], d[1]);
        missed.extend((d[0] <= allowed[0] && d[1] <= allowed[1]).then_some(name));
    }
    assert!(missed.is_empty(), "1 % of {missed:?} was not seen");
}

#[test]
fn comparisons_of_a_clamped_body_see_one_percent_of_its_motion() {
    let Some(gpu) = device(None) else { return };
    let mut scene = held(0.03);
    scene.time.steps = 2;
    let right = plan(&scene);
    let mut wrong = right.clone();
    for clamp in &mut wrong.clamps {
        clamp.motion.iter_mut().flat_map(|m| &mut m.translations).for_each(|t| *t *= 1.01);
    }
    let exact = states(&CpuBackend, &right, std::slice::from_ref(&right.theta)).0;
    let found = states(&GpuBackend::on(gpu), &wrong, std::slice::from_ref(&wrong.theta)).0;
    let d = off(&found[2][0].0, &exact[2][0].0);
    assert!(d > CLOSE[0], "{d:.1e} m");
}

#[test]
fn comparisons_of_evaluations_see_one_percent() {
    let Some(gpu) = device(None) else { return };
    let mut scene = busy(ball(0.03));
    scene.time.steps = 3;
    scene.observation = crate::costs::rollout_tests::watched();
    let right = seen(&scene);
    let directions: Vec<usize> =
        [ParamKey::YoungsModulus, ParamKey::Density, ParamKey::Gravity(2)].map(|k| right.layout.index(k)).to_vec();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    // Away from the parameters that were measured with, so that there is something to explain.
    let moved = |plan: &Plan| {
        let mut row = plan.theta.clone();
        row[directions[0]] *= 1.2;
        ParamBatch::from_rows(&[row])
    };
    let mut cpu = Rollout::new(CpuBackend, &right, 1).unwrap_or_else(|e| panic!("{e}"));
    let exact = cpu.evaluate(&moved(&right), &request).remove(0);
    let apart = |plan: &Plan| {
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), plan, 1).unwrap_or_else(|e| panic!("{e}"));
        differences(&rollout.evaluate(&moved(plan), &request).remove(0), &exact, &directions)
    };
    assert!(apart(&right).is_empty(), "{:?}", apart(&right));
    let mut costs = 0;
    for (name, fault) in OBSERVATION.iter().chain(&BALANCE[..5]) {
        let mut wrong = right.clone();
        fault(&mut wrong);
        let seen = apart(&wrong);
        let count = |kind: &str| seen.iter().filter(|s| s.starts_with(kind)).count();
        let each = ["cost", "gradient", "Gauss", "matrix"].map(count);
        println!("{name}: {each:?} numbers of cost, gradient, Gauss–Newton gradient and matrix differ");
        // The cost by itself may be at its lowest by a parameter; all else must tell.
        assert!(each[1..].iter().all(|n| *n > 0), "1 % of {name} was seen in {each:?} numbers");
        costs += each[0];
    }
    assert!(costs > 3, "the cost told of {costs} faults");
}
