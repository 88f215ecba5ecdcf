//! Start and steps against the CPU; the same bits twice; subgroups and workgroup memory give the same bits; batches give what
//! single members give.

use super::faults::{busy, but, check_states};
use super::scenes::{ball, device, held, plan, spread};
use crate::GpuBackend;
use crate::device::Lanes;
use glam::DVec3;
use palpate_engine::{Backend, Evaluation, FailureKind, ParamBatch, Request};
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, BodySource};

pub(super) type Moment = (Vec<DVec3>, Vec<DVec3>);

/// States of every member at every time, `[steps + 1][B]`, and what `read` says.
pub(super) fn states<B: Backend>(backend: &B, plan: &Plan, theta: &[Vec<f64>]) -> (Vec<Vec<Moment>>, Vec<Evaluation>) {
    let mut world = backend.build(plan, theta.len()).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(theta));
    let mut tally = backend.new_tally(&world, &Request::default());
    let mut now = backend.new_state(&world);
    backend.start(&mut world, &mut now, &mut tally);
    let all = |world: &B::World, s: &B::State| (0..theta.len()).map(|b| backend.read_state(world, s, b)).collect();
    let mut found = vec![all(&world, &now)];
    for k in 0..plan.clock.steps {
        let mut next = backend.new_state(&world);
        backend.step(&mut world, &plan.clock.stages()[k], &[&now], &mut next, &mut tally);
        found.push(all(&world, &next));
        now = next;
    }
    let evaluations = backend.read(&world, &tally);
    (found, evaluations)
}

pub(super) fn off(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

// Displacements: a Newton solve to 2e-6 of the forces, which strain the body by some 10 % of its 0.1 m, leaves up to 2e-8 m a
// step, rounding of u and v another 1e-8 m; six steps. Velocities: the same divided by the step of 0.01 s.
pub(super) const CLOSE: [f64; 2] = [5e-7, 1e-4];

#[test]
fn steps_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    // One falls onto the ground; the other is held, and what it presses on the ground with is little beside the rest.
    let mut falling = busy(ball(0.03));
    falling.initial.velocity.z = -1.5;
    // It hardly moves: damping must be strong to show.
    let mut hanging = busy(held(0.03));
    hanging.material.mass_damping = 50.0;
    for (scene, faults) in [(falling, but(&[])), (hanging, but(&["contact stiffness"]))] {
        check_states(&gpu, &scene, &[plan(&scene).theta], CLOSE, &faults);
    }
}

#[test]
fn batches_one_cell_and_two_planes_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    // One cell alone, a centimetre in the ground; an odd number of nodes with two planes; each with three members of different θ.
    let mut one = busy(ball(0.05));
    let (min, max) = (DVec3::new(0.0, 0.0, 0.05), DVec3::new(0.05, 0.05, 0.1));
    one.object.source = BodySource::Analytic(Analytic::Box { min, max });
    one.planes[0].point.z = 0.06;
    one.masses.clear();
    assert_eq!(plan(&one).body.cells().len(), 1);
    let mut two = busy(ball(0.027));
    two.initial.velocity.z = -1.5;
    two.planes.push(palpate_model::scene::Plane { point: DVec3::new(-0.045, 0.0, 0.0), normal: DVec3::X, stiffness: Some(1e6) });
    // A full cell has no ghosts.
    for (scene, faults) in [(one, but(&["ghost penalty", "point mass"])), (two, but(&[]))] {
        let theta = spread(&plan(&scene), 3);
        check_states(&gpu, &scene, &theta, CLOSE, &faults);
    }
}

#[test]
fn same_bits_twice_in_a_batch_and_in_both_variants() {
    let Some(gpu) = device(Some(Lanes::Memory)) else { return };
    let scene = held(0.03);
    let plan = plan(&scene);
    let theta = spread(&plan, 8);
    let first = states(&GpuBackend::on(gpu.clone()), &plan, &theta).0;
    assert!(first == states(&GpuBackend::on(gpu.clone()), &plan, &theta).0, "two runs differ");
    let alone = states(&GpuBackend::on(gpu), &plan, &theta[5..6]).0;
    assert!(first.iter().zip(&alone).all(|(a, b)| a[5] == b[0]), "a member alone differs from itself in a batch");
    if crate::adapters().iter().any(|a| a.subgroups) {
        let Some(gpu) = device(Some(Lanes::Subgroup)) else { return };
        assert!(first == states(&GpuBackend::on(gpu), &plan, &theta).0, "subgroups and workgroup memory differ");
    }
}

#[test]
fn a_member_that_fails_keeps_its_slot() {
    let Some(gpu) = device(None) else { return };
    let scene = ball(0.03);
    let plan = plan(&scene);
    let mut theta = spread(&plan, 3);
    // No stiffness at all; then gravity that throws the body out of the world.
    theta[0][0] = -1.0;
    theta[1][7] = 1e9;
    let (found, evaluations) = states(&GpuBackend::on(gpu.clone()), &plan, &theta);
    let kind = |m: usize| evaluations[m].failure.as_ref().map(|f| f.kind);
    assert_eq!(kind(0), Some(FailureKind::BadParameter));
    assert!(kind(1).is_some() && evaluations[1].cost.is_infinite());
    assert_eq!(kind(2), None);
    let alone = states(&GpuBackend::on(gpu), &plan, &theta[2..]).0;
    assert!(found.iter().zip(&alone).all(|(a, b)| a[2] == b[0]), "the well member is not disturbed");
}
