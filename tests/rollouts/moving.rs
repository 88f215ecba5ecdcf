//! Rigid things that move as a file says, obstacles and jets: their derivatives, in motions and in sequences of equilibria.

use super::gradients::{ball, check_some, observed};
use super::quasi_static::{beam, planned, tracks};
use glam::{DAffine3, DQuat, DVec3};
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{Effect, find, obstacle};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::params::ParamKey;
use palpate_model::scene::*;
use palpate_model::shape::{Placed, Shape};
use std::sync::Arc;

/// An obstacle of a shape, with its stiffness and offset.
pub(super) fn pressed(shape: Analytic, motion: RigidMotion, values: [f64; 4]) -> Effect {
    let shape = Placed::new(shape, DAffine3::IDENTITY);
    let (low, high) = shape.bounds();
    let spacing = (high - low).max_element() / 40.0;
    let moving = Moving::obstacle(&shape, spacing, motion);
    Effect {
        values: values.map(Some).to_vec(),
        moving: Some(Arc::new(moving)),
        ..Effect::absent(find(obstacle::KIND).expect("it is in the table"))
    }
}

/// Towards the ball of [`ball`] from the right, turning about the world's origin.
fn towards() -> RigidMotion {
    RigidMotion {
        times: vec![0.0, 0.03, 0.08],
        translations: vec![DVec3::new(0.086, 0.0, 0.06), DVec3::new(0.075, 0.002, 0.055), DVec3::new(0.045, 0.005, 0.03)],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_y(0.1), DQuat::from_rotation_y(0.3)],
    }
}

fn of_obstacle(key: ParamKey) -> bool {
    matches!(key, ParamKey::Effect { .. } | ParamKey::TimeStart | ParamKey::YoungsModulus)
}

#[test]
fn derivatives_by_an_obstacle_in_motion_are_exact() {
    // Contact on the new state alone, and along the way of every step.
    for theta in [0.6, 0.52] {
        let mut s = ball();
        s.planes.truncate(1);
        s.time = Time { step: 0.01, steps: 6, start: 0.002, ..Time::weighted(theta) };
        let shape = Analytic::Ball { radius: 0.03, center: DVec3::new(0.001, 0.002, 0.0) };
        s.effects = vec![pressed(shape, towards(), [4e6, 1e-4, -2e-4, 3e-4])];
        let plan = observed(&s, &[0.025, 0.0437, 0.06]);
        check_some(&plan, &format!("obstacle at {theta}"), of_obstacle);
    }
}

/// A jet from a nozzle that moves and turns.
pub(super) fn jet(from: DVec3, to: DVec3, axis: DVec3, thrust: f64) -> Effect {
    let motion = RigidMotion {
        times: vec![0.0, 0.05, 2.0],
        translations: vec![from, from.lerp(to, 0.4), to],
        rotations: vec![DQuat::from_rotation_z(0.05), DQuat::from_rotation_y(0.04), DQuat::from_rotation_x(0.1)],
    };
    let moving = Moving::nozzle(axis, motion);
    Effect {
        values: [thrust, 0.25, 0.001, -0.002, 0.0005].map(Some).to_vec(),
        moving: Some(Arc::new(moving)),
        ..Effect::absent(find("jet").expect("it is in the table"))
    }
}

#[test]
fn derivatives_by_a_jet_in_motion_are_exact() {
    let mut s = ball();
    s.planes.truncate(1);
    s.effects = vec![jet(DVec3::new(0.2, 0.0, 0.05), DVec3::new(0.2, 0.03, 0.02), -DVec3::X, 2.0)];
    let plan = observed(&s, &[0.025, 0.0437, 0.06]);
    check_some(&plan, "jet", of_obstacle);
}

#[test]
fn derivatives_of_an_equilibrium_under_a_jet_are_exact() {
    let mut s = beam();
    // It bends the beam by a fifth of its length, so that the force depends on the shape.
    // Askew, so that no face lies along it: there the force begins with its square, which spoils differences.
    let axis = DVec3::new(-0.2, -0.35, -1.0).normalize();
    s.effects = vec![jet(DVec3::new(0.12, 0.075, 0.2), DVec3::new(0.11, 0.08, 0.19), axis, 0.6)];
    let plan = planned(&s, tracks(&[0.3, 1.0]));
    let some = |key| matches!(key, ParamKey::Effect { .. } | ParamKey::YoungsModulus | ParamKey::PoissonRatio);
    check_some(&plan, "jet on a sequence", some);
}

#[test]
fn derivatives_by_an_obstacle_on_a_sequence_are_exact() {
    let mut s = beam();
    let motion = RigidMotion {
        times: vec![0.0, 2.0],
        translations: vec![DVec3::new(0.08, 0.0, 0.052), DVec3::new(0.085, 0.0, 0.035)],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_x(0.2)],
    };
    let rod = Analytic::Cylinder { radius: 0.015, height: 0.06, center: DVec3::new(0.0, 0.015, 0.0), axis: DVec3::Y };
    s.effects = vec![pressed(rod, motion, [3e8, 1e-4, 2e-4, -1e-4])];
    let plan = planned(&s, tracks(&[0.3, 1.0, 1.7]));
    let some = |key| matches!(key, ParamKey::Effect { .. } | ParamKey::YoungsModulus | ParamKey::PoissonRatio);
    check_some(&plan, "obstacle on a sequence", some);
}
