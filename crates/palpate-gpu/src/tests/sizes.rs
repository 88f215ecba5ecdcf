//! Sizes at which kernels go wrong: nodes and members around multiples of a workgroup, one cell, nothing to see, and evaluations
//! that must give the same bits twice.

use super::faults::{busy, but, check_states};
use super::forward::CLOSE;
use super::scenes::{ball, device, plan, spread};
use crate::GpuBackend;
use crate::costs::rollout_tests::{differences, seen, watched};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::scene::{Analytic, BodySource, Scene};

/// A block of so many cells of 3 cm, a little above the ground.
fn block(cells: [usize; 3]) -> Scene {
    let h = 0.03;
    let mut scene = ball(h);
    let max = DVec3::from_array(cells.map(|n| n as f64 * h));
    scene.object.source = BodySource::Analytic(Analytic::Box { min: DVec3::ZERO, max });
    scene.masses.clear();
    scene.time.steps = 2;
    scene
}

#[test]
fn nodes_around_a_workgroup_agree_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    // 63, 64, 66 nodes around a workgroup of 64; 256 and 260 around one of 256.
    for (cells, nodes) in [([2, 2, 6], 63), ([3, 3, 3], 64), ([1, 2, 10], 66), ([3, 7, 7], 256), ([1, 9, 12], 260)] {
        // A centimetre in the ground, so that everything acts at once.
        let mut scene = busy(block(cells));
        scene.planes[0].point.z = 0.01;
        if nodes > 100 {
            scene.time.steps = 1;
        }
        let plan = plan(&scene);
        assert_eq!(plan.body.nodes.len(), nodes);
        // Full cells have no ghosts, and there is no point mass.
        check_states(&gpu, &scene, &[plan.theta], CLOSE, &but(&["ghost penalty", "point mass"]));
    }
}

#[test]
fn members_around_a_workgroup_agree_with_the_cpu_and_with_themselves_alone_and_one_percent_of_the_last_shows() {
    let Some(gpu) = device(None) else { return };
    let mut scene = block([1, 1, 1]);
    scene.observation = watched();
    let plan = seen(&scene);
    let request = Request { gradient: Wanted::All, sensitivities: vec![plan.layout.index(ParamKey::YoungsModulus)] };
    let rows = spread(&plan, 65);
    let mut cpu = Rollout::new(CpuBackend, &plan, 65).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&ParamBatch::from_rows(&rows), &request);
    for members in [1, 63, 64, 65] {
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), &plan, members).unwrap_or_else(|e| panic!("{e}"));
        let found = rollout.evaluate(&ParamBatch::from_rows(&rows[..members]), &request);
        assert_eq!(found.len(), members);
        for (m, (a, b)) in found.iter().zip(&right).enumerate() {
            assert!(a.failure.is_none(), "{m} of {members}: {:?}", a.failure);
            let off = differences(a, b, &request.sensitivities);
            assert!(off.is_empty(), "{m} of {members}: {off:?}");
        }
        // The last member alone, and the whole batch again: the same bits.
        let mut alone = Rollout::new(GpuBackend::on(gpu.clone()), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let last = alone.evaluate(&ParamBatch::from_rows(&rows[members - 1..members]), &request);
        assert_eq!(last[0], found[members - 1], "the last of {members}");
        assert_eq!(rollout.evaluate(&ParamBatch::from_rows(&rows[..members]), &request), found, "{members} again");
        // One percent of the last member alone.
        for key in [ParamKey::Density, ParamKey::Gravity(2)] {
            let mut wrong = rows[..members].to_vec();
            wrong[members - 1][plan.layout.index(key)] *= 1.01;
            let wrong = rollout.evaluate(&ParamBatch::from_rows(&wrong), &request);
            let off = |m: usize| differences(&wrong[m], &right[m], &request.sensitivities);
            assert!((0..members - 1).all(|m| off(m).is_empty()), "{key:?} of another member");
            println!("{members} members, 1 % of {key:?} of the last: {:?}", off(members - 1));
            assert!(!off(members - 1).is_empty(), "1 % of {key:?} of the last of {members} was not seen");
        }
    }
}

#[test]
fn a_plan_that_nobody_watched_costs_nothing() {
    let Some(gpu) = device(None) else { return };
    let plan = plan(&block([1, 1, 1]));
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let request = Request { gradient: Wanted::All, sensitivities: vec![0] };
    for e in rollout.evaluate(&ParamBatch::from_rows(&spread(&plan, 2)), &request) {
        assert!(e.failure.is_none() && e.cost == 0.0 && e.gradient.iter().all(|g| *g == 0.0), "{e:?}");
    }
}
