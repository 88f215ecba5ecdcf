//! Displacements at a frame's instant, continued into the band: see_nodes and extend_band against the CPU.

use super::rollout_tests::{seen, watched};
use crate::GpuBackend;
use crate::tests::scenes::{ball, device};
use glam::DVec3;
use palpate_cpu::costs::{blend, matching};
use palpate_engine::{Backend, ParamBatch, Request};

/// Rounding of displacements of some centimetres in two parts, and of sums over 60 weights.
const TOLERANCE: f64 = 2e-6;

#[test]
fn displacements_in_the_band_are_those_of_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 2;
    scene.observation = watched();
    let plan = seen(&scene);
    let backend = GpuBackend::on(gpu.clone());
    let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &Request::default());
    let nodes = &plan.body.nodes;
    let states = [0.0, 1.0].map(|t| {
        let u: Vec<DVec3> =
            nodes.iter().map(|x| DVec3::new(0.02 + 0.3 * x.y, (30.0 * x.x).sin() * 0.01, t * 0.03 * x.z)).collect();
        let v: Vec<DVec3> = nodes.iter().map(|x| DVec3::new(0.2, x.x, 3.0 * x.y * t)).collect();
        let state = backend.new_state(&world);
        let zero = vec![DVec3::ZERO; u.len()];
        let all: Vec<[f32; 4]> =
            [&zero, &u, &v].into_iter().flatten().map(|v| [v.x as f32, v.y as f32, v.z as f32, 0.0]).collect();
        gpu.queue.write_buffer(&state.0.buffer, 0, bytemuck::cast_slice(&all));
        (state, u, v)
    });
    backend.observe(&world, 0, &states[0].0, &states[1].0, &mut tally);
    let (all, slots) = (world.observer.sight.extended as usize, world.observer.sight.slots as usize);
    let found: Vec<[f32; 4]> = gpu.download(&world.observer.buffers["seen"], 2 * slots * all).unwrap_or_else(|e| panic!("{e}"));
    let found: Vec<DVec3> = (0..all)
        .map(|i| [i, slots * all + i].map(|k| DVec3::new(found[k][0].into(), found[k][1].into(), found[k][2].into())))
        .map(|[a, b]| a + b)
        .collect();
    // The last frame of the step is what is left in the buffers.
    let last = world.observer.rounds(0).last().map(|r| world.observer.agenda.looks[r.first].value);
    let value = last.unwrap_or_else(|| panic!("the step has a frame")).map(f64::from);
    let u = blend(&value, [&states[0].1, &states[0].2, &states[1].1, &states[1].2]);
    let right = matching::extend(&plan.body, &u);
    assert!(right.len() == all && all > nodes.len());
    let size = right.iter().map(|v| v.length()).fold(0.0, f64::max);
    let apart = |right: &[DVec3]| found.iter().zip(right).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max) / size;
    println!("{:.1e}", apart(&right));
    assert!(apart(&right) < TOLERANCE, "{:.1e}", apart(&right));
    let wrong = matching::extend(&plan.body, &u.iter().map(|u| DVec3::new(u.x, 1.01 * u.y, u.z)).collect::<Vec<_>>());
    assert!(apart(&wrong) > TOLERANCE);
}
