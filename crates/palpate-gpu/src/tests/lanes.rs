//! Subgroups and workgroup memory: whole evaluations have the same bits; what the probe of subgroups says decides.

use super::effects::with;
use super::products::crowded;
use super::scenes::device;
use crate::costs::rollout_tests::{seen, watched};
use crate::device::GpuError;
use crate::device::{Lanes, lanes_for};
use crate::{GpuBackend, Tuning};
use palpate_engine::{Evaluate, Linearised, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;

/// Clamps, planes, a point mass and a ghost penalty; laws of points and of cells, a shape of its own, an uneven material.
fn scene() -> Scene {
    let mut s = crowded();
    s.observation = watched();
    with(&mut s, "strain-stiffening", &[("coefficient", &[15.0])]);
    with(&mut s, "structural-damping", &[("loss", &[1.0])]);
    with(&mut s, "coulomb-friction", &[("coefficient", &[0.5])]);
    with(&mut s, "uniform-force", &[("force", &[1000.0, -500.0, 300.0])]);
    with(&mut s, "rest-shape", &[("stretch", &[0.04, -0.02, 0.03])]);
    with(&mut s, "compliant-clamp", &[("layer", &[0.004])]);
    with(&mut s, "stiffness-gradient", &[("slope", &[6.0, 2.0, -4.0])]);
    s
}

/// Everything that is computed of two members: costs, gradients and Gauss–Newton matrices, and every residual with its derivatives.
fn everything(plan: &Plan, lanes: Lanes, tuning: Tuning) -> Option<(Vec<palpate_engine::Evaluation>, Linearised)> {
    let own = |k: &ParamKey| matches!(k, ParamKey::Effect { slot: 0, .. } | ParamKey::YoungsModulus | ParamKey::PoissonRatio);
    let directions: Vec<usize> = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
    let mut rollout = Rollout::new(GpuBackend::on(device(Some(lanes))?).tuned(tuning), plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let mut other = plan.theta.clone();
    other[plan.layout.index(ParamKey::YoungsModulus)] *= 1.2;
    let rows = ParamBatch::from_rows(&[plan.theta.clone(), other.clone()]);
    let all = rollout.evaluate(&rows, &Request { gradient: Wanted::All, sensitivities: directions.clone() });
    let single = rollout.linearise(&other, &directions).unwrap_or_else(|e| panic!("{e}"));
    Some((all, single))
}

#[test]
fn evaluations_have_the_same_bits_with_subgroups_and_with_workgroup_memory() {
    // Without any adapter this is where a test that requires one ends.
    let Some(_) = device(None) else { return };
    if !crate::adapters().iter().any(|a| a.subgroups) {
        println!("skipped: no adapter has subgroups");
        return;
    }
    let plan = seen(&scene());
    for tuning in [Tuning::default(), Tuning { many_from: 0, product: None, crew: 0 }] {
        let Some((memory, rows)) = everything(&plan, Lanes::Memory, tuning) else { return };
        assert!(memory.iter().all(|e| e.failure.is_none() && e.matched > 100), "{:?}", memory[0].failure);
        let numbers = memory.iter().flat_map(|e| e.gradient.iter().chain(e.curvature.iter().flat_map(|c| &c.matrix)));
        assert!(numbers.clone().all(|x| x.is_finite()) && numbers.filter(|x| **x != 0.0).count() > 100);
        let Some((subgroups, others)) = everything(&plan, Lanes::Subgroup, tuning) else { return };
        assert!(memory == subgroups, "{memory:?} {subgroups:?}");
        assert!(rows.rows.residuals == others.rows.residuals && rows.rows.sensitivity == others.rows.sensitivity);
    }
}

#[test]
fn without_working_subgroups_there_is_workgroup_memory() {
    assert_eq!(lanes_for(Ok(true)), Ok(Lanes::Subgroup));
    assert_eq!(lanes_for(Ok(false)), Ok(Lanes::Memory));
    let shader = GpuError::Shader { pass: "probe_lanes".into(), message: "no such instruction".into() };
    let refused = GpuError::Refused { message: "no".into() };
    assert_eq!([shader, refused].map(|e| lanes_for(Err(e))), [Ok(Lanes::Memory), Ok(Lanes::Memory)]);
    let lost = GpuError::Lost { reason: "unplugged".into() };
    assert_eq!(lanes_for(Err(lost.clone())), Err(lost));
}
