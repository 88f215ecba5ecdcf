//! Derivatives by several parameters that are solved for at the same time: each is what it is by itself.

use super::products::crowded;
use super::scenes::{device, own_device, plan, spread};
use crate::device::Maker as _;
use crate::device::pipelines::{pass, shared::efforts::LOGGED, shared::structs};
use crate::device::recorder::{Args, Recorder, Size};
use crate::layout::{Health, Newton, Shape};
use crate::world::columns;
use crate::{GpuBackend, Product, Tuning};
use palpate_engine::{Backend, Direction, ParamBatch, Request};
use palpate_model::plan::Plan;
use palpate_model::scene::InitialShape;
use std::collections::HashMap;

/// Derivatives of the last state along each direction, `[direction][2 B N]`, and who failed.
fn tangents(backend: &GpuBackend, plan: &Plan, theta: &[Vec<f64>], directions: &[usize]) -> (Vec<Vec<[u32; 4]>>, Vec<bool>) {
    let mut world = backend.build(plan, theta.len()).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(theta));
    let mut tally = backend.new_tally(&world, &Request::default());
    let [mut now, mut next] = [0; 2].map(|_| backend.new_state(&world));
    let [mut old, mut new] = [0; 2].map(|_| backend.new_tangent(&world, &Direction::parameters(directions)));
    backend.start(&mut world, &mut now, &mut tally);
    backend.start_tangent(&mut world, &now, &mut old, &mut tally);
    for k in 0..plan.clock.steps {
        backend.step(&mut world, &plan.clock.stages()[k], &[&now], &mut next, &mut tally);
        backend.step_tangent(&mut world, &plan.clock.stages()[k], &[&now], &next, &[&old], &mut new, &mut tally);
        std::mem::swap(&mut now, &mut next);
        std::mem::swap(&mut old, &mut new);
    }
    let count = 2 * plan.body.nodes.len() * theta.len();
    let read = |part: &crate::world::Loan| backend.gpu().download(&part.buffer, count).unwrap_or_else(|e| panic!("{e}"));
    let failed = backend.read(&world, &tally).iter().map(|e| e.failure.is_some()).collect();
    (old.parts.iter().map(read).collect(), failed)
}

#[test]
fn a_column_has_the_same_bits_alone_and_among_others() {
    let Some(gpu) = device(None) else { return };
    for many_from in [usize::MAX, 0] {
        let backend = GpuBackend::on(gpu.clone()).tuned(Tuning { many_from, product: Some(Product::Matrix), crew: 0 });
        for state in [InitialShape::Rest, InitialShape::StaticEquilibrium] {
            let mut scene = crowded();
            scene.initial.state = state;
            let plan = plan(&scene);
            let theta = spread(&plan, 2);
            let all: Vec<usize> = (0..plan.layout.len()).collect();
            // More than are solved for at the same time.
            assert!(all.len() as u64 > columns(2));
            let (together, failed) = tangents(&backend, &plan, &theta, &all);
            assert_eq!(failed, [false; 2]);
            for p in [0, 1, all.len() - 1] {
                assert!(together[p].iter().any(|v| v[2] != 0), "nothing depends on parameter {p}");
                let alone = tangents(&backend, &plan, &theta, &[p]).0;
                assert!(alone[0] == together[p], "parameter {p}, many from {many_from}");
            }
        }
    }
}

#[test]
fn columns_of_the_members_beside_one_that_failed_stay_the_same() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plan = plan(&crowded());
    let [first, second]: [Vec<f64>; 2] = spread(&plan, 2).try_into().unwrap_or_else(|_| panic!("two members"));
    let mut broken = first.clone();
    broken[0] = -1.0;
    let of = |theta: &[Vec<f64>]| tangents(&backend, &plan, theta, &[0, 1, 2]);
    let (right, failed) = of(&[first.clone(), second.clone()]);
    assert_eq!(failed, [false; 2]);
    let (beside, failed) = of(&[first, broken, second]);
    assert_eq!(failed, [false, true, false]);
    let n = plan.body.nodes.len();
    for (beside, right) in beside.iter().zip(&right) {
        // Displacements and velocities of the members one after another.
        for (there, here) in [(0, 0), (2, 1), (3, 2), (5, 3)] {
            assert!(beside[there * n..(there + 1) * n] == right[here * n..(here + 1) * n]);
        }
    }
}

#[test]
fn the_first_column_that_fails_is_the_failure_of_its_member() {
    let Some(gpu) = own_device() else { return };
    let ill = |code: u32, step: u32| Health { code, step, detail: [0.5, 7.0] };
    let well = Health::default();
    let (failed, other) = (ill(structs::UNSOLVED, 3), ill(structs::INDEFINITE, 3));
    let before = ill(structs::FELL_OUT, 2);
    // Five members, three columns: none fails; the last; the two last; a member that had failed before; one whose second column was cut off.
    let columns = [[well; 5], [well, well, failed, failed, well], [well, failed, other, other, well]].concat();
    let stage = |k: usize| if k == 9 { structs::WANTS_SOLVE } else { structs::IDLE };
    let newton: Vec<Newton> = (0..15).map(|k| Newton { stage: stage(k), ..Newton::default() }).collect();
    let shape = Shape { members: 5, ..Shape::default() };
    let upload = |name, values: &[Health]| gpu.upload(name, values).unwrap_or_else(|e| panic!("{e}"));
    let world: HashMap<&'static str, wgpu::Buffer> = HashMap::from([
        ("shape", gpu.upload("shape", &[shape]).unwrap_or_else(|e| panic!("{e}"))),
        ("newton", gpu.upload("newton", &newton).unwrap_or_else(|e| panic!("{e}"))),
        ("column_health", upload("column_health", &columns)),
        ("efforts", gpu.upload("efforts", &[0u32; LOGGED as usize]).unwrap_or_else(|e| panic!("{e}"))),
        ("health", upload("health", &[well, well, well, before, well])),
    ]);
    let (mut groups, mut times) = (HashMap::new(), HashMap::new());
    let mut r = Recorder::new(&gpu, &world, &mut groups, false);
    r.run(pass::END_EXACT, &[], Size::All { members: 1, groups: 1 }, Args { extra: 3, ..Args::default() });
    r.submit(&mut times);
    let found: Vec<Health> = gpu.download(&world["health"], 5).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(found[..4], [well, failed, failed, before]);
    assert_eq!(found[4].code, structs::HURRIED);
}
