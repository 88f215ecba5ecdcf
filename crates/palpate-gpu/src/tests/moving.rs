//! Obstacles and jets against the CPU: at every patch, at an equilibrium, and in batches.

use super::effects::compare;
use super::scenes::{ball, device, held, plan};
use crate::GpuBackend;
use crate::costs::rollout_tests::{seen, watched};
use glam::{DAffine3, DQuat, DVec3};
use palpate_engine::{Backend, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{Effect, find};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::params::ParamKey;
use palpate_model::scene::{Analytic, BodySource, Scene};
use palpate_model::shape::Placed;
use std::sync::Arc;

fn effect(kind: &str, values: &[f64], moving: Moving) -> Effect {
    let law = find(kind).unwrap_or_else(|| panic!("{kind}"));
    Effect { values: values.iter().copied().map(Some).collect(), moving: Some(Arc::new(moving)), ..Effect::absent(law) }
}

/// Beside the ball of `scenes`: another one that comes from the right and turns about a place beside its middle.
fn ball_beside(scene: &mut Scene) {
    let from = DVec3::new(0.083, 0.004, 0.047);
    let motion = RigidMotion {
        times: vec![0.04, 0.07, 0.1],
        translations: vec![from, from - DVec3::new(0.002, 0.0, 0.001), from - DVec3::new(0.006, 0.001, 0.004)],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_y(0.1), DQuat::from_rotation_z(0.3)],
    };
    let shape = Placed::new(Analytic::Ball { radius: 0.03, center: DVec3::new(0.001, 0.002, 0.0) }, DAffine3::IDENTITY);
    scene.effects.push(effect("obstacle", &[3e6, 1e-4, -2e-4, 3e-4], Moving::obstacle(&shape, 1.5e-3, motion)));
}

/// A nozzle on the left that moves and turns.
fn nozzle_beside(scene: &mut Scene) {
    let from = DVec3::new(-0.25, 0.01, 0.06);
    let motion = RigidMotion {
        times: vec![0.04, 0.1],
        translations: vec![from, from + DVec3::new(0.01, 0.02, -0.01)],
        rotations: vec![DQuat::from_rotation_z(0.05), DQuat::from_rotation_y(0.06)],
    };
    scene.effects.push(effect("jet", &[3.0, 0.25, 0.001, -0.002, 0.0005], Moving::nozzle(DVec3::X, motion)));
}

/// A ring between both, in steps along whose way contact acts. It is tilted: of what lies behind, the nozzle sees the upper part.
pub(super) fn beset() -> Scene {
    let mut s = ball(0.015);
    let axis = DVec3::new(-0.25, 0.0, 1.0).normalize();
    let ring = Analytic::Torus { major: 0.033, minor: 0.017, center: DVec3::new(0.003, 0.001, 0.051), axis };
    s.object.source = BodySource::Analytic(ring);
    s.masses[0].point = DVec3::new(0.0, 0.035, 0.06);
    s.planes[0].point.z = 0.02;
    s.time.steps = 3;
    s.time.theta = 0.55;
    s.observation = watched();
    ball_beside(&mut s);
    nozzle_beside(&mut s);
    s
}

#[test]
fn evaluations_beside_things_that_move_agree() {
    compare(&seen(&beset()));
}

#[test]
fn an_obstacle_at_an_equilibrium_agrees_and_a_jet_there_is_refused() {
    let Some(gpu) = device(None) else { return };
    let mut s = held(0.03);
    s.time.steps = 1;
    s.observation = watched();
    ball_beside(&mut s);
    compare(&seen(&s));
    nozzle_beside(&mut s);
    let refusal = GpuBackend::on(gpu).build(&plan(&s), 1).err().map(|e| e.to_string()).unwrap_or_default();
    let said = "the GPU backend does not support the effect \"jet\", which initial.state = \"static-equilibrium\" brings to rest with the body";
    assert!(refusal.starts_with(said), "{refusal}");
}

/// Members that differ in offsets, stiffness and thrust have poses and pictures of their own.
#[test]
fn members_have_the_bits_that_they_have_alone() {
    let Some(gpu) = device(None) else { return };
    let plan = seen(&beset());
    let row = |b: usize| {
        let moved = |(key, value): (&ParamKey, &f64)| match *key {
            ParamKey::Effect { slot: 0, .. } => value * (1.0 + 0.2 * b as f64),
            ParamKey::Effect { slot: 2, .. } => value + 1e-3 * b as f64,
            ParamKey::TimeStart => value + 2e-3 * b as f64,
            _ => *value,
        };
        plan.layout.keys.iter().zip(&plan.theta).map(moved).collect::<Vec<f64>>()
    };
    let rows: Vec<Vec<f64>> = (0..3).map(row).collect();
    let request = Request { gradient: Wanted::All, sensitivities: vec![0] };
    let evaluate = |rows: &[Vec<f64>]| {
        let backend = GpuBackend::on(gpu.clone());
        let mut rollout = Rollout::new(backend, &plan, rows.len()).unwrap_or_else(|e| panic!("{e}"));
        rollout.evaluate(&ParamBatch::from_rows(rows), &request)
    };
    let together = evaluate(&rows);
    assert!(together.iter().all(|e| e.failure.is_none()) && together[0].cost != together[2].cost);
    for (row, own) in rows.iter().zip(&together) {
        assert_eq!(evaluate(std::slice::from_ref(row))[0], *own);
    }
}
