//! Predicted device memory against what is really made.

use super::scenes::{ball, held, own_device, plan};
use crate::costs::rollout_tests::{seen, watched};
use crate::{Gpu, GpuBackend, Load, Product, Tuning, memory, world};
use palpate_engine::{Backend, Direction, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::{self, Effect};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use std::sync::Arc;

/// Members with different Poisson's ratios.
fn ratios(plan: &Plan, members: usize) -> ParamBatch {
    let nu = plan.layout.index(ParamKey::PoissonRatio);
    let rows: Vec<Vec<f64>> = (0..members)
        .map(|m| {
            let mut row = plan.theta.clone();
            row[nu] -= 0.01 * m as f64;
            row
        })
        .collect();
    ParamBatch::from_rows(&rows)
}

pub(super) fn check(gpu: &Arc<Gpu>, plan: &Plan, members: usize, request: &Request) {
    let before = (gpu.made(), gpu.allocated());
    let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), plan, members).unwrap_or_else(|e| panic!("{e}"));
    let all = rollout.evaluate(&ratios(plan, members), request);
    assert!(all.iter().all(|e| e.failure.is_none()), "{:?}", all[0].failure);
    compare(gpu, before, plan, members, request);
}

/// Waits until uploads have arrived, whose copies on the way are memory as well.
fn settle(gpu: &Gpu) {
    gpu.queue.submit([]);
    gpu.wait().unwrap_or_else(|e| panic!("{e}"));
}

/// The same of what an evaluation holds, made without computing anything.
fn check_unused(gpu: &Arc<Gpu>, plan: &Plan, members: usize, request: &Request) {
    settle(gpu);
    let before = (gpu.made(), gpu.allocated());
    // No measurement, whose buffers would be counted as well.
    let backend = GpuBackend::on(gpu.clone()).tuned(Tuning { product: Some(Product::Matrix), ..Tuning::default() });
    let mut world = backend.build(plan, members).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ratios(plan, members));
    let directions = &request.sensitivities;
    let _tally = backend.new_tally(&world, &Request { sensitivities: directions.to_vec(), ..Request::default() });
    let kept = if request.gradient.any() { plan.clock.steps + 1 } else { 2 };
    let _states: Vec<_> = (0..kept).map(|_| backend.new_state(&world)).collect();
    let _adjoints: Vec<_> = (0..if request.gradient.any() { 2 } else { 0 }).map(|_| backend.new_adjoint(&world)).collect();
    let _tangents: Vec<_> = [0; 2].iter().map(|_| backend.new_tangent(&world, &Direction::parameters(directions))).collect();
    settle(gpu);
    assert_eq!(gpu.take_trouble(), None);
    compare(gpu, before, plan, members, request);
}

/// What was predicted, and what was made and allocated since.
fn compare(gpu: &Arc<Gpu>, before: (u64, Option<u64>), plan: &Plan, members: usize, request: &Request) {
    let made = gpu.made() - before.0;
    // By the driver's own account, where it gives one.
    let held = gpu.allocated().zip(before.1).map(|(now, before)| now - before);
    let load = Load { members, ratios: members, request, room: gpu.largest_buffer() };
    let said = memory(plan, &load).unwrap_or_else(|e| panic!("{e}"));
    for real in [Some(made), held].into_iter().flatten() {
        let off = said.total() as f64 / real as f64 - 1.0;
        println!("{} members: {said:?}, {} predicted, {real} made: {:+.1} %", members, said.total(), 100.0 * off);
        assert!(off.abs() < 0.1, "{said:?} is not {real}");
    }
}

/// On a device whose buffers are a little smaller than the largest one foreseen nothing is computed; on one with just that, it is.
#[test]
fn the_largest_buffer_is_foreseen() {
    let Some(mut gpu) = own_device() else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 1;
    let plan = plan(&scene);
    let request = Request::default();
    for members in [1, 5] {
        let largest = memory(&plan, &Load { members, ratios: 1, request: &request, room: u64::MAX });
        let largest = largest.unwrap_or_else(|e| panic!("{e}")).largest;
        for (room, fits) in [(largest, true), (largest - 1, false)] {
            Arc::get_mut(&mut gpu).unwrap_or_else(|| panic!("the device is not alone")).largest = room;
            let rows = ParamBatch::from_rows(&vec![plan.theta.clone(); members]);
            let words = match Rollout::new(GpuBackend::on(gpu.clone()), &plan, members) {
                Ok(mut rollout) => rollout.evaluate(&rows, &request)[0].failure.as_ref().map(ToString::to_string),
                Err(e) => Some(e.to_string()),
            };
            assert_eq!(words.is_none(), fits, "{members} members, {room} B: {words:?}");
            assert!(words.is_none_or(|w| w.contains("max_storage_buffer_binding_size") && w.contains("--batch")));
        }
    }
}

#[test]
fn two_sizes_alone_and_in_batches_of_eight() {
    let Some(gpu) = own_device() else { return };
    for h in [0.03, 0.02] {
        let mut scene = ball(h);
        scene.time.steps = 1;
        let mut friction = Effect::absent(0);
        friction.values[0] = Some(0.3);
        scene.effects.push(friction);
        for members in [1, 8] {
            check(
                &gpu,
                &plan(&scene),
                members,
                &Request { gradient: if h > 0.025 { Wanted::All } else { Wanted::Nothing }, sensitivities: Vec::new() },
            );
        }
    }
}

#[test]
fn large_bodies_and_batches_are_foreseen() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.005);
    scene.time.steps = 2;
    let large = plan(&scene);
    assert!(large.body.nodes.len() >= world::MANY, "{}", large.body.nodes.len());
    check_unused(&gpu, &large, 1, &Request { gradient: Wanted::All, sensitivities: vec![0] });
    let mut scene = ball(0.02);
    scene.time.steps = 4;
    scene.observation = watched();
    let small = seen(&scene);
    for request in
        [Request { gradient: Wanted::All, ..Request::default() }, Request { gradient: Wanted::Nothing, sensitivities: vec![0] }]
    {
        check_unused(&gpu, &small, 64, &request);
    }
}

#[test]
fn predicted_memory_is_within_a_tenth_of_what_is_made() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 3;
    scene.observation = watched();
    let all = Request { gradient: Wanted::All, sensitivities: vec![0, 1, 2] };
    check(&gpu, &seen(&scene), 3, &all);
    scene.time.steps = 5;
    check(&gpu, &plan(&scene), 1, &Request { gradient: Wanted::All, sensitivities: Vec::new() });
    scene.time.scheme = palpate_model::plan::scheme::find("bdf2").unwrap_or_else(|| panic!("it is there"));
    check(&gpu, &plan(&scene), 2, &all);
    let mut held = held(0.03);
    held.time.steps = 1;
    // What effects keep per node, cell and clamp.
    for kind in ["rest-shape", "compliant-clamp", "clamp-slip", "transverse-anisotropy"] {
        let mut effect = Effect::absent(effects::find(kind).unwrap_or_else(|| panic!("{kind}")));
        effect.values[0] = Some(1e-3);
        held.effects.push(effect);
    }
    check(&gpu, &plan(&held), 2, &Request::default());
}
