//! Predicted device memory against what is really made.

use super::scenes::{ball, held, own_device, plan};
use crate::observe::rollout_tests::{seen, watched};
use crate::{Gpu, GpuBackend, memory};
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout};
use palpate_model::effects::{self, Effect};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use std::sync::Arc;

fn check(gpu: &Arc<Gpu>, plan: &Plan, members: usize, request: &Request) {
    let before = gpu.made();
    let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), plan, members).unwrap_or_else(|e| panic!("{e}"));
    let nu = plan.layout.index(ParamKey::PoissonRatio);
    let rows: Vec<Vec<f64>> = (0..members)
        .map(|m| {
            let mut row = plan.theta.clone();
            row[nu] -= 0.01 * m as f64;
            row
        })
        .collect();
    let all = rollout.evaluate(&ParamBatch::from_rows(&rows), request);
    assert!(all.iter().all(|e| e.failure.is_none()), "{:?}", all[0].failure);
    let made = gpu.made() - before;
    let said = memory(plan, members, request).unwrap_or_else(|e| panic!("{e}"));
    let off = said.total() as f64 / made as f64 - 1.0;
    println!("{} members: {said:?}, {} predicted, {made} made: {:+.1} %", members, said.total(), 100.0 * off);
    assert!(off.abs() < 0.1, "{said:?} is not {made}");
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
            check(&gpu, &plan(&scene), members, &Request { gradient: h > 0.025, sensitivities: Vec::new() });
        }
    }
}

#[test]
fn predicted_memory_is_within_a_tenth_of_what_is_made() {
    let Some(gpu) = own_device() else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 3;
    scene.observation = watched();
    let all = Request { gradient: true, sensitivities: vec![0, 1, 2] };
    check(&gpu, &seen(&scene), 3, &all);
    scene.time.steps = 5;
    check(&gpu, &plan(&scene), 1, &Request { gradient: true, sensitivities: Vec::new() });
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
