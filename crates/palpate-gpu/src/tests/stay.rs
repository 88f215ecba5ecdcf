//! Solves by workgroups that stay for all iterations. On a software adapter no two workgroups run at the same time: one alone does the work of all, and
//! its sums are those that any number of them would make.

use super::products::crowded;
use super::scenes::{device, own_device};
use crate::costs::rollout_tests::{assert_agreement, seen, watched};
use crate::device::probe::together;
use crate::{GpuBackend, Product, Tuning};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::ParamKey;

const DISPATCHES: Tuning = Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 };

#[test]
fn workgroups_that_stay_solve_as_dispatches_do_and_in_fewer_of_them() {
    let Some(gpu) = device(None) else { return };
    let mut scene = crowded();
    scene.observation = watched();
    let plan = seen(&scene);
    let directions: Vec<usize> =
        [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density].map(|k| plan.layout.index(k)).to_vec();
    let mut row = plan.theta.clone();
    row[directions[0]] *= 1.2;
    let rows = [row.clone(), plan.theta.clone()];
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    let right =
        Rollout::new(CpuBackend, &plan, 2).unwrap_or_else(|e| panic!("{e}")).evaluate(&ParamBatch::from_rows(&rows), &request);
    let live = |crew| {
        let backend = GpuBackend::on(gpu.clone()).tuned(Tuning { crew, ..DISPATCHES });
        let mut rollout = Rollout::new(backend, &plan, 2).unwrap_or_else(|e| panic!("{e}"));
        rollout.world_mut().count_dispatches(true).unwrap_or_else(|e| panic!("{e}"));
        let found = rollout.evaluate(&ParamBatch::from_rows(&rows), &request);
        for (a, b) in found.iter().zip(&right) {
            assert!(a.failure.is_none(), "{:?}", a.failure);
            assert_agreement(a, b, &directions);
        }
        // The same bits again.
        let again = rollout.evaluate(&ParamBatch::from_rows(&rows), &request);
        for (a, b) in again.iter().zip(&found) {
            assert_eq!((a.cost.to_bits(), &a.gradient), (b.cost.to_bits(), &b.gradient));
        }
        rollout.world_mut().dispatches().live
    };
    let [apart, staying] = [live(0), live(1)];
    println!("{apart} dispatches, {staying} where workgroups stay");
    assert!(staying > 0 && 2 * staying < apart);
}

#[test]
fn an_adapter_whose_workgroups_do_not_run_at_the_same_time_is_refused() {
    let Some(gpu) = own_device() else { return };
    let asked = gpu.waited(together(&gpu)).unwrap_or_else(|e| panic!("{e}"));
    println!("{} runs {asked} workgroups at the same time", gpu.name);
    let plan = super::scenes::plan(&crowded());
    let stay = Tuning { crew: u32::MAX, ..DISPATCHES };
    let made = Rollout::new(GpuBackend::on(gpu.clone()).tuned(stay), &plan, 1);
    match made {
        Err(e) => assert!(asked < 8 && e.to_string().contains("at the same time"), "{asked}: {e}"),
        Ok(_) => assert!(asked >= 8, "{asked} are too few"),
    }
}
