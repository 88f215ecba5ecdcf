//! Schemes of several stages and past states against the CPU: states, costs, gradients and sensitivities, with damping of stiffness, moving
//! clamps and contact.

use super::effects::{compare_within, with};
use super::forward::off;
use super::scenes::{ball, device, held, plan};
use crate::GpuBackend;
use crate::costs::rollout_tests::{seen, watched};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, Rollout};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::{ALL, Scheme, find};
use palpate_model::scene::Scene;
use std::ops::ControlFlow;

/// Displacements and velocities after every step.
pub(super) fn moments<B: Backend>(backend: B, plan: &Plan, theta: &[f64]) -> Vec<[Vec<DVec3>; 2]> {
    let mut found = Vec::new();
    let mut rollout = Rollout::new(backend, plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let visited = rollout.visit(theta, |_, s, _| {
        found.push([s.displacement, s.velocity]);
        ControlFlow::Continue(())
    });
    visited.unwrap_or_else(|e| panic!("{e}"));
    found
}

/// Largest difference of displacements [m], and of velocities times the step [m].
pub(super) fn apart(plan: &Plan, a: &[[Vec<DVec3>; 2]], b: &[[Vec<DVec3>; 2]]) -> [f64; 2] {
    assert_eq!(a.len(), b.len());
    let largest = |part: usize| a.iter().zip(b).map(|(a, b)| off(&a[part], &b[part])).fold(0.0, f64::max);
    [largest(0), plan.clock.step * largest(1)]
}

/// Schemes beside the θ-scheme.
pub(super) fn schemes() -> impl Iterator<Item = &'static Scheme> {
    ALL.iter().filter(|s| !s.leaves_theta_open())
}

/// A ball that spins and falls onto the ground, damped.
fn thrown(scheme: &'static Scheme) -> Scene {
    let mut s = ball(0.03);
    s.time.scheme = scheme;
    s.initial.velocity.z = -1.0;
    s.initial.angular_velocity = DVec3::new(2.0, 6.0, -4.0);
    s.object.pose.translation.z = -0.004;
    s.time.steps = 4;
    s
}

/// A ball in a clamp that moves and turns.
fn shaken(scheme: &'static Scheme) -> Scene {
    let mut s = held(0.03);
    s.time.scheme = scheme;
    s.time.steps = 3;
    s
}

#[test]
fn states_of_every_scheme_agree_and_one_percent_of_damping_or_another_scheme_shows() {
    let Some(gpu) = device(None) else { return };
    for scheme in schemes() {
        // As in `forward`; two solves a step, combinations of states and a blow make a few times the rounding.
        for (make, close) in [(thrown as fn(&'static Scheme) -> Scene, 1e-6), (shaken, 1e-7)] {
            let plan = plan(&make(scheme));
            let right = moments(CpuBackend, &plan, &plan.theta);
            let differs = |plan: &Plan, theta: &[f64]| apart(plan, &moments(GpuBackend::on(gpu.clone()), plan, theta), &right);
            let own = differs(&plan, &plan.theta);
            println!("{}: {own:?}", scheme.name);
            assert!(own.iter().all(|d| *d < close), "{}: {own:?}", scheme.name);
            let mut wrong = plan.theta.clone();
            wrong[plan.layout.index(ParamKey::StiffnessDamping)] *= 1.01;
            let seen = differs(&plan, &wrong);
            println!("{}: 1 % of damping {seen:?}", scheme.name);
            assert!(seen.iter().any(|d| *d > close), "{}: 1 % of damping is not seen: {seen:?}", scheme.name);
            for other in ALL.iter().filter(|s| *s != scheme) {
                let seen = differs(&super::scenes::plan(&make(other)), &plan.theta);
                assert!(seen.iter().any(|d| *d > close), "{} for {} is not seen: {seen:?}", other.name, scheme.name);
            }
        }
    }
}

#[test]
fn evaluations_by_every_scheme_agree() {
    for scheme in schemes() {
        println!("{}", scheme.name);
        let mut s = thrown(scheme);
        s.time.steps = 2;
        s.observation = watched();
        with(&mut s, "structural-damping", &[("loss", &[1.0])]);
        with(&mut s, "contact-dissipation", &[("dissipation", &[2.0])]);
        // A solve to 2e-6 of the forces, of which each of four kinds moves the body by its 1 cm a step, leaves 8e-8 m if all nodes share it, and
        // up to √114 times that, 9e-7 m, in one of its 114. That is 3e-4 of the noise, 3 mm; there are two steps.
        compare_within(&seen(&s), 6e-4);
    }
}

#[test]
fn evaluations_of_a_held_body_by_both_kinds_of_solves_agree() {
    // Its first step is one of TR-BDF2, the second of BDF2.
    let mut s = shaken(find("bdf2").unwrap_or_else(|| panic!("it is there")));
    s.time.steps = 2;
    s.observation = watched();
    with(&mut s, "creep", &[("fraction", &[0.6]), ("time", &[0.005])]);
    compare_within(&seen(&s), 3e-4);
}
