//! Counts what steps come to on a graphics processor: iterations, dispatches, bytes. A software adapter counts as well as any.

use super::gpu::settled;
use super::model::Counts;
use super::report::Times;
use palpate_engine::{Backend, ParamBatch, Request, Wanted};
use palpate_gpu::{Dispatches, Gpu, GpuBackend, Product, Tuning, World};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use std::sync::Arc;

/// Which rollout is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ways {
    /// One whose dispatches are recorded sparingly, after one that learns how many are needed and one whose recording is timed.
    Settled,
    /// The first, which is given all that is allowed: how many dispatches are recorded and how long that takes says nothing, and is zero.
    Once,
}

/// Parameters of so many members, which differ as the starts of a fit do.
pub(super) fn members(plan: &Plan, count: usize) -> Vec<Vec<f64>> {
    let at = plan.layout.index(ParamKey::YoungsModulus);
    let row = |m: usize| {
        let mut row = plan.theta.clone();
        row[at] *= 1.0 + 0.01 * m as f64;
        row
    };
    (0..count).map(row).collect()
}

/// What the first steps come to where many workgroups share a solve, and where they stay for all its iterations: then one is counted in place of all,
/// which makes the same dispatches.
pub(super) fn count(
    gpu: &Arc<Gpu>,
    plan: &Plan,
    rows: &[Vec<f64>],
    steps: usize,
    ways: Ways,
    stay: bool,
) -> Result<Counts, String> {
    let tuning = Tuning { many_from: 0, product: Some(Product::Matrix), crew: u32::from(stay) };
    let mut backend = GpuBackend::on(gpu.clone()).tuned(tuning);
    if ways == Ways::Settled {
        backend = backend.sparing();
    }
    let mut world = backend.build(plan, rows.len()).map_err(|e| e.to_string())?;
    backend.set_params(&mut world, &ParamBatch::from_rows(rows));
    let stages = &plan.clock.stages()[..steps];
    let mut recording = Vec::new();
    if ways == Ways::Settled {
        settled(&backend, &mut world, stages, &[])?;
        recording = settled(&backend, &mut world, stages, &[])?.recording;
    }
    world.count_dispatches(true).map_err(|e| e.to_string())?;
    let counted = backend.rollout(&mut world, false, |world| counted(&backend, world, stages))?;
    let of_step = |x: f64| x / steps as f64;
    let mean = |k: usize| of_step(counted.iterations.iter().map(|i| f64::from(i[k])).sum());
    let [iteration, round] = world.bytes_of_iteration_and_round();
    let [newton, linear, adjoint] = [mean(0), mean(1), mean(2)];
    Ok(Counts {
        steps,
        newton,
        linear,
        adjoint,
        recorded: if ways == Ways::Settled { of_step(counted.dispatches.recorded as f64) } else { 0.0 },
        live: of_step(counted.dispatches.live as f64),
        meetings: if stay { 2.0 * linear } else { 0.0 },
        host: if recording.is_empty() { 0.0 } else { Times::of(recording).median },
        // A round more looks at the last trial.
        bytes: (newton + 1.0) * round + linear * iteration,
    })
}

/// Dispatches of steps forward, and iterations of each step and its adjoint: Newton's, those of conjugate gradients, and the derivative's.
struct Counted {
    dispatches: Dispatches,
    iterations: Vec<[u32; 3]>,
}

fn counted(backend: &GpuBackend, world: &mut World, stages: &[Stage]) -> Result<Counted, String> {
    let request = Request { gradient: Wanted::All, ..Request::default() };
    let mut tally = backend.new_tally(world, &request);
    let mut tape = vec![backend.new_state(world)];
    backend.start(world, &mut tape[0], &mut tally);
    let before = world.dispatches();
    let mut iterations = Vec::new();
    for (k, stage) in stages.iter().enumerate() {
        let mut next = backend.new_state(world);
        backend.step(world, stage, &[&tape[k]], &mut next, &mut tally);
        let own = world.iterations().map_err(|e| e.to_string())?;
        let most = |k: usize| own.iter().map(|n| n[k]).max().unwrap_or(0);
        iterations.push([most(0), most(1), 0]);
        tape.push(next);
    }
    let after = world.dispatches();
    let (mut adj, mut adj_now) = (backend.new_adjoint(world), backend.new_adjoint(world));
    for k in (0..stages.len()).rev() {
        backend.observe_adjoint(world, k, &tape[k], &tape[k + 1], &mut adj, &mut adj_now, &mut tally);
        let adj_past = std::slice::from_mut(&mut adj_now);
        backend.step_adjoint(world, &stages[k], &[&tape[k]], &tape[k + 1], &adj, adj_past, &mut tally);
        iterations[k][2] = world.derivative_iterations().map_err(|e| e.to_string())?.into_iter().max().unwrap_or(0);
        std::mem::swap(&mut adj, &mut adj_now);
        backend.clear_adjoint(&mut adj_now);
    }
    backend.read(world, &tally);
    let dispatches = Dispatches {
        recorded: after.recorded - before.recorded,
        live: after.live - before.live,
        workgroups: after.workgroups - before.workgroups,
    };
    Ok(Counted { dispatches, iterations })
}
