//! What benchmarks are told: every dispatch is counted, the kernels that are timed are those that run; an evaluation waits once.

use super::effects::with;
use super::products::crowded;
use super::scenes::{ball, device, own_device, plan, spread};
use crate::costs::rollout_tests::{seen, watched};
use crate::device::Maker as _;
use crate::device::pipelines::{PASSES, pass};
use crate::device::recorder::{Args, QUERIES, Recorder, Size};
use crate::{GpuBackend, Product, Tuning};
use palpate_engine::{Backend, Direction, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::scene::Scene;
use std::collections::{BTreeSet, HashMap};
use std::sync::atomic::Ordering;

#[test]
fn every_dispatch_of_a_long_submission_is_timed() {
    let Some(gpu) = device(None) else { return };
    if gpu.tick().is_none() {
        return;
    }
    let sums = gpu.buffer("sums", (16 * PASSES[pass::PROBE_LANES].width).into()).unwrap_or_else(|e| panic!("{e}"));
    // Ends of a set of queries, and more than two of them.
    for count in [1, QUERIES / 2, QUERIES / 2 + 1, QUERIES + 3] {
        let (world, mut groups, mut times) = (HashMap::new(), HashMap::new(), HashMap::new());
        let mut r = Recorder::new(&gpu, &world, &mut groups, true);
        for _ in 0..count {
            r.run(pass::PROBE_LANES, &[("sums", &sums)], Size::All { members: 1, groups: 1 }, Args::default());
        }
        r.submit(&mut times);
        let time = times.get("probe_lanes").cloned().unwrap_or_default();
        println!("{count} dispatches: {time:?}");
        assert_eq!(time.count, u64::from(count));
        // A dispatch cannot take longer than a second, nor a thousand of them no time.
        assert!(time.nanoseconds < 1e9 * f64::from(count) && (count < 1000 || time.nanoseconds > 0.0), "{time:?}");
    }
}

#[test]
fn conjugate_gradients_are_timed_by_whole_iterations_of_the_kernels_that_run() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&crowded());
    let theta = ParamBatch::from_rows(&spread(&plan, 2));
    let one = Tuning { many_from: usize::MAX, product: None, crew: 0 };
    let many = [Product::Matrix, Product::Free].map(|p| Tuning { many_from: 0, product: Some(p), crew: 0 });
    for tuning in [one, many[0], many[1]] {
        let backend = GpuBackend::on(gpu.clone()).tuned(tuning);
        let mut world = backend.build(&plan, 2).unwrap_or_else(|e| panic!("{e}"));
        backend.set_params(&mut world, &theta);
        world.time_passes(true);
        let speed = world.cg_speed().unwrap_or_else(|e| panic!("{e}"));
        let ran: HashMap<&str, u64> = world.pass_times().into_iter().map(|(name, t)| (name, t.count)).collect();
        println!("{speed:?}");
        assert_eq!(speed.many, tuning.many_from == 0);
        let chunk = world.geometry.shape.chunk as usize;
        // One workgroup may come to the end of single precision before that of its chunk.
        let count = if speed.many { 16..=16 } else { 40..=chunk };
        assert!(count.contains(&speed.iterations), "{} of {chunk} iterations ran", speed.iterations);
        assert_eq!(speed.products.len(), if speed.many { 2 } else { 0 });
        if gpu.tick().is_some() {
            assert_eq!([ran.contains_key("iterate_cg"), ran.contains_key("advance_cg")], [!speed.many, speed.many], "{ran:?}");
        }
        // The values of the blocks are read, and at most ten times as much moves in all.
        let values = 2.0 * 36.0 * f64::from(world.geometry.shape.blocks);
        assert!(speed.iteration.bytes > 0.1 * values && speed.iteration.bytes < 10.0 * values, "{speed:?}");
        for (product, traffic) in &speed.products {
            assert!(traffic.seconds > 0.0 && traffic.bytes > 0.0);
            assert!(*product != speed.product || traffic.bytes < speed.iteration.bytes);
        }
        // The world is as good as before.
        let mut tally = backend.new_tally(&world, &Request::default());
        let mut state = backend.new_state(&world);
        backend.start(&mut world, &mut state, &mut tally);
        assert!(backend.read(&world, &tally).iter().all(|e| e.failure.is_none()));
    }
}

/// Everything is recorded at once here. A graphics processor is given little work first and waits once for each level of effort that
/// an evaluation needs (`effort.rs`, `tests/efforts.rs`).
#[test]
fn an_evaluation_waits_once() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 2;
    scene.observation = watched();
    let plan = seen(&scene);
    let backend = GpuBackend::on(gpu.clone()).levels(&[]);
    let mut rollout = Rollout::new(backend, &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let request = Request { gradient: Wanted::All, sensitivities: vec![0, 1] };
    let before = gpu.waits.load(Ordering::Relaxed);
    let all = rollout.evaluate(&ParamBatch::from_rows(&spread(&plan, 2)), &request);
    assert!(all.iter().all(|e| e.failure.is_none() && e.matched > 100 && e.curvature.is_some()));
    assert_eq!(gpu.waits.load(Ordering::Relaxed) - before, 1);
}

/// Passes that a step, its adjoint and its tangent dispatch, forward and back from a static start.
fn dispatched(backend: &GpuBackend, scene: &Scene) -> BTreeSet<&'static str> {
    let plan = plan(scene);
    let mut world = backend.build(&plan, 1).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    world.time_passes(true);
    let all: Vec<usize> = (0..plan.layout.len()).collect();
    let mut tally = backend.new_tally(&world, &Request { gradient: Wanted::All, sensitivities: all.to_vec() });
    let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
    let [mut tangent, mut tangent_next] = [0; 2].map(|_| backend.new_tangent(&world, &Direction::parameters(&all)));
    let [adj, mut adj_now] = [0; 2].map(|_| backend.new_adjoint(&world));
    backend.start(&mut world, &mut now, &mut tally);
    backend.start_tangent(&mut world, &now, &mut tangent, &mut tally);
    backend.step(&mut world, &plan.clock.stages()[0], &[&now], &mut next, &mut tally);
    backend.step_tangent(&mut world, &plan.clock.stages()[0], &[&now], &next, &[&tangent], &mut tangent_next, &mut tally);
    backend.step_adjoint(
        &mut world,
        &plan.clock.stages()[0],
        &[&now],
        &next,
        &adj,
        std::slice::from_mut(&mut adj_now),
        &mut tally,
    );
    backend.start_adjoint(&mut world, &now, &adj_now, &mut tally);
    let failures: Vec<_> = backend.read(&world, &tally).into_iter().filter_map(|e| e.failure).collect();
    assert!(failures.is_empty(), "{failures:?}");
    world.pass_times().into_iter().map(|t| t.0).collect()
}

#[test]
fn scenes_without_effects_dispatch_none_of_their_passes() {
    let Some(gpu) = device(None) else { return };
    if gpu.tick().is_none() {
        return;
    }
    let backend = GpuBackend::on(gpu);
    // The scene's body is of cells.
    let of_laws = |p: &str| p.ends_with("_laws") && !p.ends_with("_tet_laws");
    let of_effects = |p: &&str| ["press_nodes", "press_patches"].contains(p) || of_laws(p);
    let mut scene = crowded();
    let plain = dispatched(&backend, &scene);
    assert!(plain.contains("hold_cells") && plain.contains("step_back"), "{plain:?}");
    assert_eq!(plain.iter().filter(|p| of_effects(p)).count(), 0, "{plain:?}");
    with(&mut scene, "uniform-force", &[("force", &[100.0, 0.0, 0.0])]);
    with(&mut scene, "coulomb-friction", &[("coefficient", &[0.3])]);
    with(&mut scene, "strain-stiffening", &[("coefficient", &[5.0])]);
    let full = dispatched(&backend, &scene);
    let known: Vec<&str> = PASSES.iter().map(|p| p.name).filter(of_effects).collect();
    assert!(known.len() >= 7 && known.iter().all(|p| full.contains(p)), "{known:?} {full:?}");
}
