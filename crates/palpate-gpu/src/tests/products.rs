//! Conjugate gradients by many workgroups, with a matrix and without, against one workgroup's and against the CPU.

use super::faults::{BALANCE, Fault, faulty};
use super::forward::{CLOSE, off, states};
use super::host::Desk;
use super::scenes::{ball, device, device_of, held, own_device, plan, solving_part, spread};
use crate::costs::rollout_tests::{differences, seen, watched};
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::solving::IMAGE;
use crate::passes::Passes;
use crate::solve;
use crate::world::World;
use crate::{Gpu, GpuBackend, GpuError, Product, Tuning};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::plan::Plan;
use palpate_model::scene::{Plane, Scene};
use std::sync::Arc;

const BOTH: [Product; 2] = [Product::Matrix, Product::Free];

fn many(product: Product) -> Tuning {
    Tuning { many_from: 0, product: Some(product), crew: 0 }
}

/// Everything at once: a clamp, two planes that press, a point mass, a ghost penalty.
pub(super) fn crowded() -> Scene {
    let mut scene = held(0.03);
    scene.solver.ghost = 0.5;
    scene.planes[0].point.z = 0.004;
    scene.planes.push(Plane { point: glam::DVec3::new(-0.038, 0.0, 0.0), normal: glam::DVec3::X, stiffness: Some(1e6) });
    scene.time.steps = 2;
    // Contact acts along the way of a step.
    scene.time.theta = 0.55;
    scene
}

/// A p of every node, by a product, with p what the preconditioner makes of a wave; after one step with these parameters.
fn product(backend: &GpuBackend, world: &mut World, theta: &[Vec<f64>], product: Product) -> Vec<f64> {
    backend.set_params(world, &ParamBatch::from_rows(theta));
    let mut tally = backend.new_tally(world, &Request::default());
    let (mut now, mut next) = (backend.new_state(world), backend.new_state(world));
    backend.start(world, &mut now, &mut tally);
    let stage = world.plan.clock.stages().swap_remove(0);
    backend.step(world, &stage, &[&now], &mut next, &mut tally);
    let count = world.plan.body.nodes.len() * world.members();
    let wave: Vec<[f32; 4]> =
        (0..count).map(|i| [(i as f32).sin(), (2.0 * i as f32).cos(), (3.0 * i as f32).sin(), 0.0]).collect();
    world.gpu.queue.write_buffer(&world.buffers["rhs"], 0, bytemuck::cast_slice(&wave));
    let world = &*world;
    world.record(|r| {
        let mut s = Passes::new(world, r, Some(0), &now, &next, &tally);
        s.linearise();
        s.begin_column(0);
        s.list();
        s.begin_cg(asks::FOR_DERIVATIVE);
        s.precondition();
        s.multiply(product, 0);
    });
    solving_part(world, IMAGE).iter().flat_map(|v| [v[0], v[1], v[2]]).map(f64::from).collect()
}

/// Difference of two vectors over the size of the second.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(x, y)| x - y)) / norm(&mut b.iter().copied())
}

#[test]
fn products_with_and_without_a_matrix_agree_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu).tuned(many(Product::Matrix));
    let mut scene = crowded();
    // Strong enough to show beside inertia.
    scene.material.mass_damping = 100.0;
    scene.masses.iter_mut().for_each(|m| m.mass = 0.1);
    let plan = plan(&scene);
    let theta = spread(&plan, 2);
    let mut world = backend.build(&plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let right = product(&backend, &mut world, &theta, Product::Matrix);
    assert!(right.iter().all(|x| x.is_finite()) && right.iter().any(|x| *x != 0.0));
    let free = product(&backend, &mut world, &theta, Product::Free);
    // Sums of some hundred terms of both signs in another order: 1e-6 of their size.
    let d = apart(&free, &right);
    println!("products differ by {d:.1e}");
    assert!(d < 1e-5, "{d:.1e}");
    for fault in BALANCE {
        let name = fault.0;
        let (wrong, theta) = faulty(&plan, &theta, &fault);
        let mut world = backend.build(&wrong, 2).unwrap_or_else(|e| panic!("{e}"));
        let d = apart(&product(&backend, &mut world, &theta, Product::Free), &right);
        println!("1 % of {name} makes {d:.1e}");
        assert!(d > 3e-5, "1 % of {name} makes {d:.1e}");
    }
}

#[test]
fn steps_by_many_workgroups_are_as_close_to_the_cpu_as_those_by_one() {
    let Some(gpu) = device(None) else { return };
    for scene in [ball(0.03), crowded()] {
        let plan = plan(&scene);
        let theta = spread(&plan, 2);
        let exact = states(&CpuBackend, &plan, &theta).0;
        let worst = |tuning: Tuning, fault: Option<&Fault>| {
            let backend = GpuBackend::on(gpu.clone()).tuned(tuning);
            let (plan, theta) = fault.map_or_else(|| (plan.clone(), theta.clone()), |f| faulty(&plan, &theta, f));
            let (found, evaluations) = states(&backend, &plan, &theta);
            assert!(evaluations.iter().all(|e| e.failure.is_none()), "{tuning:?}: {:?}", evaluations[0].failure);
            assert!(fault.is_some() || found == states(&backend, &plan, &theta).0, "{tuning:?}: two runs differ");
            found
                .iter()
                .flatten()
                .zip(exact.iter().flatten())
                .fold([0.0f64; 2], |w, (a, b)| [w[0].max(off(&a.0, &b.0)), w[1].max(off(&a.1, &b.1))])
        };
        let one = worst(Tuning { many_from: usize::MAX, product: None, crew: 0 }, None);
        for product in BOTH {
            let d = worst(many(product), None);
            println!("{product:?}: {d:?}, one workgroup {one:?}");
            // Both end at Newton's accuracy; where in it is chance.
            assert!(d[0] < CLOSE[0].max(3.0 * one[0]) && d[1] < CLOSE[1].max(3.0 * one[1]), "{product:?}: {d:?}, one: {one:?}");
            // In no case more than a thirtieth of what a percent of stiffness makes (3e-4 m, 9e-3 m/s in `faults`).
            assert!(d[0] < 2e-6 && d[1] < 3e-4, "{product:?}: {d:?}");
            for fault in &BALANCE[..3] {
                let d = worst(many(product), Some(fault));
                println!("{product:?}: 1 % of {}: {d:?}", fault.0);
                assert!(d[0] > 2e-6 || d[1] > 3e-4, "{product:?}: 1 % of {} was not seen: {d:?}", fault.0);
            }
        }
    }
}

#[test]
fn gradients_by_many_workgroups_agree_with_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 3;
    scene.observation = watched();
    let plan = seen(&scene);
    let request = Request { gradient: Wanted::All, sensitivities: vec![0, 1, 2] };
    let theta = &spread(&plan, 2)[1..];
    let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&ParamBatch::from_rows(theta), &request).remove(0);
    for product in BOTH {
        let off = |plan: &Plan, theta: &[Vec<f64>]| {
            let backend = GpuBackend::on(gpu.clone()).tuned(many(product));
            let mut rollout = Rollout::new(backend, plan, 1).unwrap_or_else(|e| panic!("{e}"));
            let found = rollout.evaluate(&ParamBatch::from_rows(theta), &request).remove(0);
            differences(&found, &right, &request.sensitivities)
        };
        assert!(off(&plan, theta).is_empty(), "{product:?}: {:?}", off(&plan, theta));
        for fault in &BALANCE[..3] {
            let (wrong, theta) = faulty(&plan, theta, fault);
            let seen = off(&wrong, &theta);
            println!("{product:?}: 1 % of {}: {seen:?}", fault.0);
            assert!(seen.iter().any(|s| s.starts_with("gradient")), "{product:?}: 1 % of {} was not seen", fault.0);
        }
    }
}

/// The only note of a desk: its key and what is written.
fn only_note(desk: &Desk, gpu: &Gpu) -> (String, String) {
    let notes: Vec<_> = desk.notes().into_iter().collect();
    let [(key, what)] = &notes[..] else { panic!("{notes:?}") };
    assert!(key.contains(&gpu.name) && key.contains(&gpu.driver), "{key}");
    (key.clone(), what.clone())
}

#[test]
fn a_measurement_chooses_a_product_for_large_bodies_and_keeps_it() {
    let desk = Arc::<Desk>::default();
    let Some(gpu) = device_of(desk.clone()) else { return };
    let plan = plan(&ball(0.03));
    let mut world = World::new(gpu.clone(), &plan, 1, many(Product::Matrix)).unwrap_or_else(|e| panic!("{e}"));
    let chosen = solve::faster(&mut world).unwrap_or_else(|e| panic!("{e}"));
    // Another process finds what was measured, and does not measure: it would not come to the opposite.
    let (key, what) = only_note(&desk, &gpu);
    assert_eq!(what, chosen.name());
    let other = BOTH[usize::from(chosen == Product::Matrix)];
    desk.rewrite(&key, other.name());
    assert_eq!(solve::faster(&mut world), Ok(other));
    let small = GpuBackend::on(gpu).build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    assert!(world.many && !small.many);
}

#[test]
fn a_measurement_chooses_between_one_and_many_workgroups_and_keeps_it() {
    let desk = Arc::<Desk>::default();
    let Some(gpu) = device_of(desk.clone()) else { return };
    let plan = plan(&ball(0.03));
    let measured = || Tuning::measured(&gpu, &plan).unwrap_or_else(|e| panic!("{e}"));
    let chosen = measured();
    let (key, what) = only_note(&desk, &gpu);
    let names = ["many", "one"];
    let is_one = usize::from(chosen.many_from > 0);
    assert_eq!(what, names[is_one]);
    // Another process does as the first one did.
    desk.rewrite(&key, names[1 - is_one]);
    assert_eq!(usize::from(measured().many_from > 0), 1 - is_one);
    // A software adapter is not asked, and neither is one that was told.
    if gpu.is_software() {
        assert_eq!(Tuning::default().on_device(&gpu, &plan), Ok(Tuning::default()));
    }
    assert_eq!(many(Product::Free).on_device(&gpu, &plan), Ok(many(Product::Free)));
}

/// Another body than above: what this process has measured it remembers.
#[test]
fn without_a_clock_nothing_is_measured_and_the_plain_way_is_taken() {
    let Some(gpu) = own_device() else { return };
    let plan = plan(&ball(0.04));
    assert_eq!(Tuning::measured(&gpu, &plan), Ok(Tuning::default()));
    let mut world =
        World::new(gpu.clone(), &plan, 1, Tuning { many_from: 0, product: None, crew: 0 }).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(solve::faster(&mut world), Ok(Product::Matrix));
    assert_eq!((gpu.copy_bandwidth().err(), world.cg_speed().err()), (Some(GpuError::NoClock), Some(GpuError::NoClock)));
}
