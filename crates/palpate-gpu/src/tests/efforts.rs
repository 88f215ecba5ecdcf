//! A rollout that is recorded with few dispatches, and computed again with more where that is not enough.

use super::products::crowded;
use super::scenes::{own_device, plan, spread};
use crate::{GpuBackend, Product, Tuning};
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;

/// Rounds, iterations, those of a derivative: too few rounds, too few iterations of a derivative, enough for the body of these tests.
const SPARING: &[(usize, u32, u32)] = &[(1, 16, 16), (20, 16, 16), (30, 48, 1024)];

#[test]
fn few_dispatches_bring_the_same_bits_as_all_and_more_follow_where_they_are_needed() {
    let Some(gpu) = own_device() else { return };
    let plan = plan(&crowded());
    let theta = ParamBatch::from_rows(&spread(&plan, 3));
    let request = Request { gradient: Wanted::All, sensitivities: vec![0, 1, 5] };
    for many_from in [0, usize::MAX] {
        let backend = GpuBackend::on(gpu.clone()).tuned(Tuning { many_from, product: Some(Product::Matrix), crew: 0 });
        let run = |levels: &'static [(usize, u32, u32)]| {
            let mut rollout = Rollout::new(backend.clone().levels(levels), &plan, 3).unwrap_or_else(|e| panic!("{e}"));
            [0; 2].map(|_| {
                let before = gpu.waits.load(Ordering::Relaxed);
                let all = rollout.evaluate(&theta, &request);
                (gpu.waits.load(Ordering::Relaxed) - before, all)
            })
        };
        let [first, second] = run(SPARING);
        let [(waits, all), _] = run(&[]);
        assert!(all.iter().all(|e| e.failure.is_none()));
        assert_eq!(waits, 1);
        assert!(first.1 == all && second.1 == all);
        // One workgroup makes more iterations in a dispatch than the first levels give; the second rollout knows what the first found out.
        let rollouts = 2;
        assert_eq!((first.0, second.0), (rollouts, 1));
    }
}

#[test]
fn a_member_that_comes_to_nothing_fails_as_with_all_dispatches() {
    let Some(gpu) = own_device() else { return };
    let mut scene = crowded();
    // Fewer iterations than a step of it takes.
    scene.solver.newton_iterations = 1;
    let plan = plan(&scene);
    let theta = ParamBatch::from_rows(&spread(&plan, 2));
    let failures = [SPARING, &[]].map(|levels| {
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()).levels(levels), &plan, 2).unwrap_or_else(|e| panic!("{e}"));
        rollout.evaluate(&theta, &Request::default()).into_iter().map(|e| e.failure).collect::<Vec<_>>()
    });
    assert!(failures[0].iter().all(|f| f.is_some()));
    assert_eq!(failures[0], failures[1]);
}

#[test]
fn a_rollout_that_is_looked_at_has_all_dispatches_from_the_start() {
    let Some(gpu) = own_device() else { return };
    let plan = plan(&crowded());
    let seen = [SPARING, &[]].map(|levels| {
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()).levels(levels), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let mut states = Vec::new();
        let end = rollout.visit(&plan.theta, |_, s, _| {
            states.push(s.displacement);
            ControlFlow::Continue(())
        });
        assert!(end.is_ok());
        states
    });
    assert_eq!(seen[0], seen[1]);
}
